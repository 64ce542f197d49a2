"""Polach's law with spin (thesis eq. 3.65 to 3.83, their misprints put right).

Polach, "A fast wheel-rail forces calculation computer code", 2000; "Creep forces in simulations of traction
vehicles running on adhesion limit", Wear 258 (2005) 992-1000, for k_A and k_S.
"""

import casadi as cs

from fmus.contact.forces.laws.law import Creep, CreepLaw
from fmus.contact.forces.laws.linear import linear_forces
from fmus.contact.forces.laws.shen import saturation
from fmus.variables import Expr

S_MIN = 1e-15  # rounds the size of the creepage at zero


class Polach(CreepLaw):
    """Force along the creepage, and a lateral force by spin; the moment is that of the heuristic law."""

    name = "polach"
    code = 4
    title = "Polach"

    def forces(self, c: Creep) -> tuple[Expr, Expr, Expr]:
        """See CreepLaw.forces."""
        # the lateral creepage with that of the leading edge under spin, where it is larger
        square = cs.fmax(c.xi_y**2, (c.xi_y + c.xi_s * c.a) ** 2) + S_MIN**2
        s_yC, s_C = cs.sqrt(square), cs.sqrt(c.xi_x**2 + square)
        eps = stress_gradient(s_C, c.a, c.b, mean_coefficient(c), c.bound, c.G)
        per_creepage = creep_force(eps, c.mu * c.N, c.k_A, c.k_S) / s_C
        F_x = -per_creepage * c.xi_x
        F_y = -per_creepage * c.xi_y - spin_force(s_yC, s_C, c)
        linear_x, linear_y, M_z = linear_forces(c)
        return F_x, F_y, M_z * saturation(linear_x, linear_y, c)


def mean_coefficient(c: Creep) -> Expr:
    """c11 and c22 as the creepage's direction mixes them (eq. 3.78)."""
    rounded = (c.kalker.c11**2 + c.kalker.c22**2) / 2 * S_MIN**2
    mixed = (c.kalker.c11 * c.xi_x) ** 2 + (c.kalker.c22 * c.xi_y) ** 2
    return cs.sqrt((mixed + rounded) / (c.xi_x**2 + c.xi_y**2 + S_MIN**2))


def stress_gradient(s: Expr, a: Expr, b: Expr, c_jj: Expr, bound: Expr, G: Expr) -> Expr:
    """Gradient of tangential stress in adhesion, for creepage s; bound = mu N (eq. 3.67, 3.77)."""
    return cs.pi / 4 * G * a * b * c_jj * s / bound


def creep_force(eps: Expr, bound: Expr, k_A: Expr, k_S: Expr) -> Expr:
    """Magnitude of the creep force, N, from the stress gradient; bound = mu N (eq. 3.83)."""
    return 2 / cs.pi * bound * (k_A * eps / (1 + (k_A * eps) ** 2) + cs.atan(k_S * eps))


def spin_force(s_yC: Expr, s_C: Expr, c: Creep) -> Expr:
    """Lateral force, N, by which positive spin is opposed (eq. 3.72, 3.80, 3.81).

    With d = (eps² - 1)/(eps² + 1) the polynomial eps (d³/3 - d²/2 + 1/6) - sqrt((1 - d²)³)/3 of the
    source is -(2/3) eps/(1 + eps²)², without cancellation at large creepage.
    """
    k_s = 1 + 6.3 * (1 - cs.exp(-c.a / c.b))
    # the quotient (k_s K_M) of the source, with one division by k_s and both brackets at once
    stiff = 8 / 3 * c.G * c.b * cs.sqrt(c.a * c.b) * c.kalker.c23 / c.bound
    reduced = k_s**2 / (k_s**2 + (stiff * s_yC) ** 2)
    return 3 / 8 * c.a * c.mu * c.N * stiff * reduced**2 * (s_yC / s_C) * c.xi_s
