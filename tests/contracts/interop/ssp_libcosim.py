"""Run an unpacked SSP package in libcosim (C++) with its own step: FOLDER N NAME ...; see ssp_ecos.py."""

import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

path, steps, *names = sys.argv[1:]
execution = CosimExecution.from_ssp_file(path)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
places = []
for name in names:
    slave, _, variable = name.partition(".")
    index = next(s.index for s in execution.slave_infos() if s.name.decode() == slave)
    places.append(
        (index, next(v.reference for v in execution.slave_variables(index) if v.name.decode() == variable))
    )
for _ in range(int(steps)):
    execution.step()
    print("row", *(repr(observer.last_real_values(index, [reference])[0]) for index, reference in places))
