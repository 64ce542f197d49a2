"""Heuristic law: the linear theory under Vermeulen and Johnson's cubic saturation (thesis eq. 3.63, 3.64).

Shen, Hedrick, Elkins, "A comparison of alternative creep force models for rail vehicle dynamic analysis",
1983.
"""

import casadi as cs

from fmus.contact.forces.laws.law import Creep, CreepLaw
from fmus.contact.forces.laws.linear import linear_forces
from fmus.variables import Expr

F_MIN = 1e-12  # N, rounds the size of the force at zero


class Shen(CreepLaw):
    """Linear forces and moment, reduced by one factor so that the force reaches mu N at three times it."""

    name = "shen"
    code = 1
    title = "Shen"

    def forces(self, c: Creep) -> tuple[Expr, Expr, Expr]:
        """See CreepLaw.forces."""
        F_x, F_y, M_z = linear_forces(c)
        reduced = saturation(F_x, F_y, c)
        return reduced * F_x, reduced * F_y, reduced * M_z


def saturation(F_x: Expr, F_y: Expr, c: Creep) -> Expr:
    """Factor, 0 to 1, that takes a force of the linear theory back to what friction transmits."""
    F = cs.sqrt(F_x**2 + F_y**2 + F_MIN**2)
    f = cs.fmin(F / c.bound, 3)
    return (1 - 1 / 3 * f + 1 / 27 * f**2) * cs.fmin(3 * c.mu * c.N / F, 1)
