"""A simulation of a foreign native FMU in a process of its own, beside the same in this process."""

import time
from collections.abc import Iterator

import numpy as np

from benchmarks.group import Group, Row, Work, agreed
from benchmarks.timing import in_turns
from estimator.record import Array
from fmus.export.builders.hypotheses import ForeignBuilder, ModelBuilder
from fmus.host.apart.isolation import ISOLATED
from fmus.host.apart.room import room_of
from fmus.host.fmu import Fmu

DT = 1e-3  # s
APART, HERE = "apart", "the same in this process"
# an input and outputs of models whose steps cost different times
DRIVEN = {
    "drive": ("F", ("q", "q_dot")),
    "vehicle7dof": ("u_fl", ("z1", "phi_y1", "phi_x1")),
    "wheelset": ("y_irr", ("y", "psi", "y_dot", "psi_dot")),
}


class IsolationGroup(Group):
    """Steps of 1 ms of FMUs inside others, as close-loop runs them; processor time of both processes."""

    name = "isolation"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        room = room_of(ISOLATED)

        def clock() -> float:
            return time.process_time() + room.call(time.process_time)

        for model, (driven, outputs) in DRIVEN.items():
            own = ModelBuilder(model, work.folder / model)
            path = ForeignBuilder(own(()), own.ports[:1], work.folder / f"apart_{model}")(())
            for steps in (work.of(2000, 100), work.of(10000, 200)):
                t: Array = np.arange(steps + 1) * DT
                inputs = {driven: 1e-3 * np.sin(20 * t)}
                with Fmu(path) as here, Fmu(path, ISOLATED) as apart:
                    runs = {
                        APART: lambda f=apart, t=t, u=inputs, y=outputs: f.simulate(t, u, y, {}),
                        HERE: lambda f=here, t=t, u=inputs, y=outputs: f.simulate(t, u, y, {}),
                    }
                    agreed(runs[APART](), runs[HERE](), 0.0, f"{model}, {APART}, {HERE}")
                    times = in_turns(runs, work.of(60, 3), clock)
                how = f"1 sampled input, {len(outputs)} outputs, processor time of both processes; per step"
                name = f"{model}: simulation of {steps} steps in a process of its own"
                yield times.row(name, APART, HERE, "µs", how, factor=1e6 / steps)
