"""Polach's creep force as a CasADi expression (thesis eq. 3.74 to 3.83; Polach 2005)."""

import casadi as cs

from fmus.variables import Expr

SMOOTH = 1e-9  # m/s, rounds the corner of |slip| at zero


def friction_coefficient(w: Expr, mu0: Expr, A: Expr, B: Expr) -> Expr:
    """Friction coefficient falling with slip velocity w, m/s: mu0 at rest, A mu0 at high slip (eq. 4.4)."""
    return mu0 * ((1 - A) * cs.exp(-B * w) + A)


def creep_force(eps: Expr, N: Expr, mu: Expr, k_A: Expr, k_S: Expr) -> Expr:
    """Magnitude of the creep force, N, from the gradient eps of tangential stress (eq. 3.83)."""
    Q = N
    return 2 * Q * mu / cs.pi * (k_A * eps / (1 + (k_A * eps) ** 2) + cs.atan(k_S * eps))


def stress_gradient(s: Expr, a: Expr, b: Expr, c_jj: Expr, N: Expr, mu: Expr, G: Expr) -> Expr:
    """Gradient of tangential stress in the adhesion area, dimensionless, for creepage s (eq. 3.77)."""
    return G * cs.pi * a * b * c_jj * s / (4 * N * mu)
