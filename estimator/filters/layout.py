"""Positions of a filter's unknowns in x and in the rows of values that are set in an FMU."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.filters.algebra import compiled
from estimator.filters.bounds import (
    Transform,
    Whole,
    coded,
    grow,
)
from estimator.filters.unknown_input import UnknownInput
from estimator.record import Array


@dataclass(frozen=True)
class Layout:
    """The order of values in x and in a row.

    x: n states, coordinates of the parameters, states of the unknown inputs. Row: n states, other states,
    parameters, known inputs, inputs that are driven by unknown inputs.
    """

    n: int
    others: int
    transforms: tuple[Whole, Array, Array]  # (p,) each, see transform.coded
    inputs: int
    fed: Whole  # (n_fed,) index of the unknown inputs' state that drives each input

    @property
    def width(self) -> int:
        """Length of a row."""
        return self.n + self.others + len(self.transforms[0]) + self.inputs + len(self.fed)

    def rows(self, X: Array, u: Array, carried: Array, F: Array) -> tuple[Array, Array]:
        """Rows (k, width) for a step from X (k, n_x), and X after the step without the FMU's states.

        u: (inputs,); carried: (others,); F: (n_w, n_w) transition of the states of the unknown inputs, which
        act with the mean of their values at both ends.
        """
        values, after = np.empty((len(X), self.width)), np.empty_like(X)
        at, end = self.n + self.others, self.n + len(self.transforms[0])
        fill(X, u, carried, F, self.n, end, self.fed, values, after)
        if end > self.n:
            grow(*self.transforms, X[:, self.n : end], values[:, at:])
        return values, after


def layout(
    n: int, others: int, transforms: Sequence[Transform], inputs: int, unknown: Sequence[UnknownInput]
) -> Layout:
    """The layout for n states and the given numbers of other states and known inputs."""
    fed, at = [], 0
    for w in unknown:
        fed += [at + state for state in w.feeds.values()]
        at += len(w.states)
    return Layout(n, others, coded(transforms), inputs, np.array(fed, dtype=np.int64))


@compiled
def fill(
    X: Array, u: Array, carried: Array, F: Array, n: int, first: int, fed: Whole, values: Array, after: Array
) -> None:
    """See Layout.rows; first: position of the unknown inputs in x. Parameters in `values` are not filled."""
    at_inputs = len(carried) + first
    at_fed = at_inputs + len(u)
    for row in range(len(X)):
        x, end, value = X[row], after[row], values[row]
        value[:n] = x[:n]
        value[n : n + len(carried)] = carried
        value[at_inputs:at_fed] = u
        end[:first] = x[:first]
        for i in range(len(F)):
            end[first + i] = 0.0
            for j in range(len(F)):
                end[first + i] += F[i, j] * x[first + j]
        for i in range(len(fed)):
            value[at_fed + i] = (x[first + fed[i]] + end[first + fed[i]]) / 2
