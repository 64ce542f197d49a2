"""Finds a second effect that sets in where a first one ceases to explain the record.

Of two effects, the one that acts from the start may explain the record up to the moment at which the other
one sets in, but hardly any of the whole record. With the first one in the FMU, that moment shows in the
residual, and the samples after it show the second effect.
"""

from collections.abc import Sequence
from dataclasses import replace

from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.search.dating import dated
from estimator.closeloop.search.onset import onset, since


def followed(
    fitter: Fitter, begun: Sequence[Hypothesis], candidates: Sequence[Candidate]
) -> list[Hypothesis]:
    """Fitted pairs, best first, of an effect that acts from the start and one that sets in, both needed.

    begun: hypotheses fitted to the first parts of the record, best first there, of which the best one that
    acts from the start is taken; candidates: for the second effect. None if the residual grows nowhere.
    """
    baseline, limits = fitter.baseline, fitter.baseline.policy.search
    first = next((h for h in begun if not h.onset_names), None)
    if first is None:
        return []
    there = replace(baseline, problem=built(baseline.problem, first.candidates), hypothesis=first)
    at = onset(there, limits.sets_in_times)
    if at is None:
        return []
    second = since(replace(fitter, baseline=there), at, [c for c in candidates if c.label != first.label])
    start = at[1].theta
    pairs = [Promise((*first.candidates, *p.candidates), 0.0, {**start, **p.start}) for p in second]
    brief = fitter.briefly(pairs[: limits.sudden], known=False)
    found = dated(fitter, fitter.to_the_end(brief, limits.finalist_pairs))
    return [h for h in found if not baseline.idle(h)]
