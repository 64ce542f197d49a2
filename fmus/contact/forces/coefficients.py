"""Kalker's creep coefficients of the contact ellipse, as CasADi expressions and for arrays."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from fmus.contact.arguments import (
    POSITIVE,
    Array,
    Number,
    between,
    broadcast,
    checked,
    mapped,
)
from fmus.contact.even_table import rows_from
from fmus.contact.forces.kalker_asymptotes import long_across, long_along
from fmus.contact.forces.kalker_polynomials import polynomials
from fmus.contact.two import for_two
from fmus.errors import did_you_mean
from fmus.variables import Expr

TABLE = Path(__file__).with_name("kalker_1990.csv")
NU = (0.0, 0.25, 0.5)  # Poisson's ratios of the table
SLENDER = 0.1  # smaller over larger semi-axis in the table's outer rows
SPACING = 0.1  # of the places
PLACES = np.arange(1, 20) / 10  # of the rows: a/b up to the circle, 2 - b/a beyond it


class Kalker(NamedTuple):
    """Creep coefficients, dimensionless: along, lateral, lateral force by spin, spin moment."""

    c11: Expr
    c22: Expr
    c23: Expr
    c33: Expr


def kalker(
    a_over_b: ArrayLike, nu: ArrayLike, source: str = "table"
) -> tuple[Number, Number, Number, Number]:
    """Kalker's creep coefficients (c11, c22, c23, c33), dimensionless.

    a_over_b: semi-axis along rolling over the lateral one, > 0; nu: Poisson's ratio, 0 to 0.5; floats or
    arrays that broadcast. source: "table" (Kalker 1990) or "polynomial" (thesis, appendix A; a/b from
    0.1 to 10). ValueError names a wrong argument.
    """
    if source not in SOURCES:
        raise ValueError(f"source '{source}' is not known; {did_you_mean(source, SOURCES)}")
    tabulated = POSITIVE if source == "table" else between(SLENDER, 1 / SLENDER)
    given = broadcast(
        a_over_b=checked("a_over_b", "1", a_over_b, tabulated),
        nu=checked("nu", "1", nu, between(NU[0], NU[-1])),
    )
    c11, c22, c23, c33 = mapped(_compiled(source), list(given.values()), given["nu"].shape)
    return c11, c22, c23, c33


def coefficients(a_over_b: Expr, nu: Expr) -> Kalker:
    """Creep coefficients from Kalker's table, as CONTACT reads it.

    Linear in the smaller of a/b and b/a on each side of the circle; a parabola in nu through 1/c.
    Beyond 0.1 Kalker's limits, to which the difference from the table's last row fades in proportion.
    """
    g = cs.fmin(cs.fmin(a_over_b, 1 / a_over_b), SLENDER)
    lies_across = a_over_b <= 1
    limits, at_the_edge = (
        [
            cs.if_else(lies_across, low, high)
            for low, high in zip(long_across(x, nu), long_along(x, nu), strict=True)
        ]
        for x in (g, cs.SX(SLENDER))
    )
    inside = _between_rows(a_over_b, nu)
    return Kalker(
        *(
            limit * (1 + (c / edge - 1) * (g / SLENDER))
            for c, limit, edge in zip(inside, limits, at_the_edge, strict=True)
        )
    )


@cache
def looked_up() -> cs.Function:
    """The same for both contacts of a wheelset, (a, b, nu) -> columns of two, several times cheaper.

    It looks the rows up where `coefficients`, an expression of scalars, must work all of them out.
    """
    ratio, nu = cs.SX.sym("ratio"), cs.SX.sym("nu")
    every = cs.Function("every", [ratio, nu], list(coefficients(ratio, nu)), ["ratio", "nu"], Kalker._fields)
    a, b, numbers, along = (cs.MX.sym(name, 2) for name in ("a", "b", "numbers", "along"))
    n = cs.MX.sym("nu")
    rows = [rows_from(_table(), numbers[i], 2) for i in (0, 1)]
    given = [a, b, numbers, along, n]
    within = cs.Function("within", given, _between_rows_of_two().call([*rows, along, n]))
    beyond = cs.Function("beyond", given, for_two(every, ["nu"]).call([a / b, n]))
    outside, *at = _place_of_two()(a, b)
    found = cs.Function.conditional("kalker", [within], beyond).call([outside, a, b, *at, n])
    return cs.Function("kalker", [a, b, n], found, ["a", "b", "nu"], Kalker._fields)


def _place_of_two() -> cs.Function:
    """Function (a, b of both) -> whether one is beyond the table, rows before them, how far beyond those."""
    a, b = cs.SX.sym("a", 2), cs.SX.sym("b", 2)
    place = _place(a / b, b / a)
    inside = _bounded(place)
    beyond = cs.logic_or(place[0] != inside[0], place[1] != inside[1])
    row = (inside - PLACES[0]) * (1 / SPACING)
    number = cs.fmin(cs.floor(row), len(PLACES) - 2)
    return cs.Function("place", [a, b], [beyond, number, row - number])


def _between_rows_of_two() -> cs.Function:
    """Function (two rows for each contact, how far between them, nu) -> c11, c22, c23, c33 of both."""
    rows = [cs.SX.sym(side, _table().shape[1], 2) for side in ("left", "right")]
    t, nu = cs.SX.sym("t", 2), cs.SX.sym("nu")
    each = [_over_nu(cs.vertsplit(r[:, 0] + t[i] * (r[:, 1] - r[:, 0])), nu) for i, r in enumerate(rows)]
    both = [cs.vertcat(*of) for of in zip(*each, strict=True)]
    return cs.Function("between_rows", [*map(cs.vec, rows), t, nu], cs.cse(both))


def _place(a_over_b: Expr, b_over_a: Expr) -> Expr:
    """Where among the table's rows a ratio lies."""
    return cs.if_else(a_over_b <= 1, a_over_b, 2 - b_over_a)


def _bounded(place: Expr) -> Expr:
    """The place, or the table's end that it is beyond."""
    return cs.fmin(cs.fmax(place, PLACES[0]), PLACES[-1])


def _between_rows(a_over_b: Expr, nu: Expr) -> list[Expr]:
    """The four coefficients in the table, beyond its end its outer rows."""
    table, place = _table(), _bounded(_place(a_over_b, 1 / a_over_b))
    # a broken line is a sum of ramps, one from each row on; all columns share them
    ramps = cs.vertcat(*(cs.fmax(place - row, 0) for row in PLACES[:-1]))
    bends = np.diff(np.diff(table, axis=0) / np.diff(PLACES)[:, None], axis=0, prepend=0.0)
    return _over_nu([table[0, j] + cs.dot(bends[:, j], ramps) for j in range(table.shape[1])], nu)


def _over_nu(columns: list[Expr], nu: Expr) -> list[Expr]:
    """The coefficients by the parabola through 1/c at the table's Poisson's ratios."""
    t = 1 / NU[1] * nu
    share = 0.5 * (t - 1) * (t - 2), t * (2 - t), 0.5 * t * (t - 1)
    return [
        # the sum of the shares over their columns, with one division
        low * mid * high / (share[0] * mid * high + share[1] * low * high + share[2] * low * mid)
        for low, mid, high in zip(*(columns[j::3] for j in range(3)), strict=True)
    ]


@cache
def _table() -> Array:
    """Rows by a/b (19,), columns c11 at the three Poisson's ratios, c22 at them, and so on (12,)."""
    rows = np.loadtxt(TABLE, delimiter=",", skiprows=3)  # a/b, nu, c11, c22, c23, c33
    by_ratio = rows.reshape(len(PLACES), len(NU), -1)
    return np.asarray(by_ratio[:, :, 2:].transpose(0, 2, 1).reshape(len(PLACES), -1))


SOURCES: dict[str, Callable[[Expr, Expr], "list[Expr] | Kalker"]] = {
    "table": coefficients,
    "polynomial": polynomials,
}


@cache
def _compiled(source: str) -> cs.Function:
    ratio, nu = cs.SX.sym("a_over_b"), cs.SX.sym("nu")
    return cs.Function("kalker", [ratio, nu], cs.cse(list(SOURCES[source](ratio, nu))))
