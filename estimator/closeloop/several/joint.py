"""Joint least-squares fit to several records, which share the unknowns of the machine but no others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from estimator.closeloop.fitting.fit import GAIN
from estimator.closeloop.hypotheses.fitted import BLOCKS, sandwich
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.several.estimates import Estimates, widths
from estimator.closeloop.several.part import Part
from estimator.record import Array

JOINT_EVALUATIONS = 25
OFF_BOUND = 1e-9  # scales: distance that start values keep from their bounds


@dataclass(frozen=True, eq=False)
class Together:
    """A joint fit of several records: the shared estimates, and each record's hypothesis at these values."""

    shared: Estimates
    parts: tuple[Hypothesis, ...]

    @property
    def costs(self) -> tuple[float, ...]:
        """Sum of squares of each record on its part to identify."""
        return tuple(h.fit.cost for h in self.parts)


class _Stack:
    """The unknowns of all records in one vector: the shared ones, then each record's own."""

    def __init__(self, parts: Sequence[Part], held: Mapping[str, float]) -> None:
        self.parts, self.held = parts, held
        self.shared = tuple(u for u in parts[0].chart.machine if u.name not in held)
        self.unknowns = [*self.shared, *(u for p in parts for u in p.own)]
        ends = np.cumsum([len(self.shared), *(len(p.own) for p in parts)])
        common = range(len(self.shared))
        self.at = [np.array([*common, *range(a, b)], dtype=int) for a, b in pairwise(ends.tolist())]
        self.names = [[u.name for u in (*self.shared, *p.own)] for p in parts]

    def values(self, x: Array, i: int) -> dict[str, float]:
        """The values of the i-th record by the names of its chart."""
        return {**self.held, **dict(zip(self.names[i], x[self.at[i]].tolist(), strict=True))}

    def start(self, low: Array, high: Array) -> Array:
        """Start values within bounds: the mean over the records if shared, else those of each record."""
        turned = [p.chart.turned(p.start) for p in self.parts]
        common = [float(np.mean([t[u.name] for t in turned])) for u in self.shared]
        own = [t[u.name] for t, p in zip(turned, self.parts, strict=True) for u in p.own]
        return np.asarray(np.clip([*common, *own], low, high))

    def residual(self, x: Array) -> Array:
        """The residuals of all records, one after the other, (m,)."""
        return np.concatenate([p.residual(self.values(x, i)) for i, p in enumerate(self.parts)])

    def jacobian(self, x: Array) -> Array:
        """The derivatives of the residuals, (m, n)."""
        pieces = []
        for i, p in enumerate(self.parts):
            slopes = p.slopes(self.values(x, i), self.names[i])
            piece = np.zeros((len(slopes), len(self.unknowns)))
            piece[:, self.at[i]] = slopes
            pieces.append(piece)
        return np.vstack(pieces)

    def rows(self) -> list[slice]:
        """The rows of each record in the residual."""
        lengths = [
            len(p.weighting) * sum(int(r.fit.sum()) for r in p.problem.record.runs) for p in self.parts
        ]
        return [slice(a, b) for a, b in pairwise(np.cumsum([0, *lengths]).tolist())]

    def order(self) -> Array:
        """An order of rows in which each of the BLOCKS blocks holds one block of every record."""
        split = [np.array_split(np.arange(r.start, r.stop), BLOCKS) for r in self.rows()]
        return np.concatenate([block for blocks in zip(*split, strict=True) for block in blocks])


def fit_together(parts: Sequence[Part], held: Mapping[str, float] | None = None) -> Together:
    """Least squares over all records with shared unknowns of the machine, from their mean start values.

    held: values of shared unknowns that are not fitted. Raises FmuError if the FMU cannot be simulated with
    the fitted values.
    """
    stack = _Stack(parts, held or {})
    low, high, scale = (np.array([getattr(u, k) for u in stack.unknowns]) for k in ("low", "high", "scale"))
    x = stack.start(low + OFF_BOUND * scale, high - OFF_BOUND * scale)
    if stack.unknowns:
        x = least_squares(
            stack.residual, x, stack.jacobian, (low, high), x_scale=scale, xtol=1e-5, ftol=GAIN,
            max_nfev=JOINT_EVALUATIONS,
        ).x  # fmt: skip
    residual, slopes = stack.residual(x), stack.jacobian(x)
    width = widths(stack.unknowns, [u for p in parts for u in (*p.chart.machine, *p.chart.run)])
    order = stack.order()
    covariance, white = (
        sandwich(r[order], slopes[order], scale, width) if stack.unknowns else np.empty((0, 0))
        for r in (residual, np.zeros_like(residual))
    )
    found = []
    for i, (p, rows) in enumerate(zip(parts, stack.rows(), strict=True)):
        at = stack.at[i][len(stack.shared) :][: len(p.others)]
        local = residual[rows], slopes[rows][:, at], covariance[np.ix_(at, at)]
        found.append(p.hypothesis(stack.values(x, i), *local))
    n = len(stack.shared)
    return Together(Estimates(stack.shared, x[:n], covariance[:n, :n], white[:n, :n]), tuple(found))


@dataclass(frozen=True)
class Likeness:
    """Test of one value for all records: rise of the sum of squares over separate fits, and its p-value."""

    rise: float
    unknowns: int
    p_value: float


def likeness(joint: Together, costs: Sequence[float], alone: Sequence[Estimates]) -> Likeness:
    """Likelihood-ratio test of a joint fit against separate fits with the sums of squares `costs`.

    To allow for residuals that are not white, the rise is divided by the mean ratio of the variances to those
    in white noise (first-order correction of Rao and Scott, Annals of Statistics 12 (1984), 46-60).
    """
    rise = max(0.0, sum(joint.costs) - sum(costs))
    told = [n for e in alone for n in e.told]
    unknowns = sum(told.count(n) - 1 for n in set(told))
    ratios = [np.diag(e.only(e.told).covariance) / np.diag(e.only(e.told).white) for e in alone if e.told]
    over = float(np.mean(np.concatenate(ratios))) if ratios else 1.0
    return Likeness(rise, unknowns, float(chi2.sf(rise / over, unknowns)) if unknowns else 1.0)
