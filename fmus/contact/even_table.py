"""Rows of a table over evenly spaced places, found by their number: nothing is searched."""

import casadi as cs

from fmus.contact.arguments import Array
from fmus.variables import Expr


def rows_from(table: Array, number: Expr, count: int) -> Expr:
    """`count` rows one after the other, as a column, of a table (n, k) from the row of that number on.

    number: an MX scalar from 0 to n - count, whole; it must have been bounded.
    """
    width = table.shape[1]
    return cs.MX(cs.DM(table.ravel())).get_nz(False, cs.Slice(0, count * width), number * width)
