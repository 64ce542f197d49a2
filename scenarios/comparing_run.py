"""A free run of an FMU in a process of its own.

PythonFMU builds of one name share their modules within a process: the second would run the first one's code.
"""

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from estimator.plant import Plant
from estimator.record import Array, Run
from fmus.errors import BadInput
from fmus.host.fmu import Fmu, FmuError

ASKED, FOUND = "asked.pickle", "found.pickle"


@dataclass(frozen=True)
class Job:
    """Free runs from start values, each through its run's inputs; outputs are read by name."""

    fmu: Path
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    runs: tuple[tuple[Run, Mapping[str, float]], ...]


def courses(job: Job) -> list[Array]:
    """Outputs (N, n) of each run; FmuError where the FMU refuses a call or brings its process down."""
    with tempfile.TemporaryDirectory(prefix="railfmi_compare_") as folder:
        (Path(folder) / ASKED).write_bytes(pickle.dumps(job))
        command = [sys.executable, "-P", "-m", "scenarios.comparing_run", folder]
        paths = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        quiet = subprocess.DEVNULL  # FMUs may print
        ended = subprocess.run(command, env=paths, stdout=quiet, stderr=quiet, check=False)
        found = Path(folder) / FOUND
        if ended.returncode or not found.is_file():
            raise FmuError(f"{job.fmu}: brings down the process that runs it; 'railfmi check' tells where")
        result: list[Array] | BadInput | FmuError = pickle.loads(found.read_bytes())
    if isinstance(result, Exception):
        raise result
    return result


def _run(job: Job) -> list[Array]:
    with Fmu(job.fmu) as fmu:
        plant = Plant(fmu, job.inputs, job.outputs)
        return [plant.simulate(run, start) for run, start in job.runs]


def main(folder: str) -> None:
    """Answer what is asked in a folder, there; a refusal is an answer too."""
    result: list[Array] | BadInput | FmuError
    try:
        result = _run(pickle.loads((Path(folder) / ASKED).read_bytes()))
    except (BadInput, FmuError) as error:
        result = error
    (Path(folder) / FOUND).write_bytes(pickle.dumps(result))


if __name__ == "__main__":
    from scenarios import comparing_run  # under the name by which it was pickled

    comparing_run.main(sys.argv[1])
