"""Positions of a filter's unknowns in x and in the rows of values that are set in an FMU."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from estimator.filters.algebra import compiled
from estimator.filters.bounds import (
    Transform,
    Whole,
    coded,
    grown,
)
from estimator.filters.unknown_input import NoisyInput, UnknownInput
from estimator.record import Array


@dataclass(frozen=True)
class Layout:
    """The order of values in x and in a row.

    x: n states, coordinates of the parameters, states of the unknown inputs, errors of known inputs, noise of
    the sensors. Row: n states, other states, parameters, known inputs, inputs that unknown inputs drive.
    """

    n: int
    others: int
    transforms: tuple[Whole, Array, Array]  # (p,) each, see transform.coded
    inputs: int
    fed: Whole  # (n_fed,) index of the unknown inputs' state that drives each input
    errors: Whole  # (n_errors, 2) a known input, and the index of the state that is its error

    @cached_property
    def width(self) -> int:
        """Length of a row."""
        return self.n + self.others + len(self.transforms[0]) + self.inputs + len(self.fed)

    def rows(self, X: Array, u: Array, carried: Array, F: Array) -> tuple[Array, Array]:
        """Rows (k, width) for a step from X (k, n_x), and X after the step without the FMU's states.

        u: (inputs,); carried: (others,); F: (n_w, n_w) transition of the states after the parameters; unknown
        inputs and errors of known ones act with the mean of their values at both ends.
        """
        values, after = np.empty((len(X), self.width)), np.empty(X.shape)
        fill(X, u, carried, F, self.n, *self.transforms, self.fed, self.errors, values, after)
        return values, after


def layout(
    n: int, others: int, transforms: Sequence[Transform], inputs: Sequence[str],
    unknown: Sequence[UnknownInput], errors: Sequence[NoisyInput] = (),
) -> Layout:  # fmt: skip
    """The layout for n states, so many others and the known inputs."""
    fed, at = [], 0
    for w in unknown:
        fed += [at + state for state in w.feeds.values()]
        at += len(w.states)
    noisy = [(inputs.index(e.name), at + 2 * i) for i, e in enumerate(errors)]
    return Layout(
        n, others, coded(transforms), len(inputs), np.array(fed, dtype=np.int64),
        np.array(noisy, dtype=np.int64).reshape(-1, 2),
    )  # fmt: skip


@compiled
def collect(found: Array, n: int, after: Array, carried: Array) -> None:
    """Copy the n states of each row read from the FMU into `after`, and the other states of the first row."""
    for k in range(len(found)):
        for i in range(n):
            after[k, i] = found[k, i]
    for i in range(len(carried)):
        carried[i] = found[0, n + i]


@compiled
def fill(
    X: Array, u: Array, carried: Array, F: Array, n: int, codes: Whole, low: Array, high: Array, fed: Whole,
    errors: Whole, values: Array, after: Array,
) -> None:  # fmt: skip
    """See Layout.rows; codes, low, high: transforms of the parameters."""
    first = n + len(codes)  # of the states of the unknown inputs in x
    at_parameters, at_inputs = n + len(carried), len(carried) + first
    at_fed = at_inputs + len(u)
    for k in range(len(X)):
        for i in range(n):
            values[k, i] = after[k, i] = X[k, i]
        for i in range(len(carried)):
            values[k, n + i] = carried[i]
        for i in range(len(codes)):
            values[k, at_parameters + i] = grown(codes[i], low[i], high[i], X[k, n + i])
            after[k, n + i] = X[k, n + i]
        for i in range(len(u)):
            values[k, at_inputs + i] = u[i]
        for i in range(len(F)):
            total = 0.0
            for j in range(len(F)):
                total += F[i, j] * X[k, first + j]
            after[k, first + i] = total
        for i in range(len(fed)):
            values[k, at_fed + i] = (X[k, first + fed[i]] + after[k, first + fed[i]]) / 2
        for i in range(len(errors)):
            state = first + errors[i, 1]
            values[k, at_inputs + errors[i, 0]] += (X[k, state] + after[k, state]) / 2
