"""Power of the detection: the smallest effect of each kind and location that a record would have shown.

Such an effect would have been detected as more than noise with probability POWER at the level of the test. It
is computed from the sensitivities of the screening, so to first order, for effects that act through the part
to identify with the given shape (gap, time, order). Whether the effect would be large enough to matter is not
considered.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.regressors import (
    Changes,
    columns_of,
    is_wave,
)
from estimator.record import Array
from estimator.sensor_faults import FAULTS
from fmus.effects.parameter_effect import SMALL

POWER = 0.8
DRAWS = 4000  # draws of noise for the threshold of the largest projection
WITHIN_LIMITS = ("parameter_offset", "parameter_step")  # a drift may have any rate, as it ends at the limits
PHASES = 90  # phases of a sine wave that are evaluated; the least visible one counts


@dataclass(frozen=True)
class Visible:
    """The smallest detectable amplitude of an effect, in the unit of its parameter.

    parameter: its name, "amplitude" for a sine and a cosine together; smallest: for the most visible shape,
    which is given by `shape`; largest: for the least visible shape; infinite if no amplitude is detectable.
    """

    kind: str
    location: str
    parameter: str
    smallest: float
    largest: float
    shape: dict[str, float]


def power(
    change: Changes,
    found: tuple[Array, Array],
    level: float,
    rng: np.random.Generator,
    chance: float = POWER,
    room: Mapping[str, float] = MappingProxyType({}),
) -> list[Visible]:
    """The smallest detectable amplitudes of all candidates, sorted by kind and location.

    change: of residuals weighted to unit noise; found: its lengths and cosines, see `alike`; level:
    probability that noise alone is detected as any effect; chance: probability that the effect is detected;
    room: the largest change of each parameter within its limits, by name.
    """
    left, cosines = found
    from scipy.stats import norm  # takes a third of a second to load, and comes after the verdict

    needed = threshold(cosines, level, rng) + float(norm.ppf(chance))
    every: dict[tuple[str, str, str], Visible] = {}
    for (c, _), at in zip(change, columns_of(g for _, g in change), strict=True):
        for name, size in _sizes(c, left[at], cosines[at, at], needed, room):
            one = Visible(c.kind, c.location, name, size, size, _shape(c))
            key = (c.kind, c.location, name)
            every[key] = _both(every[key], one) if key in every else one
    return [every[key] for key in sorted(every)]


def threshold(cosines: Array, level: float, rng: np.random.Generator) -> float:
    """Threshold that the largest projection of white noise onto K directions exceeds with probability level.

    cosines: (K, K) between the directions.
    """
    if not len(cosines):
        from scipy.stats import norm

        return float(norm.isf(level / 2))
    values, vectors = np.linalg.eigh(cosines)
    kept = values > 1e-9 * values[-1]
    root = vectors[:, kept] * np.sqrt(values[kept])
    drawn = np.abs(rng.standard_normal((DRAWS, root.shape[1])) @ root.T).max(axis=1)
    return float(np.quantile(drawn, 1 - level))


def _sizes(
    c: Candidate, left: Array, cosines: Array, needed: float, room: Mapping[str, float]
) -> list[tuple[str, float]]:
    """Smallest detectable amplitude by name, infinite beyond its bounds; of a wave for the worst phase."""
    scale = np.array([u.scale for u in c.amplitudes])
    if is_wave(c):
        angles = np.linspace(0, np.pi, PHASES, endpoint=False)
        parts = np.vstack([np.cos(angles), np.sin(angles)]) * (left / scale)[:, None]
        shown = np.abs(cosines @ parts).max(axis=0).min()  # the larger projection counts
        return [("amplitude", float(needed / shown) if shown > 0 else np.inf)]
    sizes = np.where(left > 0, needed * scale / np.where(left > 0, left, 1.0), np.inf)
    return [
        (_name(c, u), float(size) if size <= largest(c, u, room) else np.inf)
        for u, size in zip(c.amplitudes, sizes, strict=True)
    ]


def largest(c: Candidate, u: Unknown, room: Mapping[str, float]) -> float:
    """The largest amplitude within bounds and limits for which the first order is accurate enough.

    For the change of a parameter by its own size, for instance, it is not.
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
    """Two results for one effect combined over their shapes."""
    best = min(a, b, key=lambda v: v.smallest)
    return Visible(a.kind, a.location, a.parameter, best.smallest, max(a.largest, b.largest), best.shape)
