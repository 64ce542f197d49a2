"""A Kalman filter of the irregularity and least squares of the conicity in turns (Charles et al. 2008, 6).

The filter takes the last curve of conicity for right and finds the irregularity; least squares then fit a new
curve over the filter's shift. Yaw tells only the product of conicity and shift, so that least squares of it
would return the curve that the filter has assumed. Lateral motion has the conicity beside the velocity too
(eq. 1, creep by roll), which separates both. Hence least squares take eq. 1 here, not eq. 35.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from estimator.filters.ekf import Ekf
from estimator.filters.estimator import Estimate
from estimator.record import Array
from scenarios.literature.case import Record
from scenarios.literature.conicity_fits import CUBIC, RARE, Fit, knots_of
from scenarios.literature.conicity_model import (
    DT,
    F22,
    F23,
    F_Y,
    HALF,
    K_Y,
    MOTION,
    ORDER,
    OUTPUTS,
    R0,
    RANGE,
    SAMPLED,
    SEEN,
    STEEP,
    STILL,
    Y_DOT,
    Curved,
    M,
    V,
    W,
    Wheelset,
    Y,
)
from scenarios.literature.following import Followed, follow, rmse

MOST_ROUNDS = 12
SETTLED = 1e-3  # of the curve's rms change from one round to the next
TURN = np.arange(1, ORDER + 1)  # powers of the conicity that change with it
PLAUSIBLE = 0.2  # conicity by which neighbouring coefficients of the curve differ at most, about


@dataclass(frozen=True)
class OnCurve(Wheelset):
    """The wheelset of a filter that knows the curve, with its derivatives; coordinates: motion and d."""

    curve: Fit | None = None

    def dfdx(self, x: Array, u: Array, t: float, dt: float, carried: Array) -> Array:
        """See Differentiable."""
        middle = x[Y] - x[-1] + DT / 2 * x[Y_DOT]
        conicity, slope = self._at(middle)
        found: Array = SAMPLED @ conicity ** np.arange(ORDER + 1)
        by_conicity = SAMPLED[:, :, 1:] @ (TURN * conicity ** (TURN - 1)) @ x
        at = _axis(Y) - _axis(-1) + DT / 2 * _axis(Y_DOT)
        found = found + np.outer(by_conicity, slope * at)
        found[-1] = self.belief.moved(np.eye(1), x[:1], x[:1])[0, 0] * _axis(-1)
        return found

    def dhdx(self, x: Array, u: Array, t: float, carried: Array) -> Array:
        """See Differentiable."""
        conicity, slope = self._at(x[Y] - x[-1])
        seen = STILL[SEEN] + conicity * STEEP[SEEN]
        seen = seen + np.outer(STEEP[SEEN] @ x, slope * (_axis(Y) - _axis(-1)))
        return np.vstack([np.eye(4, len(x)), seen])

    def _at(self, shift: float) -> tuple[float, float]:
        """Conicity and its slope [1/m] at a shift [m]; flat where the equations end."""
        at = np.array([shift])
        conicity = float(self.belief.conicity(at, at)[0])
        inside = RANGE[0] < conicity < RANGE[1]
        slope = float(self.curve.slope(at)[0]) if self.curve and inside else 0.0
        return float(np.clip(conicity, *RANGE)), slope


def _axis(i: int) -> Array:
    found = np.zeros(len(MOTION) + 1)
    found[i] = 1.0
    return found


@dataclass(frozen=True)
class Hybrid:
    """The last filter, the curve that it led to, and the curves of all rounds before."""

    filter: Followed
    curve: Fit
    rounds: tuple[Fit, ...]

    @property
    def shift(self) -> Array:
        """Of the wheelset over the track (N,), m, as the filter has it."""
        return self.filter.value["y"] - self.filter.value["d"]


def hybrid(record: Record, start: Estimate, Q: Array, R: Array, guess: float, kept: float) -> Hybrid:
    """Filter and least squares in turns, from a constant conicity `guess`.

    start, Q, R: of motion and irregularity, (7,), (7, 7) and of the outputs; kept: see Along.
    """
    curve, rounds = flat(guess), []
    for _ in range(MOST_ROUNDS):
        system = OnCurve(Curved(curve, kept), curve=curve)
        filter = Ekf(system, start, Q, R, DT)
        found = follow(filter, system, record.t, record.table(()), record.table(OUTPUTS))
        if found.reason:
            break
        before, curve = curve, by_lateral_motion(record, found)
        rounds.append(curve)
        at = found.value["y"] - found.value["d"]
        if rmse(curve(at), before(at)) < SETTLED:
            break
    return Hybrid(found, curve, tuple(rounds))


def flat(conicity: float) -> Fit:
    """A constant conicity."""
    return Fit(BSpline(np.array([-1.0, -1.0, 1.0, 1.0]), np.full(2, conicity), 1))


def by_lateral_motion(record: Record, found: Followed) -> Fit:
    """Piecewise cubics over the filter's shift that explain the lateral motion (eq. 1) best.

    Motion is that of the sensors: the filter's own already leans towards the curve that it assumes. Shift and
    suspended mass, which no sensor measures, are the filter's.
    """
    c, known = record.columns, found.value
    shift = known["y"] - known["d"]
    low, high = np.percentile(shift, (100 * RARE, 100 * (1 - RARE)))
    shift = np.clip(shift, low, high)
    knots = knots_of(low, high)
    spring = K_Y * (known["y_m"] - c["y"]) + F_Y * (known["y_m_dot"] - c["y_dot"])
    rest = spring - M * c["y_ddot"] - 2 * F23 / V * c["psi_dot"] - 2 * F22 / V * (c["y_dot"] - V * c["psi"])
    by_conicity = 2 * F22 / V * R0 / HALF * c["y_dot"] + W / HALF * shift
    A = BSpline.design_matrix(shift, knots, CUBIC).toarray() * by_conicity[:, None]
    # neighbouring coefficients are held together where the record says nothing of them
    n = A.shape[1]
    left = np.linalg.lstsq(A, rest, rcond=None)[1]
    noise = float(np.sqrt(left[0] / len(rest))) if len(left) else float(np.std(rest))
    even = (np.eye(n - 1, n, 1) - np.eye(n - 1, n)) * noise / PLAUSIBLE
    theta, *_ = np.linalg.lstsq(np.vstack([A, even]), np.concatenate([rest, np.zeros(n - 1)]), rcond=None)
    return Fit(BSpline(knots, theta, CUBIC))
