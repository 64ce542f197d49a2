"""Where wheels and rails touch: roll by the semi-analytical method, rigid and quasi-elastic contact search.

All is said of the left wheel; the right one is a left one with shift and roll reversed (see pair.py).
Equations and sources: README.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.contact.arguments import Array
from fmus.contact.geometry.nearest import Touch, WheelGrid
from fmus.contact.geometry.pair import Pair, Sides
from fmus.errors import BadInput

SAME = 1e-10  # m, the gaps of both wheels agree to ten times better than the 1e-9 that is promised
STEP = 5e-3  # rad, largest change of roll at once
FLATTEST = 0.2  # m, least lever of the gaps' difference; 1.5 on the tread, 0.25 on a flange of 70 degrees
ITERATIONS = 100
QUASI_ELASTIC = 2e-5  # m, Arnold & Netter 1997; 1e-5 to 5e-5 are in use
FLANGE_ANGLE = 0.5  # rad, contact angle beyond which the flange is said to touch
PLACES = 400  # between a contact and the tape circle, where a flange is looked for
WEIGHTLESS = 30.0  # in gaps of QUASI_ELASTIC; exp(-30) is 1e-13


@dataclass(frozen=True)
class Stand:
    """A wheelset at lateral shifts y (n,), m, resting on both rails.

    phi: roll, rad; lift: height of its centre above the mean r0 over the crowns, m; left, right: where it
    touches; level: whether both gaps agree within the precision of the roll (n,).
    """

    y: Array
    phi: Array
    lift: Array
    left: Touch
    right: Touch
    level: NDArray[np.bool_]

    @property
    def rests(self) -> NDArray[np.bool_]:
        """Whether both wheels stand on their rails, not on an end of a profile (n,)."""
        return np.asarray(self.level & self.left.inside & self.right.inside)


@dataclass(frozen=True)
class Contact:
    """The contact of one wheel at n shifts.

    eta: place on the wheel from the tape circle, m; kappa_wheel, kappa_rail: signed curvatures of the
    profiles there, 1/m, negative where they bulge up.
    """

    eta: Array
    kappa_wheel: Array
    kappa_rail: Array


def stand(pair: Pair | Sides, y: Array, roll: bool = True) -> Stand:
    """Roll and lift at which both wheels touch, for shifts y (n,), m; a pair stands for both sides.

    The roll is turned by the difference of both gaps over its lever until they agree (Li 2002, eq. 3.5
    to 3.7, with the lever's exact value); where the next roll would leave what is known to hold the
    answer, that is halved instead. Shifts without an answer do not `rest`. Without roll, each wheel is
    lowered upright onto its own rail (EN 15302), and the lift is the mean of both.
    """
    sides = Sides.of(pair)
    phi = np.zeros_like(y)
    if not roll:
        left, right = _touches(sides, y, phi)
        return Stand(y, phi, -(left.gap + right.gap) / 2, left, right, np.isfinite(left.gap + right.gap))
    low, high = np.full_like(y, -np.inf), np.full_like(y, np.inf)
    open_ = np.arange(len(y))
    for _ in range(ITERATIONS):
        left, right = _touches(sides, y[open_], phi[open_])
        more, lever = _gap_difference(sides, left, right), left.lever + right.lever
        low[open_] = np.where(more < 0, phi[open_], low[open_])
        high[open_] = np.where(more > 0, phi[open_], high[open_])
        wrong = np.abs(more) > SAME
        open_, more, lever = open_[wrong], more[wrong], lever[wrong]
        if not open_.size:
            break
        phi[open_] = _next(phi[open_], more, lever, low[open_], high[open_])
    left, right = _touches(sides, y, phi)
    level = np.abs(_gap_difference(sides, left, right)) <= 10 * SAME
    return Stand(y, phi, sides.taller / 2 - left.gap, left, right, level)


def _touches(sides: Sides, y: Array, phi: Array) -> tuple[Touch, Touch]:
    """Nearest places of the left and the right wheel."""
    if not sides.alike:
        return WheelGrid.of(sides.left).nearest(y, phi), WheelGrid.of(sides.right).nearest(-y, -phi)
    both = WheelGrid.of(sides.left).nearest(np.concatenate([y, -y]), np.concatenate([phi, -phi]))
    return both.part(slice(None, len(y))), both.part(slice(len(y), None))


def _gap_difference(sides: Sides, left: Touch, right: Touch) -> Array:
    """Left less right gap (n,), m, under one centre of the wheelset; each gap is told for its own r0.

    Infinite where one wheel is beside its rail, nan where both are.
    """
    beside_both = np.isinf(left.gap) & np.isinf(right.gap)
    more = np.subtract(left.gap, right.gap, out=np.full_like(left.gap, np.nan), where=~beside_both)
    return np.asarray(more - sides.taller)


def _next(phi: Array, more: Array, lever: Array, low: Array, high: Array) -> Array:
    """Newton's next roll, or the middle of the bracket where that leads out of it."""
    # with one wheel beside its rail the difference is infinite, and the turn the largest
    turn = np.clip(more / np.maximum(np.nan_to_num(lever), FLATTEST), -STEP, STEP)
    new = phi - turn
    held = np.isfinite(low) & np.isfinite(high)
    middle = np.add(low, high, out=new.copy(), where=held) / np.where(held, 2, 1)
    return np.asarray(np.where(held & ((new <= low) | (new >= high)), middle, new))


def rigid_contact(pair: Pair, touch: Touch) -> Contact:
    """The contact at the place of least vertical distance."""
    return Contact(touch.eta, pair.wheel.curvature(touch.eta), pair.left_rail.curvature(touch.rail_y))


def quasi_elastic_contact(
    pair: Pair, y: Array, phi: Array, touch: Touch, eps: float = QUASI_ELASTIC
) -> Contact:
    """The contact averaged over the places near touching, with weights exp(-(d - d_min)/eps).

    y, phi: shift, m, and roll, rad, of the left wheel (n,) and its touch there. Place and both curvatures
    are averaged (Arnold & Netter 1997; thesis eq. 3.8 to 3.10), over the wheel's lateral coordinate.
    """
    grid = WheelGrid.of(pair)
    gap = grid.gaps(y, phi) - touch.gap[:, None]
    return averaged(grid, np.where(gap < WEIGHTLESS * eps, np.exp(-gap / eps), 0.0), y, phi)


def averaged(grid: WheelGrid, weight: Array, y: Array, phi: Array) -> Contact:
    """The mean contact of a wheel at shifts y, m, and rolls phi, rad, (n,) by weights (n, m) of places."""
    row, column = np.nonzero(weight)
    shares = weight[row, column] * grid.width[column]
    total = np.bincount(row, shares, len(y))

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(row, shares * values, len(y)) / total)

    kappa_rail = grid.rail_curvature(column, y[row], phi[row])
    return Contact(mean(grid.eta[column]), mean(grid.curvature[column]), mean(kappa_rail))


def check_touches(pair: Pair | Sides, roll: bool = True) -> None:
    """BadInput where the wheelset does not sit on its treads, between its flanges, when it is centred."""
    sides = Sides.of(pair)
    centred = stand(sides, np.zeros(1), roll)
    rests = bool(centred.rests[0])
    _check_side(sides.left, rests, centred.left)
    if not sides.alike:
        _check_side(sides.right, rests, centred.right)


def _check_side(pair: Pair, rests: bool, touch: Touch) -> None:
    names = f"wheel {pair.wheel.name} on rail {pair.rail.name}"
    stands = f"gauge {pair.gauge:g} m and back_to_back {pair.back_to_back:g} m"
    if not rests:
        raise BadInput(
            f"{names}: never touch on their running surfaces with {stands}; correct these, or give profiles "
            "wide enough"
        )
    tip = WheelGrid.of(pair).tip
    if touch.eta[0] <= tip:
        raise BadInput(f"{names}: the flange stands on the rail with {stands}; correct these")
    eta = float(touch.eta[0])
    steepest = np.abs(pair.wheel.slope(np.linspace(min(eta, 0.0), max(eta, 0.0), PLACES))).max()
    if np.arctan(steepest) > FLANGE_ANGLE:
        raise BadInput(
            f"{names} with {stands}: the flanges touch when it is centred; correct gauge or back_to_back"
        )
