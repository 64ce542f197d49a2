"""How long a step of an FMU takes; a module of its own because it is run as a process of its own."""

import json
import sys
import time
from pathlib import Path

import numpy as np

from fmus.errors import BadInput
from fmus.host.apart.serving import limit_process
from fmus.host.archive import Archive
from fmus.host.fmu import FmuError
from fmus.host.grading.bench import STEPS as TRIED
from fmus.host.grading.bench import Bench
from fmus.limits import MEMORY

STEPS = 200  # of one simulation
LONG_ENOUGH = 0.3  # s, for all simulations together
MOST = 20  # simulations
WAY_OUT = "free space, or name another folder in the variable TMPDIR"


def step_cost(bench: Bench) -> float:
    """Processor time of a step in a simulation, s: the least of several simulations.

    Raises FmuError where the FMU refuses its own start values.
    """
    steps = STEPS if bench.steps == TRIED else bench.steps
    t = bench.dt * np.arange(steps + 1, dtype=np.float64)
    rows = [bench.inputs(k) for k in range(steps + 1)]
    inputs = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    start = {name: x for name, x in bench.start.items() if name not in inputs}
    times: list[float] = []
    with bench.instance() as fmu:
        while sum(times) < LONG_ENOUGH and len(times) < MOST:
            begun = time.process_time()
            fmu.simulate(t, inputs, bench.outputs, start)
            times.append(time.process_time() - begun)
    return min(times) / steps


def main(path: str, results: str) -> None:
    """Write the time of a step as JSON, or why the FMU cannot be unpacked; nothing if it refuses to run."""
    found: dict[str, str | float]
    try:
        archive = Archive(path)
    except (OSError, BadInput) as error:  # the trials have unpacked it before
        said = (
            str(error) if isinstance(error, BadInput) else f"{path}: cannot be unpacked ({error}); {WAY_OUT}"
        )
        found = {"unusable": said}
    else:
        with archive:
            try:
                found = {"seconds": step_cost(Bench(archive))}
            except (FmuError, BadInput):
                return
    Path(results).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    limit_process(MEMORY)
    main(*sys.argv[1:])
