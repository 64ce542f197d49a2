"""Sobol's indices of a campaign: which share of a result's variance each varied key causes."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import DegenerateDataWarning, sobol_indices

CONFIDENCE = 0.95
RESAMPLES = 999
FEWEST = 4  # complete base points, from which indices are computed
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Index:
    """Indices of one key for one measure, with 95 % intervals.

    first: share of the variance that the key causes alone; total: together with all others. used: base points
    at which every simulation gave a number, of which the indices are made.
    """

    measure: str
    key: str
    first: float
    first_low: float
    first_high: float
    total: float
    total_low: float
    total_high: float
    used: int


def indices_of(measure: str, keys: Sequence[str], values: Array, seed: int) -> list[Index]:
    """Indices from the values (n (k + 2),) at the points of `sampling`; none if too few or all alike.

    By the estimators of A. Saltelli et al. (Computer Physics Communications 181 (2010), 259-270) in SciPy,
    with
    bootstrap intervals over the base points, bias-corrected and accelerated. A base point that has no value
    in one of its simulations is left out as a whole.
    """
    k = len(keys)
    table = values.reshape(k + 2, -1)
    used = np.isfinite(table).all(axis=0)
    a, b, *mixed = table[:, used]
    if used.sum() < FEWEST or not np.ptp(np.concatenate([a, b])) > 0:
        return []
    func = {"f_A": a[None], "f_B": b[None], "f_AB": np.array(mixed)[:, None]}
    found = sobol_indices(func=func, n=int(used.sum()), rng=np.random.default_rng(seed))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DegenerateDataWarning)  # a key that changes nothing at all
        spread = found.bootstrap(confidence_level=CONFIDENCE, n_resamples=RESAMPLES)
    first, total = spread.first_order.confidence_interval, spread.total_order.confidence_interval
    value = [np.asarray(x, dtype=np.float64).reshape(k) for x in (found.first_order, found.total_order)]
    columns = [value[0], first.low, first.high, value[1], total.low, total.high]
    flat = [np.asarray(c, dtype=np.float64).reshape(k) for c in columns]
    flat = [np.where(np.isfinite(c), c, value[i // 3]) for i, c in enumerate(flat)]  # all resamples alike
    return [
        Index(measure, key, *(float(c[i]) for c in flat), used=int(used.sum())) for i, key in enumerate(keys)
    ]
