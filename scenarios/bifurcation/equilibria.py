"""Positions of rest over the parameter, how motions about them grow, and where they become unstable."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq
from scipy.optimize import brentq

from estimator.record import Array
from fmus.errors import BadInput
from scenarios.bifurcation.flow import Flow

Complex = NDArray[np.complex128]

NUDGE = 1e-5  # of a state's nominal, for differences: far below any motion that is looked for
PRECISE = 1e-10  # of a state's nominal, last step of Newton's method
MOST = 50  # its steps
REAL = 1e-3  # of the rate of growth's own size, below which a frequency is none
DEEP = 12  # halvings of an interval in which several motions become unstable
SHARP = 1e-10  # of the range of the parameter, to which a crossing is found
AROUND = 0.1  # of an interval, by which the crossing with half the step may lie outside
NEUTRAL = 1e-7  # 1/s, least rate of a state that finds back to rest


@dataclass(frozen=True)
class Rest:
    """A position of rest x (n,) at a parameter, and the rates of motions about it.

    rates: (n,) 1/s, the fastest growing first; shapes: (n, n), a column for each, in sizes of the states.
    """

    parameter: float
    x: Array
    rates: Complex
    shapes: Complex

    @property
    def unstable(self) -> int:
        """How many rates grow."""
        return int(np.count_nonzero(self.rates.real > 0))


@dataclass(frozen=True)
class Crossing:
    """Where motions about rest begin or cease to grow: a Hopf bifurcation, or a static one.

    error: by the steps of the integrator, from a repetition with half of them; frequency: Hz, 0 of a static
    one; begins: whether they grow above it.
    """

    rest: Rest
    error: float
    frequency: float
    begins: bool
    number: int  # of its rate among the rates of `rest`

    @property
    def parameter(self) -> float:
        """Value of the parameter."""
        return self.rest.parameter


class Equilibria:
    """Positions of rest of a flow; step: s, of the integrator; start: (n,), near the first one."""

    def __init__(self, flow: Flow, step: float, start: Array) -> None:
        self.flow, self.step, self._last = flow, step, start

    def at(self, p: float) -> Rest:
        """The position of rest next to the last one; BadInput where Newton's method finds none."""
        x, sizes = self._last, self.flow.nominal
        for _ in range(MOST):
            after, slopes = self._stepped(x, p)
            with np.errstate(over="ignore", invalid="ignore"):  # a step that leads nowhere
                move = lstsq(slopes - np.eye(len(x)), (x - after) / sizes)[0]
                x = x + move * sizes
            if not np.isfinite(x).all():
                break
            if np.abs(move).max() <= PRECISE * max(1.0, float(np.abs(x / sizes).max())):
                self._last = x
                return self._rest(x, p)
        raise BadInput(f"no position of rest was found at {p:g}; give states near one by --set STATE=VALUE")

    def _stepped(self, x: Array, p: float) -> tuple[Array, Array]:
        """States (n,) after one step, and their slopes (n, n) by the states, in sizes of the states."""
        n, sizes = len(x), self.flow.nominal
        moves = NUDGE * np.diag(sizes)
        ends = self.flow.ends(np.vstack([x + moves, x - moves, x[None]]), np.full(2 * n + 1, p), self.step, 1)
        return ends[-1], ((ends[:n] - ends[n:-1]) / (2 * NUDGE * sizes)).T

    def _rest(self, x: Array, p: float) -> Rest:
        _, slopes = self._stepped(x, p)
        factors, shapes = np.linalg.eig(slopes)
        rates = np.log(factors.astype(complex)) / self.step
        order = np.argsort(-rates.real, kind="stable")
        return Rest(p, x, rates[order], shapes[:, order].astype(complex))


def swept(equilibria: Equilibria, parameters: Sequence[float]) -> list[Rest]:
    """Positions of rest from one end of the parameters to the other; BadInput for a neutral one."""
    found = [equilibria.at(p) for p in parameters]
    if np.abs(found[0].rates).min() < NEUTRAL:
        raise BadInput(
            f"at {found[0].parameter:g} a state neither finds back to rest nor leaves it, such as a distance "
            "travelled: it is never periodic; name the other states by --state"
        )
    return found


def crossings(equilibria: Equilibria, rests: Sequence[Rest], finer: Equilibria) -> list[Crossing]:
    """Where between positions of rest the number of growing motions changes; finer: with half the step."""
    reach = abs(rests[-1].parameter - rests[0].parameter)
    return [
        _crossing(equilibria, finer, one, other, reach)
        for low, high in pairwise(rests)
        for one, other in _single(equilibria, low, high, DEEP)
    ]


def _single(equilibria: Equilibria, low: Rest, high: Rest, deep: int) -> Iterator[tuple[Rest, Rest]]:
    """Intervals in each of which one motion changes, or few at once where they do so at one value."""
    if low.unstable == high.unstable:
        return
    if abs(low.unstable - high.unstable) <= 2 or not deep:
        yield low, high
        return
    middle = equilibria.at((low.parameter + high.parameter) / 2)
    yield from _single(equilibria, low, middle, deep - 1)
    yield from _single(equilibria, middle, high, deep - 1)


def _crossing(equilibria: Equilibria, finer: Equilibria, one: Rest, other: Rest, reach: float) -> Crossing:
    low, high, number = one.parameter, other.parameter, min(one.unstable, other.unstable)

    def growth(of: Equilibria, p: float) -> float:
        return float(of.at(p).rates[number].real)

    def root(of: Equilibria, more: float = 0.0) -> float:
        begin, end = low - more * (high - low), high + more * (high - low)
        return float(brentq(lambda p: growth(of, p), begin, end, xtol=SHARP * reach))

    try:
        at = root(equilibria)
    except ValueError:  # it is an end of the interval, where rounding decides about the sign
        at = min((low, high), key=lambda p: abs(growth(equilibria, p)))
    try:
        error = abs(root(finer, AROUND) - at)
    except ValueError:  # with half the step it lies outside the interval
        error = float("nan")
    rest = equilibria.at(at)
    rate = rest.rates[number]
    swings = abs(rate.imag) > REAL * float(np.abs(rest.rates).min()) and abs(rate.imag) > NEUTRAL
    frequency = abs(rate.imag) / (2 * np.pi) if swings else 0.0
    return Crossing(rest, error, frequency, other.unstable > one.unstable, number)
