"""ecos by its Python package ecospy."""

import ctypes
from importlib.metadata import files
from pathlib import Path

from tests.contracts.interop.importer import Case, Importer


class Ecos(Importer):
    name = "ecos"
    about = "C++ around fmi4c"
    reads = frozenset({("CS", 2), ("CS", 3)})
    packages = ("ecospy", "tbb")
    remark = (
        "reports of an FMI 3.0 FMU that `fmi3GetVersion` is missing, "
        "which is an error in ecos, and then runs it"
    )

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        # ecospy's library is linked to TBB but does not bring it; the package tbb does
        tbb = next(f.locate() for f in files("tbb") or [] if f.name == "libtbb.so.12")
        ctypes.CDLL(str(tbb), mode=ctypes.RTLD_GLOBAL)
        from ecospy.EcosSimulation import EcosSimulation
        from ecospy.EcosSimulationStructure import EcosSimulationStructure

        rows = []
        with EcosSimulationStructure() as structure:
            structure.add_model("it", case.fmu)
            structure.add_parameter_set("start", {f"it::{n}": v for n, v in case.start.items()})
            with EcosSimulation(structure=structure, step_size=case.step) as simulation:
                simulation.init(parameter_set="start")
                for _ in range(case.steps):
                    simulation.step()
                    rows.append([simulation.get_real(f"it::{n}") for n in case.outputs])
        return rows
