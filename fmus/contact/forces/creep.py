"""Creep forces of arrays of contacts: the laws that the FMUs use, compiled once and mapped."""

from functools import lru_cache
from operator import index

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from fmus.contact.arguments import (
    NOT_NEGATIVE,
    POSITIVE,
    Number,
    Rule,
    between,
    broadcast,
    checked,
    mapped,
)
from fmus.contact.forces.coefficients import Kalker, kalker
from fmus.contact.forces.laws import LAWS
from fmus.contact.forces.laws.fastsim import Fastsim, Grid
from fmus.contact.forces.laws.law import ARGUMENTS
from fmus.errors import did_you_mean

CREEPAGE = between(-1e100, 1e100)  # squares stay finite
RULES: dict[str, tuple[str, Rule]] = {
    **dict.fromkeys(("a", "b"), ("m", POSITIVE)),
    "N": ("N", NOT_NEGATIVE),
    "mu": ("1", NOT_NEGATIVE),
    "G": ("Pa", POSITIVE),
    "nu": ("1", between(0.0, 0.5)),
    **dict.fromkeys(("xi_x", "xi_y"), ("1", CREEPAGE)),
    "xi_s": ("1/m", CREEPAGE),
    **dict.fromkeys(("k_A", "k_S"), ("1", NOT_NEGATIVE)),
}


def creep_forces(
    law: str,
    a: ArrayLike,
    b: ArrayLike,
    N: ArrayLike,
    mu: ArrayLike,
    G: ArrayLike,
    nu: ArrayLike,
    xi_x: ArrayLike,
    xi_y: ArrayLike,
    xi_s: ArrayLike,
    *,
    n: Grid = (20, 20),
    k_A: ArrayLike = 1.0,
    k_S: ArrayLike = 1.0,
) -> tuple[Number, Number, Number]:
    """Creep forces F_x, F_y, N, and moment M_z, N.m, on the wheel in an elliptical contact.

    law: "linear", "shen", "fastsim", "polach_no_spin" or "polach". Floats or arrays that broadcast:
    a, b: semi-axes along and across rolling, m, > 0; N: normal force, N; mu: friction coefficient;
    G: shear modulus, Pa; nu: Poisson's ratio, 0 to 0.5; xi_x, xi_y: creepages; xi_s: spin, 1/m.
    n: FASTSIM's cells along and strips across; k_A, k_S: Polach's factors for adhesion and slip, k_S at
    most k_A, as Polach's force would exceed mu N otherwise.
    Forces oppose creep. ValueError names a wrong argument. Sources: README.md beside this file.
    """
    function = _function(law, _cells(n))
    values = (a, b, N, mu, G, nu, xi_x, xi_y, xi_s, k_A, k_S)
    given = {
        name: checked(name, unit, value, rule)
        for (name, (unit, rule)), value in zip(RULES.items(), values, strict=True)
    }
    shape = broadcast(**given)["a"].shape
    if np.any(given["k_S"] > given["k_A"]):
        raise ValueError("k_S must not exceed k_A, beyond which Polach's force exceeds mu N")
    coefficients = kalker(given["a"] / given["b"], given["nu"])
    given |= {name: np.asarray(c) for name, c in zip(Kalker._fields, coefficients, strict=True)}
    F_x, F_y, M_z = mapped(function, [given[name] for name in ARGUMENTS], shape)
    return F_x, F_y, M_z


def _cells(n: Grid) -> Grid:
    """FASTSIM's grid, checked."""
    try:
        cells, strips = (index(k) for k in n)
    except (TypeError, ValueError):
        raise ValueError(f"n must be two whole numbers, cells along and strips across, not {n!r}") from None
    if cells < 1 or strips < 1:
        raise ValueError(f"n must be 1 or greater in both directions, found {n!r}")
    return cells, strips


@lru_cache(maxsize=16)
def _function(law: str, n: Grid) -> cs.Function:
    if law not in LAWS:
        raise ValueError(f"law '{law}' is not known; {did_you_mean(str(law), LAWS)}")
    made = Fastsim(n) if law == Fastsim.name else LAWS[law]()
    return made.function()
