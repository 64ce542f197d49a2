"""Rauch-Tung-Striebel smoother for the estimates of any filter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.filters.algebra import symmetric
from estimator.filters.estimator import Estimate
from estimator.record import Array


@dataclass(frozen=True)
class Smoothed:
    """Estimates at each sample from the whole record."""

    t: Array  # (N,) s
    x: Array  # (N, n)
    P: Array  # (N, n, n)


def smoothed(estimates: Sequence[Estimate]) -> Smoothed:
    """Smoothed estimates by a backward pass over the successive estimates of a filter.

    The smoother is exact for a linear system. For a UKF it is the unscented smoother of Särkkä, IEEE Trans.
    Autom. Control 53 (2008) 845, which takes the covariances over a step from its sigma points.
    """
    t = np.array([e.t for e in estimates])
    x = np.array([e.x for e in estimates])
    P = np.array([e.P for e in estimates])
    if len(estimates) > 1:
        prior, C = (np.array([getattr(e, part) for e in estimates[1:]]) for part in ("P_prior", "C"))
        gains = np.linalg.solve(prior, C.transpose(0, 2, 1)).transpose(0, 2, 1)
    for k in range(len(estimates) - 2, -1, -1):
        G, after = gains[k], estimates[k + 1]
        x[k] = x[k] + G @ (x[k + 1] - after.x_prior)
        P[k] = symmetric(P[k] + G @ (P[k + 1] - after.P_prior) @ G.T)
    return Smoothed(t, x, P)
