"""Linear algebra of small matrices for the filters, compiled if numba is installed, else plain Python.

Functions that run at every step are written as loops that fill given arrays: for matrices of this size, a
library call or the return of an array from compiled code takes longer than the arithmetic.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

import numpy as np

from estimator.record import Array, BoolArray

Function = TypeVar("Function", bound=Callable[..., Any])

try:
    _numba: Any = import_module("numba")
except ImportError:
    _numba = None


def compiled(function: Function) -> Function:
    """The function compiled by numba and cached on disk, or unchanged without numba."""
    made: Function = _numba.njit(cache=True)(function) if _numba else function
    return made


@compiled
def symmetric(P: Array) -> Array:
    """The symmetric part of P (n, n), without asymmetry by rounding."""
    return (P + P.T) * 0.5


@compiled
def factorise(P: Array, L: Array) -> bool:
    """Write the lower Cholesky factor of P (n, n) into L, zero in its upper part; False if there is none."""
    n = len(P)
    for j in range(n):
        square = P[j, j]
        for k in range(j):
            square -= L[j, k] * L[j, k]
        if not 0.0 < square < np.inf:  # also true for nan
            return False
        L[j, j] = np.sqrt(square)
        for i in range(j + 1, n):
            rest = P[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j], L[j, i] = rest / L[j, j], 0.0
    return True


@compiled
def finite(x: Array) -> bool:
    """Whether all values of x (n,) are finite."""
    total = 0.0
    for value in x:
        total += value * 0.0
    return total == 0.0


@compiled
def there(y: Array, found: BoolArray) -> int:
    """Number of measured values in y (m,); the mask of these is written into found (m,)."""
    n = 0
    for i in range(len(y)):
        found[i] = np.isfinite(y[i])
        n += found[i]
    return n


@compiled
def draw(x: Array, factor: Array, scale: float, points: Array) -> None:
    """Write sigma points (2n + 1, n): x, and x plus and minus the columns of a scaled factor (n, n)."""
    n = len(x)
    for j in range(n):
        points[0, j] = x[j]
        for i in range(n):
            points[1 + i, j] = x[j] + scale * factor[j, i]
            points[1 + n + i, j] = x[j] - scale * factor[j, i]


@compiled
def mean(points: Array, weights: Array, x: Array) -> None:
    """Write the weighted mean of points (k, n) into x (n,)."""
    for j in range(len(x)):
        total = 0.0
        for i in range(len(weights)):
            total += weights[i] * points[i, j]
        x[j] = total


@compiled
def cross(A: Array, a: Array, B: Array, b: Array, weights: Array, P: Array) -> None:
    """Write the weighted covariance of points A (k, n) about a and B (k, m) about b into P (n, m)."""
    for i in range(len(a)):
        for j in range(len(b)):
            total = 0.0
            for k in range(len(weights)):
                total += weights[k] * (A[k, i] - a[i]) * (B[k, j] - b[j])
            P[i, j] = total


@compiled
def covariance(points: Array, x: Array, weights: Array, P: Array) -> None:
    """Write the weighted covariance of points (k, n) about x (n,) into P (n, n)."""
    for i in range(len(x)):
        for j in range(i + 1):
            total = 0.0
            for k in range(len(weights)):
                total += weights[k] * (points[k, i] - x[i]) * (points[k, j] - x[j])
            P[i, j] = P[j, i] = total


@compiled
def drawn(x: Array, P: Array, scale: float, L: Array, points: Array) -> bool:
    """Write the factor L of P (n, n) and the sigma points about x (n,); False if either is not valid.

    Nothing is drawn then, and L is undefined.
    """
    if not (factorise(P, L) and finite(x)):
        return False
    draw(x, L, scale, points)
    return True


@compiled
def predict(
    after: Array, Wm: Array, Wc: Array, Q: Array, scale: float,
    L: Array, X: Array, x: Array, P: Array, C: Array,
) -> bool:  # fmt: skip
    """Write the mean x (n,) and covariance P (n, n), with Q added, of weighted points after a step.

    after: (k, n); L: factor with which the points before the step were drawn; C: (n, n) cross-covariance of
    x before and after the step. L and X become those of the prediction, see `drawn`.
    """
    n = len(x)
    mean(after, Wm, x)
    covariance(after, x, Wc, P)
    P += Q
    C[:] = 0.0
    for k in range(n):
        for i in range(n):
            up, down = Wc[1 + k] * scale * L[i, k], Wc[1 + n + k] * scale * L[i, k]
            for j in range(n):
                C[i, j] += up * (after[1 + k, j] - x[j]) - down * (after[1 + n + k, j] - x[j])
    return drawn(x, P, scale, L, X)


@compiled
def expect(seen: Array, Wm: Array, Wc: Array, Y: Array, y: Array, S: Array) -> None:
    """Write the mean y (m,) and covariance S (m, m) of weighted outputs (k, m), which are copied into Y."""
    Y[:] = seen
    mean(Y, Wm, y)
    covariance(Y, y, Wc, S)


@compiled
def solve(L: Array, b: Array) -> None:
    """Replace b (n, m) by the solution x of L L' x = b, by forward and backward substitution."""
    n, m = b.shape
    for i in range(n):
        for k in range(i):
            for j in range(m):
                b[i, j] -= L[i, k] * b[k, j]
        for j in range(m):
            b[i, j] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            for j in range(m):
                b[i, j] -= L[k, i] * b[k, j]
        for j in range(m):
            b[i, j] /= L[i, i]


@compiled
def correct(
    X: Array, x: Array, Y: Array, y: Array, S: Array, used: BoolArray, e: Array, R: Array, Wc: Array,
    scale: float, x1: Array, P1: Array, L: Array,
) -> bool:  # fmt: skip
    """Write the mean x1 (n,) and covariance P1 (n, n) of points X (k, n) corrected by innovations e (m,).

    Y: outputs (k, m) of the points; x, y: means of X and Y; S: (m, m) covariance of e, of which R is the
    measurement noise; used: (m,) the channels that correct. P1 is a sum of squares (Joseph's form). L and X
    become those of the correction, see `drawn`. All are nan or undefined if S is not positive definite.
    """
    if not used.all():
        Y, y, e, S, R = Y[:, used], y[used], e[used], S[used][:, used], R[used][:, used]
    n, m = len(x), len(y)
    root, gain, rest, none = np.empty((m, m)), np.empty((m, n)), np.empty(X.shape), np.empty(n)
    if not factorise(S, root):
        root[:] = np.nan
    cross(Y, y, X, x, Wc, gain)
    solve(root, gain)  # the gain, transposed
    for i in range(n):
        x1[i], none[i] = x[i], 0.0
        for a in range(m):
            x1[i] += gain[a, i] * e[a]
    for k in range(len(X)):
        for i in range(n):
            rest[k, i] = X[k, i] - x[i]
        for a in range(m):
            off = Y[k, a] - y[a]
            for i in range(n):
                rest[k, i] -= gain[a, i] * off
    covariance(rest, none, Wc, P1)
    for a in range(m):
        for b in range(m):
            if R[a, b] != 0.0:  # mostly R is diagonal
                for i in range(n):
                    for j in range(i + 1):
                        P1[i, j] += gain[a, i] * R[a, b] * gain[b, j]
    for i in range(n):
        for j in range(i):
            P1[j, i] = P1[i, j]
    return drawn(x1, P1, scale, L, X)


@compiled
def joseph(x: Array, P: Array, H: Array, e: Array, R: Array) -> tuple[Array, Array]:
    """x (n,), P (n, n) corrected by innovations e (m,) of outputs H x with noise R, in Joseph's form."""
    HP = H @ P
    K = np.linalg.solve(HP @ H.T + R, HP).T
    rest = np.eye(len(x)) - K @ H
    P = rest @ (P @ rest.T) + K @ (R @ K.T)
    return x + K @ e, (P + P.T) * 0.5


@compiled
def log_density(e: Array, S: Array) -> tuple[float, float]:
    """Logarithm of the normal density of e (m,) with covariance S (m, m), and e' S^-1 e.

    The results are -inf and nan if S is not positive definite.
    """
    m = len(e)
    L, x = np.zeros((m, m)), np.empty((m, 1))
    if not factorise(S, L):
        return -np.inf, np.nan
    x[:, 0] = e
    solve(L, x)
    square, size = 0.0, m * np.log(2 * np.pi)
    for i in range(m):
        square += e[i] * x[i, 0]
        size += 2 * np.log(L[i, i])
    return -0.5 * (square + size), square


@compiled
def weigh(
    y: Array, expected: Array, S: Array, R: Array, deviations: float, patience: int,
    innovation: Array, used: BoolArray, gated: BoolArray, rejected: Array,
) -> tuple[int, float, float]:  # fmt: skip
    """Compare outputs y (m,) with those expected: the number of channels used, log_density of these.

    Writes the innovation (m,); adds R to S (m, m); takes gated channels out of `used`. See Gate for
    `deviations` (inf if there is no gate) and `patience`; rejected: (m,) counts that the gate continues.
    """
    n = 0
    S += R
    for i in range(len(y)):
        innovation[i], gated[i] = y[i] - expected[i], False
        if used[i] and deviations < np.inf:
            far = innovation[i] ** 2 > deviations**2 * S[i, i]
            rejected[i] = rejected[i] + 1 if far else 0.0
            gated[i] = far and rejected[i] <= patience
            used[i] = not gated[i]
        n += used[i]
    if n == 0:
        return 0, 0.0, 0.0
    if n < len(y):
        likelihood, nis = log_density(innovation[used], S[used][:, used])
    else:
        likelihood, nis = log_density(innovation, S)
    return n, likelihood, nis
