"""Kalker's linear theory: no slip anywhere in the patch, friction without limit (thesis eq. 3.57)."""

import casadi as cs

from fmus.contact.forces.laws.law import Creep, CreepLaw
from fmus.variables import Expr


class Linear(CreepLaw):
    """Forces in proportion to the creepages, right where they are small."""

    name = "linear"
    code = 0
    title = "linear"
    takes_given = True

    def forces(self, c: Creep) -> tuple[Expr, Expr, Expr]:
        """See CreepLaw.forces."""
        return linear_forces(c)


def linear_forces(c: Creep) -> tuple[Expr, Expr, Expr]:
    """F_x, F_y, M_z of the linear theory."""
    k, size = c.kalker, cs.sqrt(c.a * c.b)
    F_x = -c.G * c.a * c.b * k.c11 * c.xi_x
    F_y = -c.G * c.a * c.b * (k.c22 * c.xi_y + size * k.c23 * c.xi_s)
    M_z = c.G * size**3 * (k.c23 * c.xi_y - size * k.c33 * c.xi_s)
    return F_x, F_y, M_z
