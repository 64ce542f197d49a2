"""Estimates of a machine's unknowns from single records, and the test whether two of them differ."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from estimator.closeloop.hypotheses.fitted import Fit, sandwich
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.several.chart import Chart
from estimator.record import Array

LOOSE = 10.0  # prior standard deviation of an unknown, in its scales
TELLS = 0.5  # share of the prior standard deviation, above which a record does not determine the unknown


@dataclass(frozen=True)
class Estimates:
    """Estimates of the machine's unknowns from one record.

    values: (n,); covariance: (n, n); white: (n, n), the covariance that white residuals would give; open:
    names of unknowns whose intervals reach a bound, of which slopes at the estimate say too little.
    """

    unknowns: tuple[Unknown, ...]
    values: Array
    covariance: Array
    white: Array
    open: frozenset[str] = frozenset()

    @property
    def figures(self) -> dict[str, tuple[float, float]]:
        """Value and standard error by name."""
        error = np.sqrt(np.diag(self.covariance))
        return {
            u.name: (float(v), float(e)) for u, v, e in zip(self.unknowns, self.values, error, strict=True)
        }

    @property
    def told(self) -> tuple[str, ...]:
        """Names of the unknowns that the record determines."""
        error = np.sqrt(np.diag(self.covariance))
        known = (e < TELLS * LOOSE * u.scale for u, e in zip(self.unknowns, error, strict=True))
        return tuple(
            u.name for u, k in zip(self.unknowns, known, strict=True) if k and u.name not in self.open
        )

    def only(self, names: Sequence[str]) -> "Estimates":
        """The estimates of the named unknowns, in the order of the names."""
        at = [[u.name for u in self.unknowns].index(n) for n in names]
        block = np.ix_(at, at)
        some = tuple(self.unknowns[i] for i in at)
        return Estimates(some, self.values[at], self.covariance[block], self.white[block], self.open)


def widths(unknowns: Sequence[Unknown], loose: Sequence[Unknown]) -> Array:
    """Widths (n,) between the bounds; those of the `loose` unknowns are limited to their prior width."""
    every = np.array([u.high - u.low for u in unknowns])
    most = np.array([np.sqrt(12) * LOOSE * u.scale if u in loose else np.inf for u in unknowns])
    least: Array = np.minimum(every, most)
    return least


def estimates(made: Chart, fit: Fit) -> Estimates:
    """Estimates of the machine's unknowns from a fit with the effects of the chart."""
    scale = np.array([u.scale for u in fit.unknowns])
    width = widths(fit.unknowns, made.natives)
    jacobian = fit.jacobian
    covariance = sandwich(fit.residual, jacobian, scale, width)
    white = sandwich(np.zeros_like(fit.residual), jacobian, scale, width)
    values = made.turned(fit.theta)
    native = [u.name for u in fit.unknowns]
    own = {n for w in made.waves for n in (w.sine, w.cosine)}
    names = [n for n in native if n not in own] + [n for w in made.waves for n in (w.amplitude, w.phase)]
    back = np.linalg.pinv(made.slopes(values, native, names))
    at = [names.index(u.name) for u in made.machine]
    rows = back[at]
    found = np.array([values[u.name] for u in made.machine])
    return Estimates(made.machine, found, rows @ covariance @ rows.T, rows @ white @ rows.T)


@dataclass(frozen=True)
class Difference:
    """Distance of two estimates in standard errors, the number of compared unknowns, and the p-value."""

    distance: float
    unknowns: int
    p_value: float


def difference(a: Estimates, b: Estimates) -> Difference:
    """The Wald test of equality of two estimates, over the unknowns that both records determine."""
    told = [n for n in a.told if n in b.told]
    if not told:
        return Difference(0.0, 0, 1.0)
    one, other = a.only(told), b.only(told)
    size = np.array([u.scale for u in one.unknowns])
    apart = (one.values - other.values) / size
    covariance = (one.covariance + other.covariance) / np.outer(size, size)
    square = float(apart @ np.linalg.pinv(covariance, hermitian=True) @ apart)
    return Difference(float(np.sqrt(square)), len(told), float(chi2.sf(square, len(told))))
