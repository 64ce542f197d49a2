"""The normal problem of rolling contact: Hertz's ellipse, and Linder's by virtual penetration."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, elliprf

from fmus.contact.arguments import (
    NOT_NEGATIVE,
    POSITIVE,
    Array,
    Number,
    between,
    broadcast,
    checked,
    plain,
)

LINDER = 0.55  # virtual penetration over approach, Linder 1997; Piotrowski & Kik 2008
NEAR_CIRCLE = 1e-5  # of 1 - (b/a)², below it the slope of Newton's method is that of the circle
ITERATIONS = 8  # of Newton's method; five reach 1e-15 for A/B from 1e-6 to 1e6


def hertz(
    A: ArrayLike, B: ArrayLike, N: ArrayLike, E: ArrayLike, nu: ArrayLike
) -> tuple[Number, Number, Number, Number]:
    """Contact ellipse of two bodies of one material whose surfaces lie A x² + B y² apart.

    A, B: 1/m, along and across rolling, > 0; N: normal force, N; E: Young's modulus, Pa; nu: Poisson's
    ratio, above -1. Floats or arrays that broadcast.
    Returns (a, b, delta, p0): semi-axes along and across rolling, m; approach of the bodies, m; pressure
    in the centre, Pa. Exact to rounding, by Carlson's integrals. ValueError names a wrong argument.
    Source: Johnson, Contact Mechanics, 1985, section 4.2.
    """
    given = broadcast(
        A=checked("A", "1/m", A, POSITIVE),
        B=checked("B", "1/m", B, POSITIVE),
        N=checked("N", "N", N, NOT_NEGATIVE),
        E=checked("E", "Pa", E, POSITIVE),
        nu=checked("nu", "1", nu, between(-0.999, 0.5)),
    )
    flat, steep = np.minimum(given["A"], given["B"]), np.maximum(given["A"], given["B"])
    E_star = given["E"] / (2 * (1 - given["nu"] ** 2))
    k = _axis_ratio(flat / steep)
    R_D = elliprd(0, k**2, 1)
    major = np.cbrt(given["N"] * R_D / (2 * np.pi * E_star * flat))
    delta = 3 * flat * major**2 * elliprf(0, k**2, 1) / R_D
    p0 = 3 * E_star * flat * major / (k * R_D)
    along = given["A"] <= given["B"]  # the ellipse is long where the surfaces part slowly
    a, b = np.where(along, major, k * major), np.where(along, k * major, major)
    return plain(a), plain(b), plain(np.asarray(delta)), plain(np.asarray(p0))


def virtual_penetration(A: ArrayLike, B: ArrayLike, delta: ArrayLike) -> tuple[Number, Number]:
    """Semi-axes (a, b), m, of the area where bodies that approach by delta, m, penetrate by 0.55 delta.

    A, B: 1/m, along and across rolling, > 0. ValueError names a wrong argument. Source: thesis eq. 3.43.
    """
    given = broadcast(
        A=checked("A", "1/m", A, POSITIVE),
        B=checked("B", "1/m", B, POSITIVE),
        delta=checked("delta", "m", delta, NOT_NEGATIVE),
    )
    a, b = (np.sqrt(LINDER * given["delta"] / given[name]) for name in ("A", "B"))
    return plain(a), plain(b)


def _axis_ratio(curvatures: Array) -> Array:
    """Minor over major semi-axis, 0 < k <= 1, for the smaller over the larger of A and B.

    Newton's method on the logarithms, between which the relation is nearly straight (slope 1.5 to 2).
    """
    log_k = 2 / 3 * np.log(curvatures)
    for _ in range(ITERATIONS):
        x = np.exp(2 * log_k)
        flat, steep = elliprd(0, x, 1), elliprd(0, 1, x)
        apart = np.maximum(1 - x, NEAR_CIRCLE)
        slope = 3 - (steep - flat) / apart * (x / flat + 1 / steep)
        slope = np.where(1 - x > NEAR_CIRCLE, slope, 1.5)
        log_k = np.minimum(log_k - (np.log(flat / steep) - np.log(curvatures)) / slope, 0.0)
    return np.asarray(np.exp(log_k))
