"""Kalker's creep coefficients of very slender ellipses: the limits that go with his table.

J.J. Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1990, Table E.3 (g falling to 0).
"""

import casadi as cs
import numpy as np

from fmus.variables import Expr

LN_4 = np.log(4.0)


def long_across(g: Expr, nu: Expr) -> list[Expr]:
    """c11, c22, c23, c33 for a/b = g near 0: the ellipse lies across the rolling direction."""
    strip = np.pi**2 / 4
    c23 = np.pi * cs.sqrt(g) / (3 * (1 - nu)) * (1 + nu * (cs.log(16.0) - cs.log(g) - 5))
    return [strip / (1 - nu), strip, c23, strip / (4 * g * (1 - nu))]


def long_along(g: Expr, nu: Expr) -> list[Expr]:
    """c11, c22, c23, c33 for b/a = g near 0: the ellipse lies along the rolling direction."""
    L = cs.log(16.0) - 2 * cs.log(g)
    along, across = L - 2 * nu, (1 - nu) * L + 2 * nu
    twist = (1 - nu) * L - 2 + 4 * nu
    c11 = 2 * np.pi / (g * along) * (1 + (3 - LN_4) / along)
    c22 = 2 * np.pi / (g * across) * (1 + (1 - nu) * (3 - LN_4) / across)
    c23 = 2 * np.pi / (3 * g * cs.sqrt(g) * twist)
    return [c11, c22, c23, np.pi / 4 * (1 - nu * (L - 2) / twist)]
