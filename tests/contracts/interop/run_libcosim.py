"""Run an FMU in libcosim (C++ around the FMI Library): FMU STEP N START(json) OUTPUT ...; see run_ecos.py."""

import json
import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

path, dt, steps, start, *outputs = sys.argv[1:]
execution = CosimExecution.from_step_size(round(float(dt) * 1e9))  # ns
index = execution.add_local_slave(CosimLocalSlave(path, "it"))
references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
for name, value in json.loads(start).items():
    execution.real_initial_value(index, references[name], value)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
for _ in range(int(steps)):
    execution.step()
    print("row", *map(repr, observer.last_real_values(index, [references[n] for n in outputs])))
