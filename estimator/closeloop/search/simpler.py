"""Fits in place of the best hypothesis those that contain it or that it contains.

A law is replaced by a simpler one that is its limit, an effect that sets in by one from the start, and the
change of a parameter by that of a group with this parameter.
"""

from collections.abc import Sequence
from itertools import product

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise, distinct, key
from estimator.closeloop.hypotheses.relations import groups_with, limits


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


def in_groups(found: Sequence[Hypothesis], candidates: Sequence[Candidate]) -> list[Promise]:
    """Promises of the best of `found` with the change of a parameter replaced by that of a group with it.

    With no change of the others the group is the parameter alone, so that it cannot fit worse. Where it does,
    or was not fitted, its fit has not arrived; it starts there.
    """
    best = found[0]
    known = {h.key for h in found if cost(h) <= cost(best)}
    promises = []
    for i, c in enumerate(best.candidates):
        for group in (g for g in candidates if groups_with(g, c)):
            laws = (*best.candidates[:i], group, *best.candidates[i + 1 :])
            if key(laws) not in known:
                promises.append(Promise(laws, 0.0, {**best.theta, **_alone(group, c, best)}))
    return distinct(promises)


def _alone(group: Candidate, c: Candidate, h: Hypothesis) -> dict[str, float]:
    """The values with which a group changes as the one of its parameters that c changes in h."""
    same = {u.name: group.prefix + u.name.removeprefix(c.prefix) for u in (*c.amplitudes, *c.shape)}
    sizes = {f"{same[u.name]}_{c.location}": h.theta[u.name] for u in c.amplitudes}
    shape = {same[u.name]: h.theta[u.name] for u in c.shape}
    return {**dict.fromkeys((u.name for u in group.amplitudes), 0.0), **sizes, **shape}


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
