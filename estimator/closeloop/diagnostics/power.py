"""The power statement: the smallest effect of each kind and place that a record would have shown.

Shown: the test for a discrepancy would have called it more than noise, at its level and with POWER. From
the sensitivities of the screening, so to first order, and for effects that last through the identify part
with the shape (gap, time, order ...) named. Whether such an effect would also matter is another question.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.stats import norm

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.regressors import (
    Calibration,
    Changes,
    alike,
    columns_of,
    is_wave,
    lengths,
)
from estimator.record import Array
from estimator.sensor_faults import FAULTS
from fmus.effects.parameter_effect import SMALL

POWER = 0.8
DRAWS = 4000  # of noise, from which the threshold of the largest of all directions is found
ROWS = 2000  # random sums that stand for a long regressor
WITHIN_LIMITS = ("parameter_offset", "parameter_step")  # a drift ends at the limits, at any rate
PHASES = 90  # of a sine and a cosine, of which the least visible counts


@dataclass(frozen=True)
class Visible:
    """The smallest amplitude of a kind at a place that would have been shown, in the parameter's unit.

    parameter: its name, "amplitude" for a sine and a cosine together; smallest: in the shape that shows
    most, which `shape` holds; largest: in the one that shows least; inf where none could be shown.
    """

    kind: str
    location: str
    parameter: str
    smallest: float
    largest: float
    shape: dict[str, float]


def power(
    base: Fit,
    change: Changes,
    level: float,
    rng: np.random.Generator,
    chance: float = POWER,
    room: Mapping[str, float] = MappingProxyType({}),
) -> list[Visible]:
    """The statement for every candidate with its changes, sorted by kind and location.

    base: of the calibrated FMU, residuals weighted so that noise is one; level: probability that noise
    alone is called an effect, any of them; chance: that the effect is shown; room: the largest change of
    a parameter that its limits leave, by name.
    """
    calibration = Calibration.of(base)
    left = lengths(calibration, change)
    cosines = alike(calibration, change, ROWS, rng)
    needed = threshold(cosines, level, rng) + float(norm.ppf(chance))
    found: dict[tuple[str, str, str], Visible] = {}
    for (c, _), at in zip(change, columns_of(change), strict=True):
        for name, size in _sizes(c, left[at], cosines[at, at], needed, room):
            one = Visible(c.kind, c.location, name, size, size, _shape(c))
            key = (c.kind, c.location, name)
            found[key] = _both(found[key], one) if key in found else one
    return [found[key] for key in sorted(found)]


def threshold(cosines: Array, level: float, rng: np.random.Generator) -> float:
    """What the largest projection of white noise on any of these directions exceeds with this probability.

    cosines: (K, K) between the directions.
    """
    if not len(cosines):
        return float(norm.isf(level / 2))
    values, vectors = np.linalg.eigh(cosines)
    kept = values > 1e-9 * values[-1]
    root = vectors[:, kept] * np.sqrt(values[kept])
    drawn = np.abs(rng.standard_normal((DRAWS, root.shape[1])) @ root.T).max(axis=1)
    return float(np.quantile(drawn, 1 - level))


def _sizes(
    c: Candidate, left: Array, cosines: Array, needed: float, room: Mapping[str, float]
) -> list[tuple[str, float]]:
    """Smallest amplitude by name, inf beyond what it can be; of a wave in the phase that shows least."""
    scale = np.array([u.scale for u in c.amplitudes])
    if is_wave(c):
        angles = np.linspace(0, np.pi, PHASES, endpoint=False)
        parts = np.vstack([np.cos(angles), np.sin(angles)]) * (left / scale)[:, None]
        shown = np.abs(cosines @ parts).max(axis=0).min()  # on the better of both directions
        return [("amplitude", float(needed / shown) if shown > 0 else np.inf)]
    sizes = np.where(left > 0, needed * scale / np.where(left > 0, left, 1.0), np.inf)
    return [
        (_name(c, u), float(size) if size <= _most(c, u, room) else np.inf)
        for u, size in zip(c.amplitudes, sizes, strict=True)
    ]


def _most(c: Candidate, u: Unknown, room: Mapping[str, float]) -> float:
    """The largest amplitude for which the statement holds: within bounds and limits.

    A change of a parameter as large as itself is far from its first order.
    """
    most = max(u.high, -u.low)
    if c.kind.startswith("parameter_"):
        most = min(most, u.scale / SMALL)
    return min(most, room.get(c.location, np.inf)) if c.kind in WITHIN_LIMITS else most


def _name(c: Candidate, u: Unknown) -> str:
    return FAULTS[c.kind].parameter if c.is_fault else u.name.removeprefix(c.prefix)


def _shape(c: Candidate) -> dict[str, float]:
    return {u.name.removeprefix(c.prefix): u.start for u in c.shape}


def _both(a: Visible, b: Visible) -> Visible:
    """The statement over the shapes of both."""
    best = min(a, b, key=lambda v: v.smallest)
    return Visible(a.kind, a.location, a.parameter, best.smallest, max(a.largest, b.largest), best.shape)
