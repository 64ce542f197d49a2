"""Least squares between bounds by the method of Levenberg and Marquardt, with a trust region.

Each step is the solution of the linearised problem between the bounds, by an active-set method (P. B. Stark,
R. L. Parker, Computational Statistics 10 (1995), 129-141). A bound at which the optimum lies is therefore
reached in few steps. The methods of scipy either approach the bounds in many steps, or search a box about the
present values, which ends early where unknowns compensate each other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from estimator.record import Array

POOR, GOOD = 0.25, 0.75  # shares of the predicted reduction, below and above which the trust region changes
ACCEPTED = 1e-4  # share of the predicted reduction, above which a step is taken
SHORTEST = 1e-5  # length of a step over that of the values, in scales, below which the descent ends
LEAST_DAMPING = 1e-6  # over the largest column of the Jacobian
# share of the way to a bound that an unknown goes in one step at most: there, the residual may not depend on
# it any more, as on the rounding of a friction that is zero
TOWARDS = 0.75
AT_BOUND = 1e-3  # scales from a bound, within which it may go all the way
TRIALS = 25  # largest number of dampings that are tried for one step


@dataclass(frozen=True)
class Optimum:
    """Where a descent ended: x (n,), half of the sum of squares, evaluations, and whether it converged."""

    x: Array
    cost: float
    nfev: int
    converged: bool


def descended(
    residual: Callable[[Array], Array], jacobian: Callable[[Array], Array], x: Array,
    bounds: tuple[Array, Array], scale: Array, gain: float, evaluations: int,
) -> Optimum:  # fmt: skip
    """Descend from x (n,) between bounds (n,) each, to where no step is predicted to reduce the squares.

    residual: at x, (m,); jacobian: there, (m, n); scale: (n,) of the unknowns; gain: relative reduction of
    the sum of squares, below which the descent ends; evaluations: of the residual, at most.
    """
    r, J, done = residual(x), jacobian(x) * scale, 1
    away = float(np.linalg.norm(x / scale))
    radius = away or 1.0
    while True:
        low, high = (_room(x / scale, bound / scale) for bound in bounds)
        step, limited = _step(r, J, low, high, radius)
        cost, length = float(r @ r), float(np.linalg.norm(step))
        predicted = cost - float(np.sum((r + J @ step) ** 2))
        converged = predicted <= gain * cost or length <= SHORTEST * (SHORTEST + away)
        if converged or done >= evaluations:
            return Optimum(x, cost / 2, done, converged)
        there = np.clip(x + step * scale, *bounds)
        now, done = residual(there), done + 1
        gained = cost - float(now @ now)
        if not gained >= POOR * predicted:
            radius = length / 4
        elif gained > GOOD * predicted and limited:
            radius *= 2
        if gained > ACCEPTED * predicted:
            x, r, away = there, now, float(np.linalg.norm(there / scale))
            if POOR * predicted < gained <= gain * cost:
                return Optimum(x, float(r @ r) / 2, done, True)
            J = jacobian(x) * scale


def _room(x: Array, bound: Array) -> Array:
    """How far each of x (n,) may go towards its bound in one step; everything in scales."""
    way = bound - x
    return np.where(np.abs(way) < AT_BOUND, way, TOWARDS * way)


def _step(r: Array, J: Array, low: Array, high: Array, radius: float) -> tuple[Array, bool]:
    """The step (n,) between bounds with the least linearised squares within the radius, nearly.

    The second result is whether the radius limits it: it is damped then, so that it is at least half as long.
    """

    def damped(by: float) -> Array:
        rows, wanted = np.vstack([J, by * np.eye(J.shape[1])]), np.append(-r, np.zeros(J.shape[1]))
        return np.asarray(lsq_linear(rows, wanted, (low, high), method="bvls").x)

    step = damped(0.0)
    if np.linalg.norm(step) <= radius:
        return step, False
    size = float(np.linalg.norm(J, axis=0).max())
    less, more = LEAST_DAMPING * size, np.inf
    damping = less
    for _ in range(TRIALS):
        step = damped(damping)
        length = float(np.linalg.norm(step))
        if radius / 2 <= length <= radius:
            break
        less, more = (damping, more) if length > radius else (less, damping)
        damping = 10 * damping if more == np.inf else float(np.sqrt(less * more))
    return step, True
