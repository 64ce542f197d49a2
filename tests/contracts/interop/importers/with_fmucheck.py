"""fmuCheck, the FMU Compliance Checker of the FMI project."""

import re
import subprocess
from pathlib import Path

from tests.contracts.interop.importer import Case, Failed, Importer, table, told


class FmuCheck(Importer):
    name = "FMUComplianceChecker"
    about = "C around the FMI Library; model exchange by Euler's method"
    reads = frozenset({("CS", 2), ("ME", 2)})
    program = "fmuCheck"
    solver = "euler"
    sets_start = False

    @classmethod
    def version(cls) -> str:
        said = subprocess.run([cls.program, "-v"], capture_output=True, text=True, check=False)
        [found] = re.findall(r"checker (\S+) \[FMILibrary: (\S+)\]", said.stdout + said.stderr)
        return f"{found[0]} with FMI Library {found[1]}"

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        said = told(
            self.program,
            *("-k", case.kind.lower(), "-h", repr(case.step), "-s", repr(case.stop)),
            *("-n", "0", "-o", "out.csv", case.fmu),
            folder=folder,
        )
        if not re.search(r"\s0 Warning\(s\)\s+0 Error\(s\)", said):
            raise Failed(said[-800:])
        return table(folder / "out.csv", case)
