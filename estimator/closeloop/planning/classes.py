"""Classes of effects that a record does not tell apart, and what would split each of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from estimator.closeloop.planning.comparison import Comparison, Distances
from estimator.closeloop.planning.sought import Sought
from estimator.record import Array

SPLIT = 1.0  # margin from which on two effects are told apart
FAR = 100.0  # margins above this are not distinguished
LONGEST_RECORD, TRIED_TIMES = 100.0, 100  # times the planned record, beyond which seconds are no advice
NO_MATTER = 1e-3  # margins below this are rounding; no size and no duration would split such effects


@dataclass(frozen=True)
class Splitter:
    """A sensor or an excitation, and how far it would split a class.

    margin: the smallest margin of the pairs of the class, which is split as a whole from 1 on; pairs: number
    of its pairs that are split; score: the smallest difference of log scores in it; noise: of the sensor.
    """

    what: str
    margin: float
    pairs: int
    score: float
    noise: float = float("nan")


@dataclass(frozen=True)
class EffectClass:
    """Effects that the record does not tell apart; a single effect is told from all others.

    sizes: amplitudes with which they are compared, in scales of the first variant of each; margin: of the
    closest pair; pairs: their number; score: difference of the log scores on the part to choose; size: how
    many times as large all effects had to be, infinite if no size would do; times: how many times as long the
    record, None if up to 100 times would not do; sensors, excitations: best first.
    """

    members: tuple[Sought, ...]
    sizes: tuple[float, ...]
    margin: float = float("inf")
    pairs: int = 0
    score: float = float("inf")
    size: float = 1.0
    times: float | None = 1.0
    sensors: tuple[Splitter, ...] = ()
    excitations: tuple[Splitter, ...] = field(default=())


def grouped_by(margins: Array) -> list[NDArray[np.intp]]:
    """Indices of the effects of each class: each two of a class have a margin (n, n) below 1.

    The closest pairs are joined first, so that the order of the effects does not matter.
    """
    n = len(margins)
    if n < 2:
        return [np.arange(n)] if n else []
    apart = np.minimum(margins, FAR)
    np.fill_diagonal(apart, 0.0)
    label = fcluster(linkage(squareform(apart, checks=False), "complete"), SPLIT * (1 - 1e-12), "distance")
    found = [np.flatnonzero(label == one) for one in np.unique(label)]
    return sorted(found, key=lambda at: (-len(at), int(at[0])))


def pairs_of(figures: Array) -> Array:
    """The figure of each pair (n, n) once."""
    return np.asarray(figures[np.triu_indices(len(figures), 1)])


def times_needed(comparison: Comparison, distances: Distances) -> float | None:
    """How many times as long a record of the same excitation must be to tell all effects apart.

    The squares of what effects miss grow with the record, and so does what the policy lets pass as a small
    error of form. None if even the longest record would not do.
    """
    for times in np.geomspace(1.0, LONGEST_RECORD, TRIED_TIMES):
        needed = comparison.needed_after(float(times))
        if np.min(pairs_of(distances.margins(needed, float(times)))) >= SPLIT:
            return float(times)
    return None


def classed(comparison: Comparison, some: Sequence[Sought], sizes: Sequence[float]) -> list[EffectClass]:
    """The classes of effects with given amplitudes, in scales of the first variant of each."""
    if not some:
        return []
    distances = comparison.distances(some, sizes)
    return [
        class_of(comparison, [some[i] for i in at], [sizes[i] for i in at], distances.of(at))
        for at in grouped_by(distances.margins(comparison.needed))
    ]


def class_of(
    comparison: Comparison, members: Sequence[Sought], sizes: Sequence[float], distances: Distances
) -> EffectClass:
    """A class of effects with given amplitudes, without what would split it."""
    if len(members) == 1:
        return EffectClass(tuple(members), tuple(sizes))
    pairs = pairs_of(distances.margins(comparison.needed))
    margin, score = float(np.min(pairs)), float(np.min(pairs_of(distances.scores())))
    size, times = np.inf, None
    if margin > NO_MATTER:
        size, times = max(1.0, 1 / margin), times_needed(comparison, distances)
    return EffectClass(tuple(members), tuple(sizes), margin, len(pairs), score, size, times)


def splitter(c: EffectClass, comparison: Comparison, what: str, noise: float = np.nan) -> Splitter:
    """How far a sensor or an excitation splits a class, by the comparison with it."""
    distances = comparison.distances(c.members, c.sizes)
    pairs = pairs_of(distances.margins(comparison.needed))
    score = float(np.min(pairs_of(distances.scores())))
    return Splitter(what, float(np.min(pairs)), int(np.sum(pairs >= SPLIT)), score, noise)


def ranked(splitters: Sequence[Splitter]) -> tuple[Splitter, ...]:
    """Those that split a pair at least, best first."""
    useful = [s for s in splitters if s.pairs]
    return tuple(sorted(useful, key=lambda s: (-s.pairs, -s.margin)))
