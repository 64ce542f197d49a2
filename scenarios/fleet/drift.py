"""Parameters over mileage: a line and a change point for each vehicle, with their errors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from scenarios.fleet.scatter import CONFIDENCE, EFFICIENCY, Array, excess

FEWEST = 4  # records of a vehicle, from which on a line has freedom left to be tested
# 95 % point of the likelihood ratio about the true change point, -2 ln(1 - sqrt(0.95)):
# B. E. Hansen, Econometrica 68 (2000), 575-603
CHANGE_RATIO = 7.35
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
        return len(self.value) >= FEWEST and bool(np.ptp(self.mileage) > 0)


@dataclass(frozen=True)
class Line:
    """A line through points; slope: per unit of mileage; squares: weighted, about the line."""

    slope: float
    std: float
    squares: float


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
    low, high: 95 % interval of the slope; scatter: of the class, beyond the standard errors.
    """

    line: Line
    low: float
    high: float
    change: Change | None
    p_value: float
    form: str
    scatter: float
    records: int


def line_through(p: Points, scatter: float) -> Line:
    """The weighted line through points, whose errors contain the scatter."""
    w = 1 / (p.std**2 + scatter**2)
    x = p.mileage - np.sum(w * p.mileage) / w.sum()
    slope = float(np.sum(w * x * p.value) / np.sum(w * x**2))
    left = p.value - np.sum(w * p.value) / w.sum() - slope * x
    return Line(slope, float(np.sum(w * x**2) ** -0.5), float(np.sum(w * left**2)))


def change_in(p: Points, scatter: float, freedom: float) -> Change | None:
    """The most likely change of the mean, with at least two records on either side; None if there is none.

    The likelihood ratio of D. V. Hinkley (Biometrika 57 (1970), 1-17) for known errors.
    """
    w = 1 / (p.std**2 + scatter**2)
    n = len(w)
    places = np.array([k for k in range(2, n - 1) if p.mileage[k] > p.mileage[k - 1]], dtype=int)
    if not len(places):
        return None
    weight, total = np.cumsum(w), np.cumsum(w * p.value)
    before, after = weight[places - 1], weight[-1] - weight[places - 1]
    jump = (total[-1] - total[places - 1]) / after - total[places - 1] / before
    std = np.sqrt(1 / before + 1 / after)
    ratio = (jump / std) ** 2
    best = int(np.argmax(ratio))
    alike = np.flatnonzero(ratio >= ratio[best] - CHANGE_RATIO)
    q = float(student.ppf(0.5 + CONFIDENCE / 2, freedom))
    p_value = min(1.0, len(places) * 2 * float(student.sf(np.sqrt(ratio[best]), freedom)))
    k = places[best]
    squares = float(np.sum(w * (p.value - total[-1] / weight[-1]) ** 2) - ratio[best])
    return Change(
        float((p.mileage[k - 1] + p.mileage[k]) / 2),
        float(p.mileage[places[alike[0]] - 1]), float(p.mileage[places[alike[-1]]]),
        float(jump[best]), float(std[best]),
        float((jump - q * std)[alike].min()), float((jump + q * std)[alike].max()),
        p_value, squares,
    )  # fmt: skip


def courses(series: Sequence[Points]) -> list[Course]:
    """The courses of a parameter in all vehicles of a class, whose scatter is estimated from all of them.

    The scatter of repeated records about each vehicle's own line is common to the class, so that vehicles
    with few records have honest errors too; t-tests have the freedom of the whole class.
    """
    freedom = np.array([len(p.value) - 2 for p in series], dtype=np.float64)
    if not series:
        return []
    scatter = excess(
        lambda tau: np.array([line_through(p, tau).squares for p in series]),
        freedom,
        float(min(p.std.min() for p in series)),
    )
    return [_course(p, scatter, EFFICIENCY * float(freedom.sum())) for p in series]


def _course(p: Points, scatter: float, freedom: float) -> Course:
    line, change = line_through(p, scatter), change_in(p, scatter, freedom)
    half = float(student.ppf(0.5 + CONFIDENCE / 2, freedom)) * line.std
    p_line = float(2 * student.sf(abs(line.slope) / line.std, freedom))
    p_value = min(1.0, SIDES * min(p_line, change.p_value)) if change else p_line
    better = change is not None and change.squares + np.log(len(p.value)) < line.squares
    return Course(
        line, line.slope - half, line.slope + half, change, p_value, "change" if better else "line", scatter,
        len(p.value),
    )  # fmt: skip
