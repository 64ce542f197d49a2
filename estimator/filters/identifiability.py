"""What data can tell of each unknown: before, by free simulations; after, by what the filter learnt."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.record import Array

NUDGE = 1e-3  # of the prior deviation, for differences
INFORMED = 0.9  # of its prior deviation must an unknown fall below to count as informed by the data
ALIKE = 0.99  # correlation from which on only a combination of two unknowns is known


@dataclass(frozen=True)
class Identifiability:
    """How far the data narrow each unknown, and which they cannot tell apart.

    left: (n,) deviation afterwards over that before; correlation: (n, n).
    """

    names: tuple[str, ...]
    left: Array
    correlation: Array

    @property
    def informed(self) -> tuple[bool, ...]:
        """Whether the data say anything about each."""
        return tuple(bool(v < INFORMED) for v in self.left)

    @property
    def alike(self) -> list[tuple[str, str, float]]:
        """Pairs of which only a combination is known, with their correlation, the worst first."""
        n = len(self.names)
        found = [
            (self.names[i], self.names[j], float(self.correlation[i, j]))
            for i in range(n)
            for j in range(i)
            if abs(self.correlation[i, j]) > ALIKE and min(self.left[i], self.left[j]) < INFORMED
        ]
        return sorted(found, key=lambda pair: -abs(pair[2]))


def information(simulate: Callable[[Array], Array], z: Array, std: Array, noise: Array) -> Array:
    """Empirical Fisher information (n, n) of unknowns z (n,) in outputs (N, m) with noise (m,).

    simulate(z) -> (N, m), nan where nothing is measured; differences over a small part of std (n,).
    """
    columns = []
    for i, s in enumerate(std):
        away = np.zeros(len(z))
        away[i] = NUDGE * s
        slope = (simulate(z + away) - simulate(z - away)) / (2 * NUDGE * s)
        columns.append(np.nan_to_num(slope / noise).ravel())
    J = np.column_stack(columns)
    found: Array = J.T @ J
    return found


def before(names: Sequence[str], F: Array, std: Array, wanted: int) -> Identifiability:
    """What the information F (n, n) leaves of prior deviations std (n,), for the last `wanted` unknowns.

    The bound of Cramér and Rao with the prior: no process noise, so that no filter can do better.
    """
    P = np.asarray(
        np.linalg.inv(F * np.outer(std, std) + np.eye(len(std))), dtype=np.float64
    )  # over the prior deviations
    one: Array = np.ones(len(std))
    return _narrowed(names, P, one, wanted)


def afterwards(names: Sequence[str], P0: Array, P: Array, wanted: int) -> Identifiability:
    """What a filter's covariance P (n, n) leaves of the one it began with, for the last `wanted` unknowns."""
    std: Array = np.sqrt(np.diag(P0))
    return _narrowed(names, P, std, wanted)


def _narrowed(names: Sequence[str], P: Array, std: Array, wanted: int) -> Identifiability:
    first = len(names) - wanted
    P = P[first:, first:]
    size: Array = np.sqrt(np.diag(P))
    return Identifiability(tuple(names)[first:], size / std[first:], P / np.outer(size, size))
