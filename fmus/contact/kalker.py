"""Kalker's creep coefficients as CasADi expressions of the contact ellipse, from his table of 1990."""

from functools import cache
from pathlib import Path

import casadi as cs
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from fmus.variables import Expr

TABLE = Path(__file__).with_name("kalker_1990.csv")
NU = (0.0, 0.25, 0.5)  # Poisson's ratios of the table


def coefficient(name: str, a_over_b: Expr, nu: Expr) -> Expr:
    """Creep coefficient c11, c22, c23 or c33, dimensionless.

    Linear in a/b between the table's rows, quadratic in nu through its three columns;
    beyond a/b of 0.1 to 10 the nearest row holds.
    """
    ratio, values = _columns(name)
    inside = cs.fmin(cs.fmax(a_over_b, ratio[0]), ratio[-1])
    # a broken line is a sum of ramps, one from each row on; the three columns share them
    ramps = cs.vertcat(*(cs.fmax(inside - r, 0) for r in ratio[:-1]))
    bends = np.diff(np.diff(values, axis=0) / np.diff(ratio)[:, None], axis=0, prepend=0.0)
    c = [values[0, j] + cs.dot(bends[:, j], ramps) for j in range(len(NU))]
    t = nu / NU[1]
    return c[0] + t * (c[1] - c[0]) + t * (t - 1) / 2 * (c[2] - 2 * c[1] + c[0])


@cache
def _columns(name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows a/b (n,) and the coefficient at each row and Poisson's ratio (n, 3)."""
    table = pd.read_csv(TABLE, comment="#").pivot(index="a_over_b", columns="nu", values=name)
    return table.index.to_numpy(), table[list(NU)].to_numpy()
