"""fmusim, the simulator that the Reference-FMUs had until version 0.0.39."""

import subprocess
from pathlib import Path

from tests.contracts.interop.importer import SOLVED, Case, Importer, table, told


class Fmusim(Importer):
    name = "fmusim of the Reference-FMUs"
    about = "C; model exchange by CVode"
    reads = frozenset({("CS", 2), ("CS", 3), ("ME", 2), ("ME", 3)})
    program = "fmusim"
    solver = "cvode"
    tolerance = SOLVED

    @classmethod
    def version(cls) -> str:
        said = subprocess.run([cls.program, "--version"], capture_output=True, text=True, check=True)
        return said.stdout.split()[1]

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        values = [part for n, v in case.start.items() for part in ("--start-value", n, repr(v))]
        told(
            self.program,
            *("--interface-type", case.kind.lower(), "--solver", "cvode", "--tolerance", "1e-10"),
            *("--output-interval", repr(case.step), "--stop-time", repr(case.stop), *values),
            *(part for n in case.outputs for part in ("--output-variable", n)),
            *("--output-file", "out.csv", case.fmu),
            folder=folder,
        )
        return table(folder / "out.csv", case)
