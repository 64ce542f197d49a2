"""Tread and flange of a wheel as two contacts, and the load that each carries. Equations: README.md."""

from __future__ import annotations

from functools import cache

import casadi as cs
import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.two import for_two
from fmus.variables import Expr
from fmus.wheelset.curves import LOAD, loaded, of_both, spline_over, tabulated_shifts
from fmus.wheelset.track import Track

PARTS = ("tread", "flange")
PATCH = ("a_hertz", "b_hertz", "a_virtual", "b_virtual")
OF_PART = ("gap", "growth", "delta", *PATCH, "approach")
FIELDS = ("barrier", *(f"{name}_{part}" for part in PARTS for name in OF_PART))
ITERATIONS = 8  # of Newton's method; five reach 1e-12 of the load where a second contact joins
CLOSED = 1e-12  # m of approach, below which a contact is open: its force is nil, the root has a slope


@cache
def both_parts(track: Track) -> cs.Function:
    """Function (contact_search, shifts of both wheels towards their flanges, m) -> FIELDS of each, a row.

    The fields are those of parts_table, under LOAD, with the radius beyond the nominal one as growth.
    """
    sides = [_curves(track, side) for side in (("left", "left") if track.alike else ("left", "right"))]
    return of_both("both_parts", *sides)


@cache
def _curves(track: Track, side: str) -> cs.Function:
    from fmus.contact.geometry.table import SEARCHES  # loads SciPy and pandas, which other models do without

    curves = [spline_over(search, *_tabulated(track, search, side)) for search in SEARCHES]
    return cs.Function.conditional("parts", curves[:-1], curves[-1])


def _tabulated(track: Track, search: str, side: str) -> tuple[Array, Array]:
    """Shifts (n,) of a wheel towards its flange, m, and FIELDS there (n, 17)."""
    from fmus.contact.geometry.parts_table import parts_table

    shifts = tabulated_shifts(track, search)
    given = loaded(track, search)
    table = parts_table(track.sides, shifts, search, given["N"], given["E"], given["nu"])
    table = table[:: 1 if side == "left" else -1]
    columns = [table[f"barrier_{side}"]]
    for part in PARTS:
        growth = table[f"r_{side}_{part}"] - track.nominal_radius
        columns += [growth if name == "growth" else table[f"{name}_{side}_{part}"] for name in OF_PART]
    return shifts, np.column_stack([np.asarray(c, dtype=float) for c in columns])


@cache
def load_division() -> cs.Function:
    """Function that divides the load of each of two wheels between tread and flange; columns of two.

    Arguments: Q, N; gaps of tread and flange and barrier, m; stiffnesses c of both, N/m^1.5, by which a part
    carries c x^1.5 where it is x lower than it would touch. Results: what tread and flange carry, N, and how
    far both are one patch, from 0 to 1.

    The height of the wheel is found at which both together carry Q. Above the barrier both parts are one
    patch: what they carry from there on is carried once, by each in the share of its depth below the barrier.
    """
    Q, tread, flange, barrier, c_tread, c_flange = (
        cs.SX.sym(n) for n in ("Q", "tread", "flange", "barrier", "c_tread", "c_flange")
    )
    deep = [cs.fmax(barrier - gap, 0.0) + CLOSED for gap in (tread, flange)]
    share = deep[0] / (deep[0] + deep[1])
    height = cs.SX.sym("height")
    joined = _power(height - barrier)
    first = c_tread * (_power(height - tread) - (1 - share) * joined)
    second = c_flange * (_power(height - flange) - share * joined)
    carried = first + second
    slope = cs.gradient(carried, height)
    # the load is nearly the power 3/2 of the height, so that its power 2/3 hardly curves
    step = 1.5 * carried ** (1 / 3) * (carried ** (2 / 3) - Q ** (2 / 3)) / slope
    given = [height, Q, tread, flange, barrier, c_tread, c_flange]
    better = cs.Function("better", given, [cs.fmax(height - step, cs.fmin(tread, flange) + 10 * CLOSED)])
    one = joined / _power(height - cs.fmax(tread, flange))
    ends = cs.Function("ends", given, [first, second, one])
    # the height at which one part alone would carry
    found = cs.fmin(tread + (Q / c_tread) ** (2 / 3), flange + (Q / c_flange) ** (2 / 3))
    for _ in range(ITERATIONS):
        found = better(found, *given[1:])
    return for_two(cs.Function("load_division", given[1:], [*ends(found, *given[1:])]))


def _power(x: Expr) -> Expr:
    """x^1.5, nil where x is negative."""
    closed = cs.fmax(x, CLOSED)
    return closed * cs.sqrt(closed)


def stiffness(approach: Expr, slope: Expr, scale: Expr) -> Expr:
    """By which a contact carries the 3/2 power of how much lower a wheel is, N/m^1.5.

    approach: of the bodies under LOAD, m; slope: of the contact plane over the track, rad; scale: contact
    modulus over that of the tables. The height counts across the plane, and so does the load that is carried.
    """
    across = cs.cos(slope)
    return LOAD * scale * (across / approach) ** 1.5 * across
