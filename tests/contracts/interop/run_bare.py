"""Run FMUs where FMPy is, with a CasADi of any version or none: START(json) FMU, and so on; rows as JSON."""

import json
import sys

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

STEP = 1e-3  # s
SAMPLES = 200

found = {}
for start, path in zip(sys.argv[1::2], sys.argv[2::2], strict=True):
    about = read_model_description(path)
    fmu = FMU2Slave(
        guid=about.guid,
        modelIdentifier=about.coSimulation.modelIdentifier,
        unzipDirectory=extract(path),
        instanceName=about.modelName,
    )
    fmu.instantiate(loggingOn=True)
    outputs = [v.valueReference for v in about.modelVariables if v.causality == "output"]
    references = {v.name: v.valueReference for v in about.modelVariables}
    for name, value in json.loads(start).items():
        fmu.setReal([references[name]], [value])
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    rows = []
    for k in range(SAMPLES):
        fmu.doStep(k * STEP, STEP)
        rows.append(fmu.getReal(outputs))
    fmu.terminate()
    found[about.modelName] = rows
print("FOUND", json.dumps(found))
