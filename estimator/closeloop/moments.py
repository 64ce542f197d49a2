"""When did it begin? The moment at which a candidate sets in, found on finer and finer grids.

A fit cannot find it: what a later beginning changes is what the effect does in that instant, and that
turns its sign with the motion.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.fit import Fit
from estimator.closeloop.screen import Promise, Screening, screen

FIRST = 0.1  # of the length that is fitted: between the moments that were tried before
ROUNDS, STEPS = 2, 6  # grids, and their points on either side


def moment(c: Candidate) -> float | None:
    """When a candidate sets in, s; None where it is always there."""
    return next((u.start for u in c.shape if u.is_moment), None)


def at_their_moments(screening: Screening, fit: Fit, promises: Sequence[Promise], most: int) -> list[Promise]:
    """The promises, best first; the best one of each of `most` labels that set in has its best moment.

    fit: that the promises were worked out from.
    """
    leading: dict[str, Promise] = {}
    for p in promises:
        if moment(p.candidates[0]) is not None:
            leading.setdefault(p.label, p)
    best = dict(list(leading.items())[:most])
    spacing = screening.length * FIRST
    for _ in range(ROUNDS):
        tried = [c for p in best.values() for c in _near(p.candidates[0], spacing)]
        change = screening.changes(tried)
        found = screen(fit, [((c,), g) for c, g in zip(tried, change, strict=True)])
        for p in reversed(found):
            if p.gain > best[p.label].gain:
                best[p.label] = p
        spacing /= STEPS
    rest = [p for p in promises if p is not leading.get(p.label) or p.label not in best]
    return sorted([*rest, *best.values()], key=lambda p: -p.gain)


def _near(c: Candidate, spacing: float) -> list[Candidate]:
    """The candidate setting in a little earlier and later, within a spacing on either side."""
    here = moment(c) or 0.0
    times = here + spacing * np.arange(1 - STEPS, STEPS) / STEPS
    return [set_in(c, float(t)) for t in times if t > 0 and t != here]


def set_in(c: Candidate, t: float) -> Candidate:
    """The candidate setting in at a time, s."""
    return replace(c, shape=tuple(replace(u, start=t) if u.is_moment else u for u in c.shape))
