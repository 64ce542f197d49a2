"""Free runs of an FMU in a process of its own.

PythonFMU builds of one name share their modules within a process: the second would run the first one's code.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus import codec
from fmus.errors import BadInput
from fmus.host.fmu import Fmu, FmuError
from fmus.host.instance import Array

ASKED, FOUND = "asked.npz", "found.npz"
REFUSALS: Mapping[str, type[BadInput | FmuError]] = {"BadInput": BadInput, "FmuError": FmuError}


@dataclass(frozen=True)
class FreeRun:
    """Times (N,), s, samples (N,) of inputs, and start values of states and parameters: see Fmu.simulate."""

    t: Array
    inputs: Mapping[str, Array]
    start: Mapping[str, float]


def simulate_apart(fmu: Path, runs: Sequence[FreeRun], outputs: Sequence[str]) -> list[Array]:
    """Outputs (N, n) of each run; FmuError where the FMU refuses a call or brings its process down."""
    with tempfile.TemporaryDirectory(prefix="railfmi_apart_") as folder:
        asked = [{"t": run.t, "inputs": dict(run.inputs), "start": dict(run.start)} for run in runs]
        _write(Path(folder) / ASKED, {"fmu": fmu, "runs": asked, "outputs": list(outputs)})
        command = [sys.executable, "-P", "-m", "fmus.host.apart", folder]
        paths = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        quiet = subprocess.DEVNULL  # FMUs may print
        ended = subprocess.run(command, env=paths, stdout=quiet, stderr=quiet, check=False)
        died = FmuError(f"{fmu}: brings down the process that runs it; 'railfmi check' tells more")
        if ended.returncode:
            raise died
        try:
            result: dict[str, Any] = _read(Path(folder) / FOUND)
        except (OSError, codec.Unreadable) as error:
            raise died from error
    if "kind" in result:
        raise REFUSALS[result["kind"]](result["message"])
    outcomes: list[Array] = result["runs"]
    return outcomes


def main(folder: str) -> None:
    """Answer what is asked in a folder, there; a refusal is an answer too."""
    asked = _read(Path(folder) / ASKED)
    result: dict[str, object]
    try:
        with Fmu(asked["fmu"]) as running:
            simulate, outputs = running.simulate, asked["outputs"]
            result = {"runs": [simulate(r["t"], r["inputs"], outputs, r["start"]) for r in asked["runs"]]}
    except (BadInput, FmuError) as error:
        [kind] = [name for name, refusal in REFUSALS.items() if isinstance(error, refusal)]
        result = {"kind": kind, "message": str(error)}
    _write(Path(folder) / FOUND, result)


def _write(file: Path, value: object) -> None:
    with file.open("wb") as stream:
        codec.write(stream, value)


def _read(file: Path) -> Any:
    with file.open("rb") as stream:
        return codec.read(stream)


if __name__ == "__main__":
    main(sys.argv[1])
