"""OMSimulator of the OpenModelica consortium, by its program."""

import subprocess
from pathlib import Path

from tests.contracts.interop.importer import SOLVED, Case, Importer, table, told


class OMSimulator(Importer):
    name = "OMSimulator"
    about = "C++ around fmi4c; model exchange by CVode"
    reads = frozenset({("CS", 2), ("CS", 3), ("ME", 2), ("ME", 3)})
    program = "OMSimulator"
    solver = "cvode"
    sets_start = False
    tolerance = SOLVED

    @classmethod
    def version(cls) -> str:
        said = subprocess.run([cls.program, "--version"], capture_output=True, text=True, check=True)
        return said.stdout.split()[1].removeprefix("v").removesuffix("-linux-debug")

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        told(
            self.program,
            f"--mode={case.kind.lower()}",
            f"--stopTime={case.stop!r}",
            f"--stepSize={case.step!r}",
            f"--intervals={case.steps + 1}",
            "--tolerance=1e-10",
            "--stripRoot=true",
            "--resultFile=out.csv",
            case.fmu,
            folder=folder,
        )
        return table(folder / "out.csv", case)
