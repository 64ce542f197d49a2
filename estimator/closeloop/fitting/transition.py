"""The duration of a change that sets in at a time.

While effects are searched, every change is assumed to last equally long. If a record is sampled finely enough
to show that a change was faster or slower, the other unknowns of the effect would make up for the wrong
duration. Once an effect is an answer, its duration is therefore fitted too, if that is worth an unknown.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.problem import Unknown
from fmus.effects.timing import LONGEST, RISE, SHORTEST

FINE = 10.0  # samples: scale of an onset time and of a duration; finite differences step by a hundredth of it


def with_duration(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis with the durations of its changes fitted too, if these are worth an unknown each."""
    sample = fitter.baseline.problem.record.runs[0].sample
    candidates = tuple(_lasting(c, sample) for c in h.candidates)
    if candidates == h.candidates:
        return h
    again = fitter.alone.finished([Promise(candidates, 0.0, h.theta)], h.others)
    return replace(best_by_label([h, *again])[0], worth=h.worth)


def unresolved(h: Hypothesis) -> Mapping[str, float]:
    """Standard deviation of each onset time, in s by name, that the shape of the change leaves open.

    Nobody knows how a change proceeds within its duration, so that it may have happened at any time in it.
    """
    return {
        u.name: h.theta.get(c.duration_name, RISE) / np.sqrt(12)
        for c in h.candidates
        for u in c.shape
        if u.is_onset
    }


def _lasting(c: Candidate, sample: float) -> Candidate:
    """The candidate with the duration of its change as an unknown, if it sets in at a time.

    sample: time between two samples, s.
    """
    if c.onset is None:
        return c
    low = min(max(sample, SHORTEST), RISE)
    duration = Unknown(c.duration_name, RISE, low, LONGEST, FINE * sample)
    fine = (replace(u, scale=FINE * sample) if u.is_onset else u for u in c.shape)
    return replace(c, shape=(*fine, duration))
