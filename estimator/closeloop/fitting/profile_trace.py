"""The ends of 95 % intervals, found by following the profile of the likelihood.

The slopes at an optimum say where the interval of an unknown ends, if they hold as far as that. One
simulation of the end shows whether they do: its residual is compared with the one that the slopes predict. If
it differs by more than the policy allows, the slopes are corrected by the difference (Broyden's secant
method), and the end is predicted again from there, until a simulation confirms a prediction. Where secants do
not lead there, because the valley of the sum of squares bends too much, slopes are taken anew at the place
that was reached. At an end, the sum of squares exceeds the least one by as much as a 95 % interval allows,
and no values of the other unknowns lower it. Several ends are followed at once, as many as the FMU takes.

Sources: D. J. Venzon, S. H. Moolgavkar, Applied Statistics 37 (1988), 87-94, for the ends; C. G. Broyden,
Mathematics of Computation 19 (1965), 577-593, for the slopes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from estimator.closeloop.fitting.fit import REFUSED, in_turn
from estimator.closeloop.fitting.slopes_within_error import slopes_from
from estimator.closeloop.hypotheses.fitted import WIDE, Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, BoolArray
from estimator.weighting import Weighting
from fmus.aside import set_aside

WIDTH = 1.96  # standard errors: 95 %
MOVES = 12  # largest number of simulations with the same slopes and their secants
RENEWED = 6  # largest number of times that slopes are taken anew on the way to one end of an interval
WORTH = 0.1  # share of the way by which new slopes must lengthen it, so that others are taken
HIGHER = 2.0  # times the width of an interval: a move to a place as far from the optimum is taken back


def ends(
    built: Problem, h: Hypothesis, names: Collection[str], weighting: Weighting, leave: bool
) -> tuple[Array, dict[str, float]]:
    """Places (n_places, n) that the intervals of some unknowns hold, the ends of the intervals among them.

    A place has a value for each unknown. built: the problem with the effects of h; h: an optimum with slopes
    that hold near it; leave: whether to stop where the sum of squares is much lower than at the optimum. The
    second result holds the values of such a place, by name.
    """
    start, policy = Optimum(h.fit), built.policy.interval
    fixed = {n: v for n, v in h.theta.items() if n not in h.fit.theta}
    sought = [i for i, u in enumerate(h.fit.unknowns) if u.name in names]
    waiting = [Trace(start, i, side, policy.bent) for i in sought for side in (-1.0, 1.0)]
    moving: list[Trace] = []
    places = [start.x]
    while waiting or moving:
        free = built.at_once - len(moving)
        moving, waiting = [*moving, *waiting[:free]], waiting[free:]
        moves = [t.move() for t in moving]
        asked = [fixed | start.named(t.x + d) for t, d in zip(moving, moves, strict=True)]
        for t, d, r in zip(moving, moves, in_turn(built, asked, weighting), strict=True):
            if leave and float(r @ r) < start.fit.cost - policy.deeper * t.unit**2:
                return np.array(places) * start.scale, start.named(t.x + d)
            t.arrived(d, r)
            places += [t.x] if t.within else []
        moving = [t for t in moving if not t.ended]
        for t in moving:
            if t.lost:
                at, near = fixed | start.named(t.x), t.slopes.columns
                t.renewed(slopes_from(built, at, t.r, h.fit.unknowns, near, weighting))
    return np.array(places) * start.scale, {}


@dataclass(frozen=True)
class Linear:
    """The residual near a place by its slopes, columns (m,) each; scale: (n,) of the unknowns."""

    columns: Sequence[Array]
    scale: Array

    @cached_property
    def gram(self) -> Array:
        """Products of the slopes with one another, (n, n), in scales."""
        return np.array([self.products(column) for column in self.columns]) * self.scale[:, None]

    def products(self, r: Array) -> Array:
        """Products (n,) of the slopes with a residual (m,), in scales."""
        return np.array([float(column @ r) for column in self.columns]) * self.scale

    def change(self, d: Array) -> Array:
        """Change (m,) of the residual by a move d (n,) in scales, as the slopes predict it."""
        found = np.zeros_like(self.columns[0])
        for column, along in zip(self.columns, d * self.scale, strict=True):
            found += along * column
        return found


@dataclass(frozen=True)
class Optimum:
    """An optimum from which intervals are followed; everything in scales of the unknowns."""

    fit: Fit

    @cached_property
    def scale(self) -> Array:
        """Scale of each unknown, (n,)."""
        return np.array([u.scale for u in self.fit.unknowns])

    @cached_property
    def x(self) -> Array:
        """Values, (n,)."""
        return np.asarray(self.fit.values / self.scale)

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper bounds, (2, n)."""
        return np.array([[u.low, u.high] for u in self.fit.unknowns]).T / self.scale

    @cached_property
    def slopes(self) -> Linear:
        """The slopes at the optimum."""
        return Linear(self.fit.slopes, self.scale)

    @cached_property
    def gradient(self) -> Array:
        """Products of the slopes with the residual, (n,)."""
        return self.slopes.products(self.fit.residual)

    @cached_property
    def looseness(self) -> Array:
        """Information (n,) by which an unknown that the residual does not show is held where it is."""
        low, high = self.bounds
        return np.asarray(12 / np.minimum(high - low, WIDE) ** 2)

    @cached_property
    def units(self) -> Array:
        """Length of the residual for one standard error of each unknown, (n,)."""
        return np.sqrt(self.fit.inflation)

    def named(self, x: Array) -> dict[str, float]:
        """Values by name."""
        return {u.name: float(v) for u, v in zip(self.fit.unknowns, x * self.scale, strict=True)}


class Trace:
    """The way from an optimum to one end of the interval of the i-th unknown.

    side: -1 or 1; limit: see `bent` of the policy. within: whether the last move led to a place that the
    interval holds; ended: whether that is its end, or as far as one gets.
    """

    def __init__(self, start: Optimum, i: int, side: float, limit: float) -> None:
        self._start, self._i, self._side, self._limit = start, i, side, limit
        self.x, self.unit = start.x, float(start.units[i])
        self.within = self.ended = False
        self.slopes, self.r = start.slopes, start.fit.residual
        self._gram, self._gradient = start.slopes.gram, start.gradient
        self._secants: list[tuple[Array, Array]] = []  # corrections of the slopes: (m,) along a move (n,)
        self._rise = (WIDTH * self.unit) ** 2  # of the sum of squares at the end
        self._most = np.inf  # length of the next move, in scales
        self._whole = False  # whether the last move was to lead to the end
        self._left, self._renewals = MOVES, RENEWED
        self._way = 0.0  # of the unknown when slopes were taken last, in scales

    def move(self) -> Array:
        """The move (n,) to where the slopes predict the end, as far as bounds and earlier moves allow.

        Unknowns that would pass a bound are held at it.
        """
        i, (low, high) = self._i, self._start.bounds - self.x
        room = float(high[i] if self._side > 0 else -low[i])
        back = self._side * float(self._start.x[i] - self.x[i])
        d, held = np.zeros(len(self.x)), np.arange(len(self.x)) == i
        while True:
            along, reached, rest, follow = self._predicted(np.where(held, d, 0.0), held)
            d[i] = self._side * np.clip(along, min(back, 0.0), room)
            d[~held] = rest + follow * d[i]
            out = ~held & ((d < low) | (d > high))
            if not out.any():
                break
            d[out], held = np.clip(d, low, high)[out], held | out
        length = float(np.linalg.norm(d))
        self._whole = reached and back <= along and length <= self._most
        return d if length <= self._most else d * (self._most / length)

    def _predicted(self, d: Array, held: BoolArray) -> tuple[float, bool, Array, Array]:
        """How far the slopes let the unknown go, and how those that are not held follow.

        d: moves (n,) of the held ones. If no place reaches the interval, it goes where the sum of squares is
        least; the second result is whether one does. The others move by the third one, and by the fourth one
        for each unit of the unknown.
        """
        i, o = self._i, np.flatnonzero(~held)
        d = np.where(np.arange(len(d)) == i, 0.0, d)
        pull = self._gradient + self._gram @ d
        inner = self._gram[np.ix_(o, o)] + np.diag(self._start.looseness[o])
        rest, follow = np.linalg.solve(inner, -np.column_stack([pull[o], self._gram[o, i]])).T
        rise = float(self.r @ self.r + d @ (self._gradient + pull) + pull[o] @ rest) - self._start.fit.cost
        slope = self._side * float(pull[i] + self._gram[i, o] @ rest)
        bend = float(self._gram[i, i] + self._gram[i, o] @ follow)
        if bend <= 0:
            return WIDE, True, rest, follow
        spare = slope**2 - bend * (rise - self._rise)
        return (np.sqrt(max(spare, 0.0)) - slope) / bend, spare >= 0, rest, follow

    def arrived(self, d: Array, r: Array) -> None:
        """Take the residual r (m,) that was simulated after a move d (n,), and correct the slopes by it."""
        start, cost, before = self._start, float(r @ r), float(self.r @ self.r)
        self._left -= 1
        if np.abs(r).max() >= REFUSED:
            self._turned_back(d)
            return
        missed = r - self.r - self.slopes.change(d)
        products = self.slopes.products(r)
        for secant, direction in self._secants:
            missed -= float(direction @ d) * secant
            products += float(secant @ r) * direction
        bent, u = float(np.linalg.norm(missed)), d / max(float(d @ d), np.finfo(float).tiny)
        onto = products - self._gradient - self._gram @ d
        self._gram = self._gram + np.outer(onto, u) + np.outer(u, onto) + bent**2 * np.outer(u, u)
        self._secants.append((set_aside(missed), u))
        if cost <= max(before, start.fit.cost + HIGHER**2 * self._rise):
            self.x, self.r, self._most = self.x + d, r, 2 * self._most
            self._gradient = products + float(missed @ r) * u
            self.ended = self._whole and bent <= self._limit * WIDTH * self.unit
            self.within = self.ended or cost <= start.fit.cost + self._rise
        else:
            self._gradient = self._gradient + float(missed @ self.r) * u
            self._turned_back(d)
        self.ended |= self._given_up

    @property
    def lost(self) -> bool:
        """Whether the slopes do not lead to the end."""
        return self._left == 0

    @property
    def _given_up(self) -> bool:
        """Whether they do not, and new slopes would be of no use either."""
        return self.lost and (self._renewals == 0 or self._gone <= (1 + WORTH) * self._way)

    @property
    def _gone(self) -> float:
        """Way of the unknown from the optimum, in scales."""
        return abs(float(self.x[self._i] - self._start.x[self._i]))

    def renewed(self, columns: Sequence[Array]) -> None:
        """Go on from here with new slopes, (m,) of each unknown."""
        self.slopes, self._secants = Linear(columns, self._start.scale), []
        self._gram, self._gradient = self.slopes.gram, self.slopes.products(self.r)
        self._left, self._renewals, self._most = MOVES, self._renewals - 1, np.inf
        self._way = self._gone

    def _turned_back(self, d: Array) -> None:
        """Stay where the trace is; the next move is at most half as long."""
        self._most, self.within = float(np.linalg.norm(d)) / 2, False
        self.ended = self._given_up
