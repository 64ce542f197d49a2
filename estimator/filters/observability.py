"""The states of an FMU on which the measured outputs depend."""

from collections.abc import Sequence

import numpy as np

from estimator.access.copies import Copies
from estimator.record import Array

STEPS = 25
NUDGE = 1e-3  # change of a state, as share of its scale


def needed(copies: Copies, values: Array, states: Sequence[str], outputs: Sequence[str], scale: Array,
           t: float, dt: float) -> list[str]:  # fmt: skip
    """States whose change has an influence on an output within STEPS steps, and states that are outputs.

    values: (n_put,) values that `copies` sets, the states first; scale: (n,) scales of the states. A state
    without influence, such as an angle on which nothing depends, need not be estimated.
    """
    n = len(states)
    rows = np.tile(values, (n + 1, 1))
    rows[1:, :n] += np.diag(NUDGE * scale)
    seen = [copies.get.index(name) for name in outputs]
    shows = np.array([name in outputs for name in states])
    for k in range(STEPS):
        found = copies.advance(rows, t + k * dt, dt)
        shows |= np.any(found[1:, seen] != found[0, seen], axis=1)
        rows[:, :n] = found[:, :n]
    return [name for name, visible in zip(states, shows, strict=True) if visible]
