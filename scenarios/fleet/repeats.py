"""What the repeated records of a class say about their own errors, which no record says alone.

Three things are found, in this order, in ways in which a few vehicles that drift or change matter little: a
scatter beyond the standard errors, a correlation of successive records, and how much vehicles differ in their
scatter. Without the second, a slow disturbance such as a season is a drift; without the third, a vehicle on a
rougher line is named among thousands because it is rough.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import brentq
from scipy.signal import lfilter
from scipy.stats import chi2, f

from scenarios.fleet.policy import POLICY
from scenarios.fleet.scatter import Array, excess

LONG = 128  # records, from which on the correlation is found without the matrices of the fit
ROUNDED = 1e-9  # of the expected squares, below which residuals are those of the arithmetic
LARGEST = 10.0  # power of two of the freedom that is lent, beyond which vehicles are alike


@dataclass(frozen=True)
class Scatter:
    """Errors of repeated records beyond their standard errors, in a class.

    beyond: standard deviation, in the values' unit; correlation: of successive records, at least 0; lent:
    degrees of freedom that the class lends to each vehicle's own scatter, inf if all scatter alike; usual:
    scale of their variances, 1 if all are alike; known: degrees of freedom with which all this is known.
    """

    beyond: float = 0.0
    correlation: float = 0.0
    lent: float = float("inf")
    usual: float = 1.0
    known: float = float("inf")

    def weights(self, std: Array) -> Array:
        """One over the variances of values with these standard errors."""
        return 1 / (std**2 + self.beyond**2)

    def scale(self, squares: Array | float, freedom: float) -> Array:
        """Variance of a vehicle's records over that of the class, from the squares about its own fit.

        The estimate of G. K. Smyth (Stat. Appl. Genet. Mol. Biol. 3 (2004), article 3), by which a vehicle's
        own squares and those of the class count by their degrees of freedom.
        """
        own = np.asarray(squares, dtype=np.float64)
        if not np.isfinite(self.lent):
            return np.ones_like(own)
        found: Array = (self.lent * self.usual + own) / (self.lent + freedom)
        return found

    def freedom(self, own: float) -> float:
        """Degrees of freedom of a t test of a vehicle with so many of its own."""
        unknown = 1 / (self.lent + own) + 1 / self.known
        return 1 / unknown if unknown else float("inf")


@dataclass(frozen=True)
class Repeats:
    """Records of a vehicle in the order in which they were taken, and what is fitted to them.

    value, std: (n,), std > 0; design: (n, p) columns of the fit: ones, and the mileage where it is a line.
    """

    value: Array
    std: Array
    design: Array

    @property
    def freedom(self) -> int:
        """Degrees of freedom about the fit."""
        return len(self.value) - int(self.design.shape[1])

    def left(self, beyond: float) -> tuple[Array, Array]:
        """Residuals (n,) over their standard deviations, and the basis (n, p) that the fit takes out."""
        root = (self.std**2 + beyond**2) ** -0.5
        basis, _ = np.linalg.qr(root[:, None] * self.design)
        z = root * self.value
        return z - basis @ (basis.T @ z), basis

    def squares(self, beyond: float) -> float:
        """Weighted sum of squares about the fit."""
        return float(np.sum(self.left(beyond)[0] ** 2))


def share_left(taken: Array | float, n: int, p: int) -> Array:
    """The share of the squares of n correlated records that a fit of p unknowns leaves, over n - p.

    taken: sum of the variances of the records along the unit vectors of the fit, p if they are independent.
    """
    if n <= p:
        return np.ones_like(np.asarray(taken, dtype=np.float64))
    return np.minimum((n - np.asarray(taken, dtype=np.float64)) / (n - p), 1.0)


class _Class:
    """The vehicles of a class that have degrees of freedom, those with as many records side by side."""

    def __init__(self, series: Sequence[Repeats]) -> None:
        self.some = [s for s in series if s.freedom > 0]
        self.freedom = np.array([s.freedom for s in self.some], dtype=np.float64)

    @cached_property
    def _stacks(self) -> list[tuple[list[int], Array, Array, Array]]:
        shapes: dict[tuple[int, ...], list[int]] = {}
        for i, s in enumerate(self.some):
            shapes.setdefault(s.design.shape, []).append(i)
        found = []
        for at in shapes.values():
            some = [self.some[i] for i in at]
            value, std, design = (np.array([getattr(s, n) for s in some]) for n in ("value", "std", "design"))
            found.append((at, value, std, design))
        return found

    def squares(self, beyond: float) -> Array:
        """Weighted sums of squares about the fits, (V,)."""
        found = np.empty(len(self.some))
        for at, value, std, design in self._stacks:
            root = (std**2 + beyond**2) ** -0.5
            basis, _ = np.linalg.qr(root[..., None] * design)
            z = root * value
            left = z - np.einsum("vnp,vmp,vm->vn", basis, basis, z, optimize=True)
            found[at] = (left**2).sum(axis=1)
        return found


def scatter_of(series: Sequence[Repeats]) -> Scatter:
    """The scatter of a class; without any vehicle that has degrees of freedom there is none."""
    some = _Class(series)
    if not some.some:
        return Scatter()
    least = float(min(s.std.min() for s in some.some))
    beyond = excess(some.squares, some.freedom, least)
    correlation, left = _correlation(some, beyond)
    if correlation > 0:  # a fit takes more out of correlated records than of independent ones
        beyond = excess(lambda tau: some.squares(tau) / left, some.freedom, least)
    lent, usual = _lent(some.squares(beyond) / left, some.freedom)
    known = POLICY.efficiency * float(np.sum(some.freedom * left))
    return Scatter(beyond, correlation, lent, usual, known)


def _correlation(some: _Class, beyond: float) -> tuple[float, Array]:
    """The correlation of successive records, and the share (V,) of the squares that it leaves about a fit.

    The smallest at which what is seen less what is expected, summed over the vehicles, is within its standard
    error of zero: a few short series say next to nothing on it, and are not taken for correlated by chance.
    What is expected contains that residuals of a fit are correlated by themselves. A vehicle's squares count
    up to a limit, so that those which change matter little.
    """
    seen, counted, one, whole = [], [], [], []
    for s in some.some:
        r, basis = s.left(beyond)
        power = float(r @ r)
        power = power if power > ROUNDED * s.freedom else 0.0
        seen.append(float(r[1:] @ r[:-1]) / power if power > 0 else 0.0)
        counted.append(min(power, POLICY.counted * s.freedom))
        a, b = _expected(basis)
        one.append(a)
        whole.append(b)

    def at(rho: float, coefficients: Sequence[Array]) -> Array:
        return np.array([float(np.polyval(c[::-1], rho)) for c in coefficients])

    def too_little(rho: float) -> float:
        off = np.array(counted) * (np.array(seen) - at(rho, one) / at(rho, whole))
        return float(off.sum() - np.sqrt(np.sum(off**2)))

    if not any(counted) or too_little(0.0) <= 0:
        return 0.0, np.ones(len(seen))
    most = POLICY.most_correlated
    rho = most if too_little(most) >= 0 else float(brentq(too_little, 0.0, most, xtol=1e-6))
    return rho, np.minimum(at(rho, whole) / some.freedom, 1.0)


def _expected(basis: Array) -> tuple[Array, Array]:
    """Coefficients in powers of the correlation of the expected sum of products of successive residuals, and
    of the expected sum of their squares, for records of unit variance; basis: (n, p) that a fit takes out.
    """
    n, p = basis.shape
    if n > LONG:
        return np.array([-float(p), n - p]), np.array([float(n - p)])
    M = np.eye(n) - basis @ basis.T
    next_ = np.eye(n, k=1) / 2
    products = M @ (next_ + next_.T) @ M
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))).ravel()
    one, whole = (np.bincount(lag, x.ravel(), n).astype(np.float64) for x in (products, M))
    return one, whole


def _lent(squares: Array, freedom: Array) -> tuple[float, float]:
    """Degrees of freedom that the class lends, and the scale of its variances at which their median stays.

    The sums of squares over their freedom have the distribution of Fisher's F; the freedom that is lent is
    the one at which the upper quartile of their probabilities is at 3/4.
    """
    typical = float(np.median(freedom))
    middle = float(chi2.ppf(POLICY.middle, typical)) / typical

    def usual(lent: float) -> float:
        return middle / float(f.ppf(POLICY.middle, typical, lent))

    def too_many(power: float) -> float:
        lent = 2.0**power
        probable = f.cdf(squares / freedom / usual(lent), freedom, lent)
        return float(np.quantile(probable, POLICY.unequal)) - POLICY.unequal

    alike = float(np.quantile(chi2.cdf(squares, freedom), POLICY.unequal)) <= POLICY.unequal
    if alike or too_many(LARGEST) <= 0:
        return float("inf"), 1.0
    least = float(np.log2(POLICY.least_freedom))
    power = least if too_many(least) >= 0 else float(brentq(too_many, least, LARGEST, xtol=1e-3))
    return 2.0**power, usual(2.0**power)


def variance_of(parts: Array, correlation: float) -> Array:
    """Variances (n,) of the sums of the first 1, 2, ... n parts of a series of correlated unit values.

    parts: (n,) the factor of each value. In n steps, since the correlation falls by the same factor with
    each record.
    """
    before = lfilter([0.0, correlation], [1.0, -correlation], parts)
    found: Array = np.cumsum(parts**2 + 2 * parts * before)
    return found
