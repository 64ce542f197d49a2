"""Free runs of an FMU in a process of its own.

PythonFMU builds of one name share their modules within a process: the second would run the first one's code.
"""

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.errors import BadInput
from fmus.host.fmu import Fmu, FmuError
from fmus.host.instance import Array

ASKED, FOUND = "asked.pickle", "found.pickle"


@dataclass(frozen=True)
class FreeRun:
    """Times (N,), s, samples (N,) of inputs, and start values of states and parameters: see Fmu.simulate."""

    t: Array
    inputs: Mapping[str, Array]
    start: Mapping[str, float]


def simulate_apart(fmu: Path, runs: Sequence[FreeRun], outputs: Sequence[str]) -> list[Array]:
    """Outputs (N, n) of each run; FmuError where the FMU refuses a call or brings its process down."""
    with tempfile.TemporaryDirectory(prefix="railfmi_apart_") as folder:
        (Path(folder) / ASKED).write_bytes(pickle.dumps((fmu, tuple(runs), tuple(outputs))))
        command = [sys.executable, "-P", "-m", "fmus.host.apart", folder]
        paths = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        quiet = subprocess.DEVNULL  # FMUs may print
        ended = subprocess.run(command, env=paths, stdout=quiet, stderr=quiet, check=False)
        found = Path(folder) / FOUND
        if ended.returncode or not found.is_file():
            raise FmuError(f"{fmu}: brings down the process that runs it; 'railfmi check' tells more")
        result: list[Array] | BadInput | FmuError = pickle.loads(found.read_bytes())
    if isinstance(result, Exception):
        raise result
    return result


def main(folder: str) -> None:
    """Answer what is asked in a folder, there; a refusal is an answer too."""
    fmu, runs, outputs = pickle.loads((Path(folder) / ASKED).read_bytes())
    result: list[Array] | BadInput | FmuError
    try:
        with Fmu(fmu) as running:
            result = [running.simulate(run.t, run.inputs, outputs, run.start) for run in runs]
    except (BadInput, FmuError) as error:
        result = error
    (Path(folder) / FOUND).write_bytes(pickle.dumps(result))


if __name__ == "__main__":
    main(sys.argv[1])
