"""Which states of an FMU the measured outputs depend on at all."""

from collections.abc import Sequence

import numpy as np

from estimator.access.copies import Copies
from estimator.record import Array

STEPS = 25
NUDGE = 1e-3  # of a state's scale


def needed(copies: Copies, values: Array, states: Sequence[str], outputs: Sequence[str], scale: Array,
           t: float, dt: float) -> list[str]:  # fmt: skip
    """States whose change shows in an output, or in a state that does, within some steps.

    values: (n_put,) of what `copies` sets, the states first; scale: (n,) of the states. A state that shows
    nowhere, such as an angle that nothing depends on, can be carried along and need not be estimated.
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
