"""Free simulations of an FMU in a process that no other FMU shares.

PythonFMU builds of one name share their modules within a process: the second would run the first one's code.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.host.apart.isolation import Isolation
from fmus.host.apart.room import Room
from fmus.host.fmu import Fmu
from fmus.host.loop import Array


@dataclass(frozen=True)
class FreeRun:
    """Times (N,), s, samples (N,) of inputs, and start values of states and parameters: see Fmu.simulate."""

    t: Array
    inputs: Mapping[str, Array]
    start: Mapping[str, float]


def simulate_apart(
    fmu: Path, runs: Sequence[FreeRun], outputs: Sequence[str], isolation: Isolation | None = None
) -> list[Array]:
    """Outputs (N, n) of each run; FmuError where the FMU refuses a call, FmuEnded where it must be ended."""
    with Room(isolation or Isolation()) as room:
        return [room.call(_simulated, fmu.absolute(), run, list(outputs)) for run in runs]


def _simulated(fmu: Path, run: FreeRun, outputs: Sequence[str]) -> Array:
    with Fmu(fmu) as running:
        return running.simulate(run.t, run.inputs, outputs, run.start)
