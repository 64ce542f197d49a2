"""Identifiability of unknowns: from simulations before filtering, and from the filter's covariance after."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from estimator.filters.policy import POLICY
from estimator.record import Array
from fmus.aside import blocks, by_rows, let_go

NUDGE = 1e-3  # finite difference, as share of the prior standard deviation


@dataclass(frozen=True)
class Identifiability:
    """How much the data reduce the uncertainty of each unknown, and which unknowns they cannot separate.

    left: (n,) ratio of posterior to prior standard deviation; correlation: (n, n) of the posterior.
    """

    names: tuple[str, ...]
    left: Array
    correlation: Array

    @property
    def informed(self) -> tuple[bool, ...]:
        """Whether the data determine each unknown, at least in part."""
        return tuple(bool(v < POLICY.informed) for v in self.left)

    @property
    def alike(self) -> list[tuple[str, str, float]]:
        """Pairs of which only a combination is determined, with their correlation, the largest first."""
        n = len(self.names)
        found = [
            (self.names[i], self.names[j], float(self.correlation[i, j]))
            for i in range(n)
            for j in range(i)
            if abs(self.correlation[i, j]) > POLICY.alike
            and min(self.left[i], self.left[j]) < POLICY.informed
        ]
        return sorted(found, key=lambda pair: -abs(pair[2]))


def information(simulate: Callable[[Array], Array], z: Array, std: Array, noise: Array) -> Array:
    """Fisher information (n, n) of unknowns z (n,) from outputs (N, m) with noise (m,), by differences.

    simulate: function of z that returns (N, m), nan where nothing is measured; std: (n,) prior deviations.
    """
    slopes = []
    for i, s in enumerate(std):
        let_go()
        away = np.zeros(len(z))
        away[i] = NUDGE * s
        ahead, behind, scale = simulate(z + away), simulate(z - away), 2 * NUDGE * s * noise
        slopes.append(by_rows(ahead.shape, partial(_slope, ahead, behind, scale)))
    found: Array = np.zeros((len(z), len(z)))
    for rows in blocks(len(slopes[0]), 8 * len(slopes) * len(noise)):
        J = np.column_stack([slope[rows].ravel() for slope in slopes])
        found += J.T @ J
        let_go()
    return found


def _slope(ahead: Array, behind: Array, scale: Array, rows: slice) -> Array:
    """Difference of some rows of two arrays (N, m) over a scale (m,), 0 where nothing is measured."""
    slope: Array = np.nan_to_num((ahead[rows] - behind[rows]) / scale)
    return slope


def before(names: Sequence[str], F: Array, std: Array, wanted: int) -> Identifiability:
    """Identifiability of the last `wanted` unknowns from information F (n, n) and prior deviations std (n,).

    This is the Cramér-Rao bound with the prior and without process noise, so that no filter can be better.
    """
    P = np.asarray(
        np.linalg.inv(F * np.outer(std, std) + np.eye(len(std))), dtype=np.float64
    )  # over the prior deviations
    one: Array = np.ones(len(std))
    return _narrowed(names, P, one, wanted)


def afterwards(names: Sequence[str], P0: Array, P: Array, wanted: int) -> Identifiability:
    """Identifiability of the last `wanted` unknowns from a filter's initial and final covariance (n, n)."""
    std: Array = np.sqrt(np.diag(P0))
    return _narrowed(names, P, std, wanted)


def _narrowed(names: Sequence[str], P: Array, std: Array, wanted: int) -> Identifiability:
    first = len(names) - wanted
    P = P[first:, first:]
    size: Array = np.sqrt(np.diag(P))
    return Identifiability(tuple(names)[first:], size / std[first:], P / np.outer(size, size))
