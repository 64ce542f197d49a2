"""The small matrices of the filters: compiled where numba is installed, the same text in numpy where not."""

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

import numpy as np

from estimator.record import Array

Function = TypeVar("Function", bound=Callable[..., Any])

try:
    _numba: Any = import_module("numba")
except ImportError:
    _numba = None


def compiled(function: Function) -> Function:
    """The function as machine code, kept on disk, or as it is."""
    made: Function = _numba.njit(cache=True)(function) if _numba else function
    return made


@compiled
def symmetric(P: Array) -> Array:
    """P (n, n) without the rounding that makes it lopsided."""
    return (P + P.T) * 0.5


@compiled
def cholesky(P: Array) -> Array:
    """The lower factor of P (n, n); LinAlgError where there is none."""
    factor: Array = np.linalg.cholesky(P)  # type: ignore[assignment]
    return factor


@compiled
def drawn(x: Array, factor: Array, scale: float) -> Array:
    """Points (2n + 1, n): x, and x plus and minus the columns of a scaled factor (n, n)."""
    n = len(x)
    points = np.empty((2 * n + 1, n))
    points[0] = x
    for i in range(n):
        points[1 + i] = x + scale * factor[:, i]
        points[1 + n + i] = x - scale * factor[:, i]
    return points


@compiled
def moments(points: Array, Wm: Array, Wc: Array, noise: Array) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of weighted points (k, n), with a covariance (n, n) added."""
    mean = Wm @ points
    off = points - mean
    P = off.T @ (Wc.reshape(-1, 1) * off)
    return mean, (P + P.T) * 0.5 + noise


@compiled
def cross(Wc: Array, A: Array, a: Array, B: Array, b: Array) -> Array:
    """Covariance (n, m) of weighted points A (k, n), B (k, m) about a (n,), b (m,)."""
    return (A - a).T @ (Wc.reshape(-1, 1) * (B - b))


@compiled
def corrected(
    Wc: Array, X: Array, x: Array, Y: Array, y: Array, S: Array, e: Array, R: Array
) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of points X (k, n) after innovations e (m,) of their outputs Y (k, m).

    x (n,), y (m,) are their means, S (m, m) the covariance of e, in which R (m, m) is noise. Joseph's form:
    a sum of squares.
    """
    K = np.linalg.solve(S, (Y - y).T @ (Wc.reshape(-1, 1) * (X - x))).T
    rest = (X - x) - (Y - y) @ K.T
    P = rest.T @ (Wc.reshape(-1, 1) * rest) + K @ (R @ K.T)
    return x + K @ e, (P + P.T) * 0.5


@compiled
def joseph(x: Array, P: Array, H: Array, e: Array, R: Array) -> tuple[Array, Array]:
    """x (n,), P (n, n) corrected by innovations e (m,) of outputs H x with noise R, as a sum of squares."""
    HP = H @ P
    K = np.linalg.solve(HP @ H.T + R, HP).T
    rest = np.eye(len(x)) - K @ H
    P = rest @ (P @ rest.T) + K @ (R @ K.T)
    return x + K @ e, (P + P.T) * 0.5


@compiled
def log_density(e: Array, S: Array) -> tuple[float, float]:
    """Logarithm of the normal density of e (m,) with covariance S (m, m), and e' S^-1 e."""
    square = float(np.sum(e * np.linalg.solve(S, e)))
    sign, size = np.linalg.slogdet(S)
    if sign <= 0:
        return -np.inf, square
    return -0.5 * (square + float(size) + len(e) * np.log(2 * np.pi)), square
