"""Parameters over mileage: a line and a change point for each vehicle, with their errors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from scenarios.fleet.policy import POLICY
from scenarios.fleet.repeats import Repeats, Scatter, scatter_of, share_left, variance_of
from scenarios.fleet.scatter import Array

SIDES = 2  # tests of a series: line and change point


@dataclass(frozen=True)
class Points:
    """A parameter of a vehicle over mileage, in increasing order; std: standard errors > 0; (n,) each."""

    mileage: Array
    value: Array
    std: Array

    @classmethod
    def of(cls, mileage: Sequence[float], value: Sequence[float], std: Sequence[float]) -> "Points":
        """Points in the order of their mileage."""
        table = np.array([mileage, value, std], dtype=np.float64)
        return cls(*table[:, np.argsort(table[0], kind="stable")])

    @property
    def enough(self) -> bool:
        """Whether a line through them can be tested."""
        return len(self.value) >= POLICY.fewest_records and bool(np.ptp(self.mileage) > 0)

    @property
    def about_a_line(self) -> Repeats:
        """The same as repeated records about a line over mileage."""
        x = (self.mileage - self.mileage.mean()) / np.ptp(self.mileage)
        return Repeats(self.value, self.std, np.column_stack([np.ones(len(x)), x]))


@dataclass(frozen=True)
class Line:
    """A line through points; slope: per unit of mileage; std: with the scatter of the vehicle; squares:
    weighted, about the line; p_value: of no slope.
    """

    slope: float
    std: float
    squares: float
    p_value: float


@dataclass(frozen=True)
class Change:
    """A change of the mean between two records.

    at: mileage between them; low, high: those of the first and the last that it may have happened at;
    size: mean after minus mean before; std: its standard error where the place is known; size_low,
    size_high: 95 % interval that holds over all places; p_value: by the bound of Bonferroni over all places,
    so at most this; squares: weighted, about both means.
    """

    at: float
    low: float
    high: float
    size: float
    std: float
    size_low: float
    size_high: float
    p_value: float
    squares: float


@dataclass(frozen=True)
class Course:
    """What the points of one vehicle say; p_value: of the likelier of line and change, for both together.

    form: "line" or "change", what describes the points better by the criterion of G. Schwarz (Annals of
    Statistics 6 (1978), 461-464), a change having its place as one more unknown.
    low, high: 95 % interval of the slope; scatter, correlation: of the class, beyond the standard errors, and
    of successive records.
    """

    line: Line
    low: float
    high: float
    change: Change | None
    p_value: float
    form: str
    scatter: float
    correlation: float
    records: int


def line_through(p: Points, s: Scatter) -> Line:
    """The weighted line through points, whose errors contain the scatter."""
    w, own = s.weights(p.std), len(p.value) - 2
    x = p.mileage - np.sum(w * p.mileage) / w.sum()
    inside = float(np.sum(w * x**2))
    slope = float(np.sum(w * x * p.value)) / inside
    left = p.value - np.sum(w * p.value) / w.sum() - slope * x
    squares = float(np.sum(w * left**2))
    root = np.sqrt(w)
    variance = float(variance_of(root * x / inside, s.correlation)[-1])
    taken = float(variance_of(root, s.correlation)[-1]) / w.sum() + variance * inside
    std = float(np.sqrt(variance * s.scale(squares / share_left(taken, len(w), 2), own)))
    p_value = 2 * float(student.sf(abs(slope) / std, s.freedom(own))) if std > 0 else 1.0
    return Line(slope, std, squares, p_value)


def change_in(p: Points, s: Scatter) -> Change | None:
    """The most likely change of the mean, with enough records on either side; None if there is none.

    The likelihood ratio of D. V. Hinkley (Biometrika 57 (1970), 1-17), each place by a t test with the
    vehicle's scatter about both means.
    """
    n, beside = len(p.value), POLICY.fewest_beside
    places = np.array(
        [k for k in range(beside, n - beside + 1) if p.mileage[k] > p.mileage[k - 1]], dtype=int
    )
    if not len(places):
        return None
    own, w = n - 2, s.weights(p.std)
    jump, std, squares = _jumps(p, s, places, w)
    whole, q = s.lent + own, float(student.ppf(0.5 + POLICY.confidence / 2, s.freedom(own)))
    square = (jump / std) ** 2
    ratio = square if np.isinf(whole) else whole * np.log1p(square / whole)
    best = int(np.argmax(ratio))
    alike = np.flatnonzero(ratio >= ratio[best] - POLICY.change_ratio)
    single = 2 * float(student.sf(np.sqrt(square[best]), s.freedom(own)))
    k = places[best]
    return Change(
        float((p.mileage[k - 1] + p.mileage[k]) / 2),
        float(p.mileage[places[alike[0]] - 1]), float(p.mileage[places[alike[-1]]]),
        float(jump[best]), float(std[best]),
        float((jump - q * std)[alike].min()), float((jump + q * std)[alike].max()),
        min(1.0, len(places) * single), float(squares[best]),
    )  # fmt: skip


def _jumps(p: Points, s: Scatter, places: Array, w: Array) -> tuple[Array, Array, Array]:
    """Mean after less mean before each place, its standard error, and the weighted squares about both."""
    weight, total = np.cumsum(w), np.cumsum(w * p.value)
    before, after = weight[places - 1], weight[-1] - weight[places - 1]
    jump = (total[-1] - total[places - 1]) / after - total[places - 1] / before
    middle = p.value - total[-1] / weight[-1]
    squares = np.maximum(np.sum(w * middle**2) - jump**2 / (1 / before + 1 / after), 0.0)
    root = np.sqrt(w)
    first, last = variance_of(root, s.correlation), variance_of(root[::-1], s.correlation)[::-1]
    both = first[-1] - first[places - 1] - last[places]  # twice the covariance of both sums
    variance = first[places - 1] / before**2 + last[places] / after**2 - both / (before * after)
    taken = first[places - 1] / before + last[places] / after
    std = np.sqrt(variance * s.scale(squares / share_left(taken, len(w), 2), len(w) - 2))
    return jump, np.maximum(std, np.finfo(float).tiny), squares


def courses(series: Sequence[Points]) -> list[Course]:
    """The courses of a parameter in all vehicles of a class, whose scatter is estimated from all of them.

    Vehicles with few records have honest errors too: the class lends them what it knows of the scatter, and
    the less of it, the more the vehicles differ.
    """
    if not series:
        return []
    s = scatter_of([p.about_a_line for p in series])
    return [_course(p, s) for p in series]


def _course(p: Points, s: Scatter) -> Course:
    line, change, own = line_through(p, s), change_in(p, s), len(p.value) - 2
    half = float(student.ppf(0.5 + POLICY.confidence / 2, s.freedom(own))) * line.std
    p_value = min(1.0, SIDES * min(line.p_value, change.p_value)) if change else line.p_value
    form = "line"
    if change is not None:
        scale = float(s.scale(min(change.squares, line.squares), own))
        form = "change" if change.squares + scale * np.log(own + 2) < line.squares else "line"
    return Course(
        line, line.slope - half, line.slope + half, change, p_value, form, s.beyond, s.correlation,
        len(p.value),
    )  # fmt: skip
