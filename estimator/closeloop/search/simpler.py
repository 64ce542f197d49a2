"""Replaces a law by a simpler one that is its limit, and an effect that sets in by one from the start."""

from collections.abc import Sequence
from itertools import product

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise, distinct, key
from estimator.closeloop.hypotheses.relations import limits


def simpler(found: Sequence[Hypothesis], candidates: Sequence[Candidate]) -> list[Promise]:
    """Promises of the best of `found` with one or more of its laws replaced by their simpler limits.

    candidates: all that can be built in, in all shapes. Sets that were fitted until convergence are left out.
    """
    best, known = found[0], {h.key for h in found if h.fit.converged}
    promises = [
        Promise(laws, 0.0, _start(best, laws))
        for laws in product(*([c, *_in_place_of(c, candidates)] for c in best.candidates))
        if laws != best.candidates and key(laws) not in known
    ]
    return distinct(promises)


def from_the_start(found: Sequence[Hypothesis], candidates: Sequence[Candidate]) -> list[Promise]:
    """Promises of the hypotheses of one effect that sets in, with the same effect acting from the start.

    An onset in the first moments of a record is hardly told from the start, but it is one more unknown.
    """
    promises = []
    for h in found:
        if len(h.candidates) == 1 and h.candidates[0].onset is not None:
            same = (c for c in candidates if c.label == h.label and c.onset is None)
            promises += [Promise((c,), 0.0, _start(h, (c,))) for c in same]
    return promises


def _in_place_of(c: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The first shape of each law that is a limit of c, at the same location."""
    first: dict[str, Candidate] = {}
    for other in candidates:
        if other.location == c.location and other.kind in limits(c.kind):
            first.setdefault(other.kind, other)
    return list(first.values())


def _start(h: Hypothesis, candidates: Sequence[Candidate]) -> dict[str, float]:
    """The values of the hypothesis; a new law starts at its realistic size."""
    size = {u.name: u.scale for c in candidates for u in c.amplitudes}
    shape = {u.name: u.start for c in candidates for u in c.shape}
    return {**size, **shape, **h.fit.theta}
