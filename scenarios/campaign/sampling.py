"""Points of a campaign: a grid, a Latin hypercube, or the pairs of Sobol's points that his indices need.

The points of SciPy's quasi-Monte Carlo are in the unit cube; each range makes a value of its coordinate.
"""

from collections.abc import Mapping
from itertools import product
from math import exp, floor, log, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from fmus.errors import BadInput
from scenarios.campaign.declaration import Declaration, Range

Array = NDArray[np.float64]
BITS = 64  # of Sobol's sequence, so that no two points coincide
MOST = 1_000_000  # points, which are planned in memory and kept in a file each
INSIDE = 2.0**-53  # keeps a coordinate within the open interval, where the normal distribution is finite
Point = dict[str, Any]


def points_of(d: Declaration) -> list[Point]:
    """The values of all varied keys at each point, in the order of the rows of the result.

    For "sobol" the points A (n), B (n), then for each key the points of A with this key's values of B (n).
    Raises BadInput, before any is made, for more points than MOST.
    """
    if (count := _count(d)) > MOST:
        asked = str(count) if count < 10**15 else "more than 10^15"
        raise BadInput(f"asks for {asked} points, and {MOST} are the most; vary fewer keys, or lower 'n'")
    if d.sample == "grid":
        axes = [_axis(r) for r in d.vary.values()]
        return [dict(zip(d.vary, values, strict=True)) for values in product(*axes)]
    rng, k, n = np.random.default_rng(d.seed), len(d.vary), d.n or 0
    if d.sample == "latin-hypercube":
        return _values(qmc.LatinHypercube(d=k, rng=rng).random(n), d.vary)
    unit = qmc.Sobol(d=2 * k, bits=BITS, rng=rng).random(n)
    a, b = unit[:, :k], unit[:, k:]
    mixed = [np.where(np.arange(k) == i, b, a) for i in range(k)]
    return _values(np.concatenate([a, b, *mixed]), d.vary)


def _count(d: Declaration) -> int:
    """How many points there are."""
    if d.sample == "grid":
        return prod(_size(r) for r in d.vary.values())
    return (d.n or 0) * (len(d.vary) + 2 if d.sample == "sobol" else 1)


def _size(r: Range) -> int:
    """How many values of a range a grid has."""
    if r.values is not None:
        return len(r.values)
    return int(r.high or 0) - int(r.low or 0) + 1 if r.whole else r.points or 2


def _values(unit: Array, vary: Mapping[str, Range]) -> list[Point]:
    """Values of points in the unit cube (N, k)."""
    return [{name: value_at(r, u) for (name, r), u in zip(vary.items(), row, strict=True)} for row in unit]


def value_at(r: Range, u: float) -> Any:
    """The value of a range below which a share u of it lies, 0 <= u < 1."""
    if r.values is not None:
        return r.values[floor(u * len(r.values))]
    if r.mean is not None and r.std is not None:
        return float(norm.ppf(min(max(u, INSIDE), 1 - INSIDE), r.mean, r.std))
    low, high = r.low or 0.0, r.high or 0.0
    if r.whole:
        return floor(low + u * (high - low + 1))
    if r.scale == "log":
        return exp(log(low) + float(u) * (log(high) - log(low)))
    return low + float(u) * (high - low)


def _axis(r: Range) -> list[Any]:
    """The values of a range in a grid."""
    if r.values is not None:
        return list(r.values)
    low, high = r.low or 0.0, r.high or 0.0
    if r.whole:
        return list(range(int(low), int(high) + 1))
    space = np.geomspace if r.scale == "log" else np.linspace
    return [float(x) for x in space(low, high, r.points or 2)]
