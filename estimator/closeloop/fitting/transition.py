"""The duration of a change that sets in at a time.

In the search, a change lasts as long as the library assumes. A record whose samples resolve the change
rejects a wrong duration, and the other unknowns of the effect would make up for it. The duration is therefore
fitted with the errors of the answer, where it is worth an unknown.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.problem import Unknown
from estimator.record import Record
from fmus.effects.timing import LONGEST, RISE, SHORTEST

FINE = 10.0  # samples: scale of the onset time and of the duration, of which differences are a hundredth


def with_duration(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis with the durations of its changes fitted too, if these are worth an unknown each."""
    problem = fitter.baseline.problem
    candidates = tuple(_lasting(c, problem.record) for c in h.candidates)
    if candidates == h.candidates:
        return h
    lasting = Promise(candidates, 0.0, {**{u.name: u.start for c in candidates for u in c.shape}, **h.theta})
    again = fitter.alone.finished([lasting], h.others)
    return replace(best_by_label([h, *again])[0], worth=h.worth)


def unresolved(h: Hypothesis) -> Mapping[str, float]:
    """Standard deviation of each onset time, in s by name, that the shape of the change leaves open.

    Nobody knows how a change proceeds within its duration, so that it may have happened at any time in it.
    """
    durations = {c.prefix: h.theta.get(c.duration_name, RISE) for c in h.candidates}
    return {u.name: durations[c.prefix] / np.sqrt(12) for c in h.candidates for u in c.shape if u.is_onset}


def _lasting(c: Candidate, record: Record) -> Candidate:
    """The candidate with the duration of its change as an unknown, if it sets in at a time."""
    if c.onset is None:
        return c
    sample = float(np.median(np.diff(record.runs[0].t)))
    name, low = c.duration_name, min(max(sample, SHORTEST), RISE)
    duration = Unknown(name, RISE, low, LONGEST, FINE * sample)
    fine = [replace(u, scale=FINE * sample) if u.is_onset else u for u in c.shape if u.name != name]
    return replace(c, shape=(*fine, duration))
