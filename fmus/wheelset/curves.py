"""The contact of one wheel over its shift towards the flange, as one CasADi function.

The left wheel is at the wheelset's shift, the right one at the shift with its sign turned. Sides that are
alike share one function.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import casadi as cs
import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.even_table import rows_from
from fmus.wheelset.track import Track

G, NU, LOAD = 8e10, 0.28, 55e3  # Pa, 1, N: the patches are tabulated for these and scale from here
E = 2 * G * (1 + NU)
SPACING = 5e-5  # m between tabulated shifts
CUBIC = 3
USUAL = 3e-3  # m of shift, within which wheelsets run on straight track
PATCH = ("a_hertz", "b_hertz", "a_virtual", "b_virtual")
FIELDS = ("growth", "delta", "lift", *PATCH, "lift_slope")


@cache
def contact_curves(track: Track, side: str = "left") -> cs.Function:
    """Function (contact_search, shift of a wheel towards its flange, m) -> column of FIELDS.

    growth: rolling radius less the nominal one, m; delta: contact angle, rad; lift: height, m, by which
    the wheel carries its side, and lift_slope its derivative; a, b: semi-axes, m, by Hertz and by virtual
    penetration, for LOAD, G and NU. Cubic B-splines, twice continuously differentiable. Beyond the table
    the last contact holds.
    """
    from fmus.contact.geometry.table import SEARCHES  # loads SciPy and pandas, which other models do without

    if side != "left" and track.alike:
        return contact_curves(track)
    curves = [
        spline_over(search, *_tabulated(track, search, side), [FIELDS.index("lift")]) for search in SEARCHES
    ]
    return cs.Function.conditional("contact", curves[:-1], curves[-1])


@cache
def both_contacts(track: Track) -> cs.Function:
    """Function (contact_search, shifts of both wheels towards their flanges, m) -> FIELDS of each, a row."""
    return of_both("both_contacts", contact_curves(track), contact_curves(track, "right"))


def of_both(name: str, left: cs.Function, right: cs.Function) -> cs.Function:
    """Function (contact_search, shifts of both wheels) -> rows of what a function of each shift gives."""
    search, shifts = cs.MX.sym("search"), cs.MX.sym("shifts", 2)
    each = [curves(search, shifts[i]).T for i, curves in enumerate((left, right))]
    return cs.Function(name, [search, shifts], [cs.vertcat(*each)])


@cache
def usual_patch(track: Track) -> cs.Function:
    """Function (contact_search) -> geometric means of PATCH over the USUAL shifts, and their reciprocals.

    A column for each of PATCH, with one row for both sides where these are alike, else with one for each.
    """
    from fmus.contact.geometry.table import SEARCHES  # as above

    sides = ("left",) if track.alike else ("left", "right")
    means = []
    for search in SEARCHES:
        mean = np.array([_usual(*_tabulated(track, search, side)) for side in sides])
        means.append(cs.Function("means", [], [cs.DM(mean), cs.DM(1 / mean)]))
    return cs.Function.conditional("usual_patch", means[:-1], means[-1])


def _usual(shifts: Array, values: Array) -> Array:
    usual = values[np.abs(shifts) <= USUAL, FIELDS.index(PATCH[0]) :]
    return np.asarray(np.exp(np.log(usual).mean(axis=0)))


def spline_over(name: str, shifts: Array, values: Array, sloped: Sequence[int] = ()) -> cs.Function:
    """Function of a shift, m -> a column of the values (n, k) tabulated over shifts (n,) SPACING apart.

    Then follow the slopes of the columns `sloped`.
    """
    # one row more at each end, so that the outermost shifts too have their full share of the basis
    rows = _spline_coefficients(np.vstack([values[0], values, values[-1]]))
    q = cs.MX.sym("q")
    number, t, rate = _place(shifts)(q)
    found = _spline(rows.shape[1], tuple(sloped))(rows_from(rows, number, CUBIC + 1), t, rate)
    return cs.Function(name, [q], [found], ["shift"], ["contact"])


def _place(shifts: Array) -> cs.Function:
    """Function of a shift -> (number of its interval in the table, how far along it, change by shift)."""
    q = cs.SX.sym("q")
    inside = cs.fmin(cs.fmax(q, shifts[0]), shifts[-1])
    place = (inside - shifts[0]) * (1 / SPACING)
    rate = cs.if_else(q == inside, 1 / SPACING, 0)
    number = cs.fmin(cs.floor(place), len(shifts) - 2)
    return cs.Function("place", [q], [number, place - number, rate])


def _spline(width: int, sloped: tuple[int, ...]) -> cs.Function:
    """Function (four rows of coefficients, place t between 0 and 1, dt/dq) -> values, slopes of some."""
    rows, t, rate = cs.SX.sym("rows", width, CUBIC + 1), cs.SX.sym("t"), cs.SX.sym("rate")
    s = 1 - t
    basis = cs.vertcat(s**3, 4 - 3 * t**2 * (1 + s), 4 - 3 * s**2 * (1 + t), t**3) * (1 / 6)
    slopes = [cs.mtimes(rows[i, :], cs.jacobian(basis, t)) * rate for i in sloped]
    found = cs.cse(cs.vertcat(cs.mtimes(rows, basis), *slopes))
    return cs.Function("spline", [cs.vec(rows), t, rate], [found])


def _spline_coefficients(rows: Array) -> Array:
    """Coefficients of cubic B-splines through tabulated rows (n, k), as near as goes without overshoot.

    A row less a sixth of its second difference is exact to the fourth order; where neighbours disagree on
    that difference by more than twice, as about a jump or a kink of a rigid contact, the least counts.
    """
    bend = np.zeros_like(rows)
    bend[1:-1] = np.diff(rows, 2, axis=0)
    three = np.stack([bend[1:-1], 2 * bend[:-2], 2 * bend[2:]])
    agree = (np.sign(three) == np.sign(three[0])).all(axis=0)
    found = rows.copy()
    found[1:-1] -= np.where(agree, np.sign(three[0]) * np.abs(three).min(axis=0), 0.0) / 6
    return found


def tabulated_shifts(track: Track, search: str) -> Array:
    """Shifts (n,), m, SPACING apart, over which the contacts of a track are tabulated."""
    from fmus.contact.geometry.table import contact_table

    steps = int(contact_table(**loaded(track, search)).index[-1] / SPACING)
    return np.asarray(SPACING * np.arange(-steps, steps + 1), dtype=float)


def loaded(track: Track, search: str) -> dict[str, Any]:
    """Arguments of contact_table for a track under LOAD."""
    return {**track.stands, "N": LOAD, "search": search, "E": E, "nu": NU}


def _tabulated(track: Track, search: str, side: str) -> tuple[Array, Array]:
    """Shifts (n,) of a wheel towards its flange, m, and FIELDS without the slope there (n, 7)."""
    from fmus.contact.geometry.table import contact_table
    from fmus.contact.normal import hertz, virtual_penetration

    shifts, sign = tabulated_shifts(track, search), 1 if side == "left" else -1
    table = contact_table(**loaded(track, search), shifts=shifts)[::sign]
    A, B = table[f"A_{side}"].to_numpy(), table[f"B_{side}"].to_numpy()
    virtual = virtual_penetration(A, B, hertz(A, B, LOAD, E, NU)[2])
    columns = (
        table[f"r_{side}"] - track.nominal_radius,
        table[f"delta_{side}"],
        table["z"] + sign * track.half_distance * table["phi"],
        table[f"a_{side}"],
        table[f"b_{side}"],
        *virtual,
    )
    return shifts, np.column_stack([np.asarray(c, dtype=float) for c in columns])
