"""Wheelset of Charles et al. 2008 (eq. 1 to 5) as the system of a filter, its conicity known in four ways."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import expm

from estimator.record import Array

F11, F22, F23, F33 = 7.44e6, 6.79e6, 13.7e3, 0.0  # N, N, N.m, N.m2; this and what follows: Table 1
F_Y, K_Y, K_PSI = 50e3, 0.23e6, 2.5e6  # N.s/m, N/m, N.m
M, M_M, I_Z = 1250.0, 8000.0, 700.0  # kg, kg, kg.m2
HALF, R0, V = 0.7452, 0.45, 20.0  # m, m, m/s
I_WY, W = 200.0, 12263.0  # kg.m2, N; not in it, from Ward et al. 2010, Table A.1

MOTION = ("y", "psi", "y_dot", "psi_dot", "y_m", "y_m_dot")
OUTPUTS = ("y", "psi", "y_dot", "psi_dot", "y_ddot", "psi_ddot")
Y, Y_DOT = (MOTION.index(n) for n in ("y", "y_dot"))
DT = 2e-3  # s, of a sample
RANGE = (-0.5, 1.5)  # of the conicity in the sampled equations
ORDER = 6  # of the polynomial that they are in it, to 1e-7 of their entries


def equations(conicity: float) -> Array:
    """Rates of the motion and of d, from both (7, 7): linear, and the conicity enters in proportion.

    Eq. 2 has the last creep term of f23 by half, which its own eq. 1 and Ward et al. do not.
    """
    y, psi, y_dot, psi_dot, y_m, y_m_dot, d = np.eye(len(MOTION) + 1)
    slide = y_dot + R0 * conicity / HALF * y_dot - V * psi
    F_s = K_Y * (y_m - y) + F_Y * (y_m_dot - y_dot)
    F = F_s - 2 * F22 / V * slide - 2 * F23 / V * psi_dot - W * conicity / HALF * (y - d)
    N = -2 * F11 * (HALF * conicity / R0 * (y - d) + HALF**2 / V * psi_dot) - 2 * F33 / V * psi_dot
    N += 2 * F23 / V * slide - I_WY * V * conicity / (HALF * R0) * y_dot
    N += (W * conicity * HALF - K_PSI) * psi
    return np.array([y_dot, psi_dot, F / M, N / I_Z, y_m_dot, -F_s / M_M, 0 * d])


def sampled() -> Array:
    """Coefficients (7, 7, ORDER + 1) of the conicity's powers in the transition over a sample."""
    nodes = np.polynomial.chebyshev.chebpts1(2 * ORDER)
    at = (RANGE[1] - RANGE[0]) / 2 * nodes + (RANGE[1] + RANGE[0]) / 2
    moved = np.array([expm(equations(c) * DT).ravel() for c in at])
    size = len(MOTION) + 1
    found: Array = np.polynomial.polynomial.polyfit(at, moved, ORDER).T.reshape(size, size, ORDER + 1)
    return found


STILL, STEEP = equations(0.0), equations(1.0) - equations(0.0)
SAMPLED = sampled()
SEEN = slice(2, 4)  # whose rates are measured, beside the first four themselves


class Belief(Protocol):
    """The states of a filter beside the motion: how conicity and irregularity depend on them and change."""

    names: tuple[str, ...]

    def conicity(self, more: Array, shift: Array) -> Array:
        """Conicity (k,) at states (k, n) and shifts y - d (k,), m."""

    def irregularity(self, more: Array) -> Array:
        """d (k,), m."""

    def moved(self, more: Array, shift: Array, by: Array) -> Array:
        """States (k, n) after the wheelset moved sideways by (k,), m, from shifts (k,)."""


@dataclass(frozen=True)
class Wheelset:
    """A System of the filters: the motion, then what a belief adds to it. Sampled every DT."""

    belief: Belief
    outputs: tuple[str, ...] = OUTPUTS

    @property
    def names(self) -> tuple[str, ...]:
        """See System."""
        return (*MOTION, *self.belief.names)

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """See System; the conicity of the middle of the step holds through it."""
        whole, more = self._whole(X)
        shift = X[:, Y] - whole[:, -1]
        conicity = self.belief.conicity(more, shift + DT / 2 * X[:, Y_DOT])
        powers = np.clip(conicity, *RANGE)[:, None] ** np.arange(ORDER + 1)
        moved = np.einsum("ijk,kj->ki", SAMPLED @ powers.T, whole)
        x = moved[:, :-1]
        return np.hstack([x, self.belief.moved(more, shift, x[:, Y] - X[:, Y])]), carried

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """See System."""
        whole, more = self._whole(X)
        conicity = self.belief.conicity(more, X[:, Y] - whole[:, -1])
        dot = whole @ STILL[SEEN].T + conicity[:, None] * (whole @ STEEP[SEEN].T)
        return np.hstack([X[:, :4], dot])

    def _whole(self, X: Array) -> tuple[Array, Array]:
        """The motion with d (k, 7), and what the belief adds."""
        n = len(MOTION)
        return np.column_stack([X[:, :n], self.belief.irregularity(X[:, n:])]), X[:, n:]

    def settled(self, x: Array) -> Array:
        """See System."""
        return x

    def values(self, x: Array, std: Array) -> tuple[Array, Array]:
        """As it is: nothing is transformed."""
        return x, std


class Constant:
    """Conicity is a constant (eq. 7), and the irregularity is treated as noise."""

    names: tuple[str, ...] = ("conicity",)

    def conicity(self, more: Array, shift: Array) -> Array:
        """See Belief."""
        return more[:, 0]

    def irregularity(self, more: Array) -> Array:
        """See Belief."""
        return np.zeros(len(more))

    def moved(self, more: Array, shift: Array, by: Array) -> Array:
        """See Belief."""
        return more


class Along(Constant):
    """The irregularity is estimated too (eq. 8 and 9).

    kept: share of it that a sample leaves; 1 is the source's random walk, which knows no bound.
    """

    names: tuple[str, ...] = ("conicity", "d")

    def __init__(self, kept: float = 1.0) -> None:
        self._kept = np.array([1.0, kept])

    def irregularity(self, more: Array) -> Array:
        """See Belief."""
        return more[:, 1]

    def moved(self, more: Array, shift: Array, by: Array) -> Array:
        """See Belief."""
        kept: Array = more * self._kept
        return kept


class Curved(Along):
    """Conicity is a known function of the shift [m], (k,) -> (k,); the irregularity alone is estimated.

    kept: see Along.
    """

    names: tuple[str, ...] = ("d",)

    def __init__(self, curve: Callable[[Array], Array], kept: float = 1.0) -> None:
        super().__init__(kept)
        self._curve = curve

    def conicity(self, more: Array, shift: Array) -> Array:
        """See Belief."""
        return self._curve(shift)

    def irregularity(self, more: Array) -> Array:
        """See Belief."""
        return more[:, 0]

    def moved(self, more: Array, shift: Array, by: Array) -> Array:
        """See Belief."""
        kept: Array = more * self._kept[1]
        return kept
