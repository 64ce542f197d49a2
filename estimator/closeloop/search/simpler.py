"""Would a simpler law do? The one that the leading effect becomes at a limit takes its place."""

from collections.abc import Sequence
from itertools import product

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise, distinct, key
from estimator.closeloop.hypotheses.relations import limits


def simpler(found: Sequence[Hypothesis], candidates: Sequence[Candidate]) -> list[Promise]:
    """Promises of the best of `found`, best first, with one or more of its laws as what they become.

    candidates: that can be built in, in all shapes. What was fitted to the end already is left out.
    """
    best, known = found[0], {h.key for h in found if h.fit.converged}
    promises = [
        Promise(laws, 0.0, _start(best, laws))
        for laws in product(*([c, *_in_place_of(c, candidates)] for c in best.candidates))
        if laws != best.candidates and key(laws) not in known
    ]
    return distinct(promises)


def _in_place_of(c: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The first shape of each law that one becomes, at its own place."""
    first: dict[str, Candidate] = {}
    for other in candidates:
        if other.location == c.location and other.kind in limits(c.kind):
            first.setdefault(other.kind, other)
    return list(first.values())


def _start(h: Hypothesis, candidates: Sequence[Candidate]) -> dict[str, float]:
    """Where the hypothesis is; a new law at its realistic size."""
    size = {u.name: u.scale for c in candidates for u in c.amplitudes}
    shape = {u.name: u.start for c in candidates for u in c.shape}
    return {**size, **shape, **h.fit.theta}
