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
            L[i, j] = rest / L[j, j]
    return True


@compiled
def finite(x: Array) -> bool:
    """Whether all values of x (n,) are finite."""
    return not np.isnan(np.sum(x * 0.0))


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
    P[:] = 0.0
    for k in range(len(weights)):
        for i in range(len(a)):
            off = weights[k] * (A[k, i] - a[i])
            for j in range(len(b)):
                P[i, j] += off * (B[k, j] - b[j])


@compiled
def predict(
    before: Array, x0: Array, after: Array, Wm: Array, Wc: Array, Q: Array, x: Array, P: Array, C: Array
) -> None:
    """Write the mean x (n,) and covariance P (n, n), with Q added, of weighted points after a step.

    before, after: points (k, n) about x0 before and after the step; C: (n, n) their cross-covariance.
    """
    mean(after, Wm, x)
    cross(after, x, after, x, Wc, P)
    P += Q
    cross(before, x0, after, x, Wc, C)


@compiled
def expect(Y: Array, Wm: Array, Wc: Array, y: Array, S: Array) -> None:
    """Write the mean y (m,) and covariance S (m, m) of weighted outputs Y (k, m)."""
    mean(Y, Wm, y)
    cross(Y, y, Y, y, Wc, S)


@compiled
def solve(L: Array, b: Array) -> None:
    """Replace b (n, m) by the solution x of L L' x = b, by forward and backward substitution."""
    n = len(L)
    for j in range(b.shape[1]):
        for i in range(n):
            rest = b[i, j]
            for k in range(i):
                rest -= L[i, k] * b[k, j]
            b[i, j] = rest / L[i, i]
        for i in range(n - 1, -1, -1):
            rest = b[i, j]
            for k in range(i + 1, n):
                rest -= L[k, i] * b[k, j]
            b[i, j] = rest / L[i, i]


@compiled
def correct(
    Wc: Array, X: Array, x: Array, Y: Array, y: Array, S: Array, e: Array, R: Array, x1: Array, P1: Array
) -> None:
    """Write the mean x1 (n,) and covariance P1 (n, n) of points X (k, n) corrected by innovations e (m,).

    Y: outputs (k, m) of the points; x, y: means of X and Y; S: (m, m) covariance of e, of which R is the
    measurement noise. P1 is a sum of squares (Joseph's form). Both are nan if S is not positive definite.
    """
    n, m = len(x), len(y)
    L, gain, rest, none = np.zeros((m, m)), np.empty((m, n)), np.empty(X.shape), np.zeros(n)
    if not factorise(S, L):
        L[:] = np.nan
    cross(Y, y, X, x, Wc, gain)
    solve(L, gain)  # the gain, transposed
    for i in range(n):
        x1[i] = x[i]
        for a in range(m):
            x1[i] += gain[a, i] * e[a]
        for k in range(len(X)):
            rest[k, i] = X[k, i] - x[i]
            for a in range(m):
                rest[k, i] -= gain[a, i] * (Y[k, a] - y[a])
    cross(rest, none, rest, none, Wc, P1)
    for i in range(n):
        for j in range(i + 1):
            for a in range(m):
                for b in range(m):
                    P1[i, j] += gain[a, i] * R[a, b] * gain[b, j]
            P1[j, i] = P1[i, j]


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
