"""A branch of periodic motions from a Hopf bifurcation on, through its folds, by pseudo-arclength.

Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., 2010, chapters 4 and 7.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from estimator.record import Array
from scenarios.bifurcation.equilibria import Complex, Crossing
from scenarios.bifurcation.shooting import Cycle, Lost, Near, Shooting

SMALL = 0.01  # of the states' sizes, the first motion
GROW = 0.12  # of its size, by which a motion may change from one to the next
SHARE = 0.02  # of the range of the parameter, the same
TURN = np.cos(np.radians(25.0))  # of the tangents of two neighbours
LEAST = 1e-5  # of the longest stride that is allowed; below it the branch is given up
LONGER, SHORTER = 1.6, 0.5
FAR = 0.5  # of a stride, by which a corrected motion may be off its guess
MOST = 600  # motions of a branch
SHARP = 1e-3  # of a stride, to which a fold is found; its parameter is then off by the square of that

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Branch:
    """Periodic motions from a crossing on, and why they end.

    error: of the parameter of the first, by the steps of the integrator; nan where it is not known.
    """

    crossing: Crossing
    cycles: tuple[Cycle, ...]
    end: str
    error: float


@dataclass(frozen=True)
class Fold:
    """Where a branch turns back in the parameter; error: by the steps of the integrator, nan if not known.

    stable: whether the branch is stable on one side. At the fold itself a multiplier is one, which rounding
    puts inside or outside.
    """

    cycle: Cycle
    error: float
    stable: bool

    @property
    def parameter(self) -> float:
        """Value of the parameter."""
        return self.cycle.parameter


@dataclass(frozen=True)
class Change:
    """Where the stability changes without a fold, between two neighbours of a branch."""

    kind: str
    low: float
    high: float


def followed(
    shooting: Shooting, crossing: Crossing, low: float, high: float, largest: float, tell: Tell
) -> Branch:
    """The branch of a Hopf bifurcation between low and high; largest: amplitude at which it ends."""
    try:
        cycles = [_first(shooting, crossing)]
    except Lost as error:
        return Branch(crossing, (), f"no small periodic motion was found: {error}", float("nan"))
    stride, end = _longest(cycles[-1], np.inf), ""
    while not end:
        now = cycles[-1]
        try:
            stride = _longest(now, stride)
            after = _next(shooting, now, stride)
        except Lost as error:
            stride *= SHORTER
            if stride < LEAST * _longest(now, np.inf):
                end = f"it could not be followed further: {error}"
            continue
        cycles.append(after)
        stride *= LONGER
        tell(f"following a limit cycle, {len(cycles)} motions, parameter {after.parameter:.4g}")
        end = _ended(cycles, low, high, largest)
    return Branch(crossing, tuple(cycles), end, _error_of_first(shooting, crossing, cycles[0]))


def folds(branch: Branch, shooting: Shooting) -> Iterator[Fold]:
    """Every fold of a branch, found sharply; its error from a repetition with half the steps."""
    finer = _finer(shooting)
    for now, after in pairwise(branch.cycles):
        if now.tangent[-1] * after.tangent[-1] < 0:
            stride = float(now.tangent @ (after.place - now.place))
            stable = min(now.unstable, after.unstable) == 0
            try:
                cycle = _fold(shooting, now, stride)
            except (Lost, ValueError):
                yield Fold(now, abs(after.parameter - now.parameter), stable)
                continue
            try:
                error = abs(_fold(finer, now, stride).parameter - cycle.parameter)
            except (Lost, ValueError):
                error = float("nan")
            yield Fold(cycle, error, stable)


def changes(branch: Branch) -> Iterator[Change]:
    """Where multipliers leave or enter the unit circle without a fold, between neighbours."""
    turned = [now.tangent[-1] * after.tangent[-1] < 0 for now, after in pairwise(branch.cycles)]
    for k, (now, after) in enumerate(pairwise(branch.cycles)):
        crossed = abs(after.unstable - now.unstable)
        if crossed == 0 or (crossed == 1 and any(turned[max(0, k - 1) : k + 2])):
            continue
        inner = now if now.unstable > after.unstable else after
        least = min(now.unstable, after.unstable)
        multiplier = inner.multipliers[least]
        kind = "torus (Neimark-Sacker)" if abs(multiplier.imag) > 1e-6 else "symmetry or branch"
        if kind.startswith("symmetry") and multiplier.real < 0:
            kind = "period doubling"
        yield Change(kind, *sorted((now.parameter, after.parameter)))


def _error_of_first(shooting: Shooting, crossing: Crossing, first: Cycle) -> float:
    try:
        return abs(_first(_finer(shooting), crossing).parameter - first.parameter)
    except Lost:
        return float("nan")


def _finer(shooting: Shooting) -> Shooting:
    return replace(shooting, step=shooting.step / 2)


def _first(shooting: Shooting, crossing: Crossing) -> Cycle:
    """The smallest motion, in the plane of the growing pair of rates."""
    rest, n = crossing.rest, len(crossing.rest.x)
    shape = rest.shapes[:, crossing.number]
    cosine, sine = _square(shape, rest.rates[crossing.number].imag)
    reach = SMALL / np.abs(cosine).max()
    guess = np.concatenate(
        [rest.x / shooting.flow.nominal + reach * cosine, [1.0, rest.parameter / shooting.reach]]
    )
    planes = np.zeros((2, n + 2))
    planes[:, :n] = sine / np.linalg.norm(sine), cosine / np.linalg.norm(cosine)
    return shooting.corrected(Near(guess, planes, SMALL), np.inf)


def _square(shape: Complex, turning: float) -> tuple[Array, Array]:
    """Real and imaginary part of an eigenvector, turned so that they are square to one another."""
    if turning < 0:
        shape = np.conj(shape)
    phase = 0.5 * np.angle(np.sum(shape**2))
    turned = shape * np.exp(-1j * phase)
    return turned.real, turned.imag


def _longest(now: Cycle, stride: float) -> float:
    """The stride, shortened to what a motion may change by."""
    n = len(now.tangent) - 2
    of_states, of_parameter = float(np.abs(now.tangent[:n]).max()), abs(float(now.tangent[-1]))
    return min(stride, GROW * now.size / max(of_states, 1e-12), SHARE / max(of_parameter, 1e-12))


def _next(shooting: Shooting, now: Cycle, stride: float) -> Cycle:
    """The neighbour at a stride along the tangent; Lost where it turns away too far."""
    found = shooting.corrected(_ahead(now, stride), FAR * stride)
    if found.tangent @ now.tangent < TURN:
        raise Lost("the branch turns too sharply")
    return found


def _ahead(now: Cycle, stride: float) -> Near:
    """What the neighbour at a stride along the tangent is looked for by."""
    planes = np.vstack([np.append(now.section, [0.0, 0.0]), now.tangent])
    return Near(now.place + stride * now.tangent, planes, now.size, now.slopes)


def _fold(shooting: Shooting, now: Cycle, stride: float) -> Cycle:
    """The motion within a stride at which the parameter turns; ValueError where it does not turn."""
    tried: dict[float, Cycle] = {}

    def turning(s: float) -> float:
        tried[s] = shooting.corrected(_ahead(now, s), FAR * stride)
        return float(tried[s].tangent[-1])

    at = float(brentq(turning, -0.05 * stride, 1.05 * stride, xtol=SHARP * stride))
    return tried[at] if at in tried else min(tried.items(), key=lambda item: abs(item[0] - at))[1]


def _ended(cycles: Sequence[Cycle], low: float, high: float, largest: float) -> str:
    """Why the branch ends with its last motion; empty while it goes on."""
    last = cycles[-1]
    if not low <= last.parameter <= high:
        return f"it leaves the range at {low if last.parameter < low else high:g}"
    if last.amplitude > largest:
        return f"its amplitude exceeds {largest:g}"
    if last.size < SMALL / 2:
        return "it has shrunk to rest again"
    return f"{MOST} motions were found" if len(cycles) >= MOST else ""
