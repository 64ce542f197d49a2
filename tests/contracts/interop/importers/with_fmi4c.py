"""fmi4ctest, the program that comes with fmi4c."""

from pathlib import Path

from tests.contracts.interop.importer import Case, Importer, table, told


class Fmi4c(Importer):
    name = "fmi4c"
    about = "C; its program fmi4ctest, model exchange by Euler's method"
    reads = frozenset({("CS", 3), ("ME", 2), ("ME", 3)})
    program = "fmi4ctest"
    solver = "euler"
    sets_start = False
    resolution = 1e-6
    remark = (
        "prints six decimals, so that smaller differences are not seen; "
        "writes no values of co-simulation by FMI 2.0, and for FMI 3.0 times one step early"
    )

    @classmethod
    def version(cls) -> str:
        return ""  # it tells none

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        options = ("-m", case.kind.lower(), "-h", repr(case.step), "-s", repr(case.stop + case.step))
        told(self.program, *options, "-o", "out.csv", case.fmu, folder=folder)
        return table(folder / "out.csv", case, early=case.step if case.fmi == 3 else 0.0)
