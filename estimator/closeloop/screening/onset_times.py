"""Onset times of screened candidates, by a search over successively finer grids.

Least squares cannot find an onset time: its derivative is the effect of the force at the onset, which changes
its sign with the motion, so that the sum of squares has many local minima.
"""

from collections.abc import Sequence

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.screen import screen

FIRST_SPACING = 0.1  # spacing of the onset times of the candidates, as share of the fitted length


GRIDS, GRID_STEPS = 2, 6  # number of grids; each divides the spacing by this number of steps


def at_their_onsets(screening: Screening, fit: Fit, promises: Sequence[Promise], most: int) -> list[Promise]:
    """The promises, best first, with refined onset times for the best promise of each of `most` labels.

    fit: the fit with which the promises were computed.
    """
    leading: dict[str, Promise] = {}
    for p in promises:
        if p.candidates[0].onset is not None:
            leading.setdefault(p.label, p)
    best = dict(list(leading.items())[:most])
    spacing = screening.length * FIRST_SPACING
    for _ in range(GRIDS):
        tried = [c for p in best.values() for c in _near(p.candidates[0], spacing)]
        change = screening.changes(tried)
        found = screen(fit, [((c,), g) for c, g in zip(tried, change, strict=True)])
        for p in reversed(found):
            if p.gain > best[p.label].gain:
                best[p.label] = p
        spacing /= GRID_STEPS
    rest = [p for p in promises if p is not leading.get(p.label) or p.label not in best]
    return sorted([*rest, *best.values()], key=lambda p: -p.gain)


def _near(c: Candidate, spacing: float) -> list[Candidate]:
    """The candidate with onset times on a grid within one spacing on either side."""
    here = c.onset or 0.0
    times = here + spacing * np.arange(1 - GRID_STEPS, GRID_STEPS) / GRID_STEPS
    return [c.with_onset(float(t)) for t in times if t > 0 and t != here]
