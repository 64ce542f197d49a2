"""FASTSIM: Kalker's simplified theory, tractions cell by cell along strips of the patch (thesis 3.3.3).

Kalker, "A fast algorithm for the simplified theory of rolling contact", Vehicle System Dynamics 11 (1982);
parabolic bound by Vollebregt & Wilders, Computational Mechanics 47 (2011). Tractions are taken over the bound
in the middle of their strip, by which all strips become alike, and forces over the bound of all cells.
"""

from functools import lru_cache
from typing import TypeAlias

import casadi as cs
import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.forces.laws.law import (
    ARGUMENTS,
    RESULTS,
    Creep,
    CreepLaw,
    creep,
)
from fmus.variables import Expr

Grid: TypeAlias = tuple[int, int]  # cells along rolling, strips across


class Fastsim(CreepLaw):
    """Forces and moment of the tractions on a grid, exactly mu N where all cells slip one way."""

    name = "fastsim"
    code = 2
    title = "FASTSIM"

    def __init__(self, n: Grid = (20, 20)) -> None:
        self.n = n

    def forces(self, c: Creep) -> tuple[Expr, Expr, Expr]:
        """See CreepLaw.forces."""
        return _scaled(c, *_tractions(self.n)(*_rigid_slip(c)))

    def function(self) -> cs.Function:
        """See CreepLaw.function; a loop over the cells of a strip, small whatever the grid."""
        symbols = [cs.SX.sym(name) for name in ARGUMENTS]
        sums = [cs.SX.sym(name) for name in ("f_x", "f_y", "m_x", "m_y")]
        slip = cs.Function("rigid_slip", symbols, _rigid_slip(creep(symbols)))
        scaled = cs.Function("scaled", [*symbols, *sums], _scaled(creep(symbols), *sums))
        given = [cs.MX.sym(name) for name in ARGUMENTS]
        found = scaled(*given, *_tractions(self.n)(*slip(*given)))
        return cs.Function(self.name, given, list(found), ARGUMENTS, RESULTS)


def _rigid_slip(c: Creep) -> list[Expr]:
    """Slip of rigid bodies over the patch's half length, in tractions over the bound in its middle.

    By longitudinal and lateral creepage, and by spin at the sides and at the ends: a/(L mu p_0) times
    xi_x, xi_y, b xi_s, a xi_s with the flexibilities L_1, L_2, L_3 and p_0 = 2 N/(pi a b).
    """
    k = c.kalker
    creepage = 3 * np.pi / 16 * c.G * c.a * c.b / c.bound
    spin = 2 * c.G * c.b * cs.sqrt(c.a * c.b) * k.c23 * c.xi_s / c.bound
    return [creepage * k.c11 * c.xi_x, creepage * k.c22 * c.xi_y, c.b * spin, c.a * spin]


def _scaled(c: Creep, f_x: Expr, f_y: Expr, m_x: Expr, m_y: Expr) -> tuple[Expr, Expr, Expr]:
    bound = c.mu * c.N
    return bound * f_x, bound * f_y, bound * (c.a * m_y - c.b * m_x)


@lru_cache(maxsize=16)
def _tractions(n: Grid) -> cs.Function:
    """Rigid slip -> sums over the patch: forces over mu N, their moments over mu N b and mu N a."""
    cells, strips = n
    y = (2 * np.arange(strips) + 1) / strips - 1  # over b
    length = np.sqrt(1 - y**2)  # of the strips over that of the middle one
    t = 1 - (2 * np.arange(cells) + 1) / cells  # centres of the cells, from the leading edge at 1 to -1
    weight = length**3 / (np.sum(length**3) * np.sum(1 - t**2))
    column = _column(y, length, weight)
    given = [cs.MX.sym(name) for name in ("u_x", "u_y", "v_x", "v_y")]
    u_x, u_y, v_x, v_y = given
    over_a_cell: list[Expr] = [
        2 / (cells * length) * (u_x - y * v_x),
        2 / (cells * length) * u_y,
        2 / cells * v_y,
    ]
    p_x: Expr = cs.MX.zeros(strips)
    p_y: Expr = cs.MX.zeros(strips)
    total: Expr = cs.MX.zeros(4)
    for i, place in enumerate(t):
        way = 0.5 if i == 0 else 1.0  # in cells, to the centre of this one; the slip is that in between
        p_x, p_y, sums = column(p_x, p_y, *over_a_cell, way, place + way / cells, place)
        total += sums
    return cs.Function("tractions", given, cs.vertsplit(total))


def _column(y: Array, length: Array, weight: Array) -> cs.Function:
    """One step of all strips: tractions at one cell from those at the cell before, and their sums."""
    p_x, p_y, slip_x, slip_y = (cs.SX.sym(name, len(y)) for name in ("p_x", "p_y", "slip_x", "slip_y"))
    scalars = [cs.SX.sym(name) for name in ("slip_s", "way", "t_between", "t")]
    slip_s, way, between, t = scalars
    q_x = p_x - way * slip_x
    q_y = p_y - way * (slip_y + between * slip_s)
    bound = (1 - t**2) ** 2
    kept = cs.sqrt(bound / cs.fmax(bound, q_x**2 + q_y**2))
    q_x, q_y = kept * q_x, kept * q_y
    sums = [cs.dot(w, q) for w, q in ((weight, q_x), (weight, q_y), (weight * y, q_x))]
    sums.append(t * cs.dot(weight * length, q_y))
    given = [p_x, p_y, slip_x, slip_y, *scalars]
    return cs.Function("column", given, [q_x, q_y, cs.vertcat(*sums)])
