"""Run an FMU in ecos (C++, FMI 1 to 3): FMU STEP N START(json) OUTPUT ...; a line of outputs per step."""

import ctypes
import json
import sys
from importlib.metadata import files

# ecospy's library is linked to TBB but does not bring it; the package tbb does
tbb = next(f.locate() for f in files("tbb") if f.name == "libtbb.so.12")
ctypes.CDLL(str(tbb), mode=ctypes.RTLD_GLOBAL)

from ecospy.EcosSimulation import EcosSimulation  # noqa: E402  after the library it needs
from ecospy.EcosSimulationStructure import EcosSimulationStructure  # noqa: E402

path, dt, steps, start, *outputs = sys.argv[1:]
with EcosSimulationStructure() as structure:
    structure.add_model("it", path)
    structure.add_parameter_set("start", {f"it::{n}": v for n, v in json.loads(start).items()})
    with EcosSimulation(structure=structure, step_size=float(dt)) as simulation:
        simulation.init(parameter_set="start")
        for _ in range(int(steps)):
            simulation.step()
            print("row", *(repr(simulation.get_real(f"it::{n}")) for n in outputs))
