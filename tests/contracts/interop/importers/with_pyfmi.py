"""PyFMI of Modelon, in an interpreter of its own, because it is built for an older NumPy than ours."""

import json
import os
import shutil
import subprocess
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType

from tests.contracts.interop.importer import DEADLY, SOLVED, TIMEOUT, Case, Failed, Importer

SCRIPT = """
import json, sys
from pyfmi import load_fmu

case = json.loads(sys.argv[1])
fmu = load_fmu(case["fmu"], kind=case["kind"], log_level=1)
for name, value in case["start"].items():
    fmu.set(name, value)
options = fmu.simulate_options()
options["ncp"] = case["steps"]
options["result_handling"] = "binary" if case["fmi"] == 3 else "memory"
if case["kind"] == "CS":
    options["silent_mode"] = True
else:
    options["solver"] = "CVode"
    options["CVode_options"].update(rtol=1e-10, verbosity=50)
found = fmu.simulate(final_time=case["step"] * case["steps"], options=options)
columns = [found[name] for name in case["outputs"]]
print("ROWS", json.dumps([[float(c[k]) for c in columns] for k in range(1, case["steps"] + 1)]))
"""
TOOL = "refuses an FMU that needs an execution tool, as those that need a Python interpreter say they do"


class PyFmi(Importer):
    name = "PyFMI"
    about = "Python around FMI Library and Assimulo; model exchange by CVode"
    reads = frozenset({("CS", 2), ("ME", 2), ("ME", 3)})
    program = "pyfmi_python"
    solver = "cvode"
    tolerance = SOLVED
    fails = MappingProxyType({("python", "CS", 2): TOOL})
    remark = "reads FMI 3.0 for model exchange only"

    @classmethod
    def version(cls) -> str:
        return _ran("-c", "import pyfmi; print(pyfmi.__version__)").strip().splitlines()[-1]

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        said = _ran("-c", SCRIPT, json.dumps(asdict(case)), folder=folder)
        [rows] = [line for line in said.splitlines() if line.startswith("ROWS ")]
        return json.loads(rows.removeprefix("ROWS "))


def _ran(*words: str, folder: Path | None = None) -> str:
    """What the interpreter prints; Failed where it ends with an error."""
    program = shutil.which(PyFmi.program) or PyFmi.program
    own = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    done = subprocess.run(
        [program, *words], cwd=folder, env=own, capture_output=True, text=True, timeout=TIMEOUT
    )
    if done.returncode:
        raise Failed(f"{DEADLY.format(code=done.returncode)}: {done.stderr.strip()[-500:]}")
    return done.stdout
