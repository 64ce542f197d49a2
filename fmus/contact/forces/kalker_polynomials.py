"""Kalker's creep coefficients by the polynomials of the thesis, appendix A.

Read with r = a/b (the print has b/a), and with the root of c11 and c22 over r alone: so they are his table
to 2 %, c23 to 6 % (at nu = 0 to 19 % at a/b = 0.1); c33 goes with r = b/a, to 7 %.
"""

import casadi as cs

from fmus.variables import Expr

# rows k1 to k4, columns 1, nu, nu²
K11 = (
    (2.3464, 1.5443, 7.9577),
    (0.961669, -0.043513, 2.402357),
    (-0.0160185, 0.0055475, -0.0741104),
    (0.10563, 0.61285, -7.26904),
)
K22 = (
    (2.34641, -0.27993, 0.19763),
    (0.96167, 0.52684, 1.22642),
    (-0.0160185, -0.0126292, -0.0011272),
    (0.10563, 0.78197, -1.12348),
)
K23 = (
    (0.29677, 0.22524, 0.71899),
    (1.01321, 0.20407, -0.72375),
    (0.0092415, 0.0854262, 0.319940),
    (8.4835e-4, -3.211e-3, -1.7484e-2),
)
K33 = (
    (0.72795, -1.00202, -0.32695),
    (0.461755, 1.002340, 0.081441),
    (0.023739, -0.110640, 0.249008),
    (-0.0012999, 0.0063653, -0.0129114),
)


def polynomials(a_over_b: Expr, nu: Expr) -> list[Expr]:
    """c11, c22, c23, c33 for a/b from 0.1 to 10."""

    def combined(k: tuple[tuple[float, ...], ...], *powers: Expr) -> Expr:
        return sum((k0 + k1 * nu + k2 * nu**2) * power for (k0, k1, k2), power in zip(k, powers, strict=True))

    r, q = a_over_b, 1 / a_over_b
    return [
        combined(K11, 1, r, r**2, cs.sqrt(r)),
        combined(K22, 1, r, r**2, cs.sqrt(r)),
        combined(K23, 1, r, r**2, r**3),
        combined(K33, 1, q, q**2, q**3),
    ]
