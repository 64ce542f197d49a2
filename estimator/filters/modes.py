"""Modes: competing assumptions about a system, between which a filter of several models decides.

A mode states where some unknowns start, and how much process noise acts. A system that changes its mode gets
new parameters, drawn from the distribution that the entered mode states; its states are continuous. Without
modes of its own, a system gets parts of the distribution that is believed at the start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from fmus.errors import BadInput, did_you_mean

if TYPE_CHECKING:
    from estimator.filters.estimator import Estimate
    from estimator.filters.system import Joint
    from estimator.record import Array, BoolArray


@dataclass(frozen=True)
class Mode:
    """at: start value and standard deviation by name, in the FMU's units; process: factor of Q."""

    at: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    process: float = 1.0


PARTS = (-1.0, 0.0, 1.0)  # places of the parts of a normal distribution, in its standard deviations
NARROW = float(np.sqrt(1 - np.mean(np.square(PARTS))))  # their deviation: they sum to its mean and variance


@dataclass(frozen=True)
class Entry:
    """What a mode states in the filter's coordinates: x and variances (n,), nan where it says nothing.

    redrawn: (n,) which of these are parameters, and so are drawn anew whenever the mode is entered.
    """

    x: Array
    variance: Array
    redrawn: BoolArray
    process: float = 1.0

    def begun(self, start: Estimate) -> Estimate:
        """The start of a filter in this mode."""
        x, P = self._put(start.x, start.P, np.isfinite(self.x))
        return start._replace(x=x, P=P)

    def enter(self, x: Array, P: Array) -> tuple[Array, Array]:
        """Mean (n,) and covariance (n, n) after the mode is entered from another one."""
        return self._put(x, P, self.redrawn)

    def _put(self, x: Array, P: Array, where: BoolArray) -> tuple[Array, Array]:
        x, P = np.where(where, self.x, x), np.where(where[:, None] | where, 0.0, P)
        return x, P + np.diag(np.where(where, self.variance, 0.0))


def parts(start: Estimate, i: int) -> tuple[Entry, ...]:
    """Parts of the distribution of element i of x, whose sum has its mean and variance."""
    n, std = len(start.x), float(np.sqrt(start.P[i, i]))
    this = np.arange(n) == i
    return tuple(
        Entry(
            np.where(this, start.x + place * std, np.nan), np.where(this, (NARROW * std) ** 2, np.nan), this
        )
        for place in PARTS
    )


def entries(joint: Joint, modes: Sequence[Mode]) -> tuple[Entry, ...]:
    """The modes in the coordinates of a joint system; BadInput for an unknown name or a bad value."""
    return tuple(_entry(joint, mode, i) for i, mode in enumerate(modes, 1))


def _entry(joint: Joint, mode: Mode, number: int) -> Entry:
    n = len(joint.names)
    x, variance, redrawn = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, np.bool_)
    parameters = {p.name: p for p in joint.parameters}
    for name, (start, std) in mode.at.items():
        where = f"mode {number}: '{name}'"
        if name not in joint.names:
            raise BadInput(f"{where} is not estimated; {did_you_mean(name, joint.names)}")
        i = joint.names.index(name)
        x[i], variance[i] = start, std**2
        if name in parameters:
            transform, redrawn[i] = parameters[name].transform, True
            try:
                x[i] = transform.z(start)
            except BadInput as error:
                raise BadInput(f"{where}: start {error}") from error
            variance[i] = (std / transform.slope(x[i])) ** 2
    return Entry(x, variance, redrawn, mode.process)


def transitions(n: int, stay: float | None, dt: float) -> Array:
    """Probabilities (n, n) of a change from mode i to mode j over dt [s].

    stay: mean time in a mode, s; None if it never changes.
    A mode is left at a constant rate, to each of the others with the same probability.
    """
    if stay is None or n < 2:
        return np.eye(n)
    p = float(np.exp(-dt / stay))
    found: Array = np.full((n, n), (1 - p) / (n - 1))
    np.fill_diagonal(found, p)
    return found


def mixed(weights: Array, x: Array, P: Array) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of normals x (k, n), P (k, n, n) mixed by weights (k,)."""
    mean = weights @ x
    off = x - mean
    spread: Array = np.einsum("k,kij->ij", weights, P) + np.einsum("k,ki,kj->ij", weights, off, off)
    return mean, (spread + spread.T) / 2
