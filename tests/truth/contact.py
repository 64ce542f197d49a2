"""Truth of rolling contact, independent of the product: plain NumPy, the sources' formulas as printed there.

Differs in form: Kalker's table read by rows, FASTSIM cell by cell in physical tractions with Kalker's full
steps (1982), Polach's spin term with its long polynomial (2000).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Kalker 1990, Table E.3, nu = 0.25: a/b = 0.1 ... 1, then b/a = 1 ... 0.1
C11 = "3.31 3.37 3.44 3.53 3.62 3.72 3.81 3.91 4.01 4.12", "4.12 4.22 4.36 4.54 4.78 5.1 5.57 6.34 7.78 11.7"
C22 = "2.52 2.63 2.75 2.88 3.01 3.14 3.28 3.41 3.54 3.67", "3.67 3.81 3.99 4.21 4.5 4.9 5.48 6.4 8.14 12.8"
C23 = (
    ".473 .603 .715 .823 .929 1.03 1.14 1.25 1.36 1.47",
    "1.47 1.59 1.75 1.95 2.23 2.62 3.24 4.32 6.63 14.6",
)
C33 = (
    "8.28 4.27 2.96 2.32 1.93 1.68 1.5 1.37 1.27 1.19",
    "1.19 1.11 1.04 .965 .892 .819 .747 .674 .601 .526",
)


@dataclass(frozen=True)
class Patch:
    """An ellipse under load; Poisson's ratio is 0.25, the column of the table above."""

    a: float  # m, along rolling
    b: float  # m, lateral
    N: float  # N
    mu: float
    G: float  # Pa

    def kalker(self) -> list[float]:
        """c11, c22, c23, c33, linear between the rows of the smaller of a/b and b/a."""
        return [self._interpolated(*table) for table in (C11, C22, C23, C33)]

    def _interpolated(self, long_across: str, long_along: str) -> float:
        rows = np.arange(1, 11) / 10
        if self.a <= self.b:
            return float(np.interp(self.a / self.b, rows, np.array(long_across.split(), float)))
        return float(np.interp(self.b / self.a, rows, np.array(long_along.split(), float)[::-1]))


def fastsim(patch: Patch, xi_x: float, xi_y: float, xi_s: float, n: int = 100) -> Array:
    """(F_x, F_y, M_z) of its tractions by Kalker's algorithm of 1982 on n x n cells, parabolic bound."""
    a, b = patch.a, patch.b
    c11, c22, c23, _ = patch.kalker()
    L1, L2 = 8 * a / (3 * patch.G * c11), 8 * a / (3 * patch.G * c22)
    L3 = np.pi * a**2 / (4 * patch.G * c23 * np.sqrt(a * b))
    y = -b + (np.arange(n) + 0.5) * 2 * b / n
    edge = a * np.sqrt(1 - (y / b) ** 2)
    dx, dy = 2 * edge / n, 2 * b / n
    p, total = np.zeros((2, n)), np.zeros(3)
    for i in range(n):
        x = edge - (i + 0.5) * dx
        p = p - dx * np.array([xi_x / L1 - y * xi_s / L3, xi_y / L2 + x * xi_s / L3])
        bound = patch.mu * 2 * patch.N / (np.pi * a * b) * (1 - (x / a) ** 2 - (y / b) ** 2)
        size = np.hypot(*p)
        p = np.where(size > bound, p * bound / np.where(size > 0, size, 1.0), p)
        total += np.sum(np.array([p[0], p[1], x * p[1] - y * p[0]]) * dx * dy, axis=1)
    return total


def polach(patch: Patch, s_x: float, s_y: float, xi_s: float, k_A: float = 1.0, k_S: float = 1.0) -> Array:
    """(F_x, F_y) with spin, Polach 2000 with the factors of 2005; the creepages not all zero."""
    a, b, Q, mu = patch.a, patch.b, patch.N, patch.mu
    c11, c22, c23, _ = patch.kalker()
    s = np.hypot(s_x, s_y)
    s_yC = s_y + xi_s * a if abs(s_y + xi_s * a) > abs(s_y) else s_y
    s_C = np.hypot(s_x, s_yC)
    c_jj = np.sqrt((c11 * s_x / s) ** 2 + (c22 * s_y / s) ** 2) if s > 0 else 0.0
    eps = k_A * np.pi * patch.G * a * b * c_jj * s_C / (4 * Q * mu)
    F = 2 * Q * mu / np.pi * (eps / (1 + eps**2) + np.arctan(k_S / k_A * eps))
    k = 1 + 6.3 * (1 - np.exp(-a / b))
    eps_S = 8 / 3 * patch.G * b * np.sqrt(a * b) * c23 * abs(s_yC) / (Q * mu * k)
    d = (eps_S**2 - 1) / (eps_S**2 + 1)
    K_M = eps_S * (d**3 / 3 - d**2 / 2 + 1 / 6) - np.sqrt((1 - d**2) ** 3) / 3
    return np.array([-F * s_x / s_C, -F * s_y / s_C + 9 / 16 * a * Q * mu * K_M * k * xi_s / s_C])
