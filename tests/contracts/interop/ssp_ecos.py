"""Run an SSP package in ecos (C++): SSP STEP N NAME ...; values at the start and after each step."""

import ctypes
import sys
from importlib.metadata import files

# ecospy's library is linked to TBB but does not bring it; the package tbb does
tbb = next(f.locate() for f in files("tbb") if f.name == "libtbb.so.12")
ctypes.CDLL(str(tbb), mode=ctypes.RTLD_GLOBAL)

from ecospy.EcosSimulation import EcosSimulation  # noqa: E402  after the library it needs

path, dt, steps, *names = sys.argv[1:]
with EcosSimulation(ssp_path=path, step_size=float(dt)) as simulation:
    simulation.init(parameter_set="initialValues")
    for k in range(int(steps) + 1):
        if k:
            simulation.step()
        print("row", *(repr(simulation.get_real(n.replace(".", "::"))) for n in names))
