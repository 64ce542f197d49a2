"""The container of the FMU Manipulation Toolbox: its own C code runs the FMU inside another one."""

import json
import subprocess
import sys
from pathlib import Path

from tests.contracts.interop.importer import Case, Importer

TOOL = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer as f; f()"


class Container(Importer):
    name = "FMU Manipulation Toolbox"
    about = "C; its container runs the FMU, and FMPy the container"
    reads = frozenset({("CS", 2), ("CS", 3)})
    packages = ("fmu-manipulation-toolbox", "fmpy")

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        from fmpy import simulate_fmu

        own = folder / Path(case.fmu).name
        own.write_bytes(Path(case.fmu).read_bytes())
        inside = {
            "name": "it.fmu",
            "step_size": case.step,
            "fmu": [own.name],
            "start": [[own.name, n, repr(v)] for n, v in case.start.items()],
        }
        (folder / "it.json").write_text(json.dumps(inside))
        options = ["-container", "it.json", "-fmu-directory", ".", "-fmi", str(case.fmi)]
        subprocess.run([sys.executable, "-c", TOOL, *options], cwd=folder, check=True, capture_output=True)
        found = simulate_fmu(
            str(folder / "it.fmu"),
            stop_time=case.stop,
            output_interval=case.step,
            step_size=case.step,
            output=case.outputs,
            fmi_type="CoSimulation",
        )
        return [list(row)[1:] for row in found][1:]
