"""Relations between effects that hold for every record: limits of laws, and groups of parameters."""

from collections.abc import Sequence
from itertools import combinations, permutations

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.sensor_faults import FAULTS
from fmus.effects import EFFECTS


def limits(kind: str) -> tuple[str, ...]:
    """Kinds that are limits of a kind (Coulomb friction of Stribeck friction); none for a sensor fault."""
    return EFFECTS[kind].becomes if kind in EFFECTS else ()


def one_way(h: Hypothesis) -> set[tuple[str, str]]:
    """Kinds and locations of the laws that equal its laws as long as the velocity keeps its sign."""
    return {(kind, c.location) for c in h.candidates if c.kind in EFFECTS for kind in EFFECTS[c.kind].one_way}


def includes(h: Hypothesis, other: Hypothesis) -> bool:
    """Whether h changes a group of parameters and `other` one parameter of that group in the same way."""
    if len(h.candidates) != 1 or len(other.candidates) != 1 or h is other:
        return False
    return groups_with(h.candidates[0], other.candidates[0])


def groups_with(group: Candidate, c: Candidate) -> bool:
    """Whether a candidate changes a group of parameters, of which c changes one in the same way."""
    names = [u.name.removeprefix(group.prefix).partition("_")[2] for u in group.amplitudes]
    return group.kind == c.kind and c.location in names


def becomes(h: Hypothesis, other: Hypothesis) -> bool:
    """Whether `other` is a simpler hypothesis that is a limit of h for some values of its shape."""
    if h is other or len(h.candidates) != len(other.candidates):
        return False
    return any(_member_by_member(h.candidates, order) for order in permutations(other.candidates))


def _member_by_member(candidates: Sequence[Candidate], others: Sequence[Candidate]) -> bool:
    pairs = list(zip(candidates, others, strict=True))
    return any(_simpler(a, b) for a, b in pairs) and all(_same_or_simpler(a, b) for a, b in pairs)


def _simpler(a: Candidate, b: Candidate) -> bool:
    return a.location == b.location and b.kind in limits(a.kind)


def _same_or_simpler(a: Candidate, b: Candidate) -> bool:
    return a.label == b.label or _simpler(a, b)


def reversal(kind: str, other: str) -> bool:
    """Whether two kinds are the same in a motion that keeps its sign, and differ where it turns round."""
    pairs = ((kind, other), (other, kind))
    return any(b in EFFECTS[a].one_way for a, b in pairs if a in EFFECTS)


def splitting(members: Sequence[Hypothesis]) -> str:
    """The experiment that would tell the members of a class apart, by what their laws declare."""
    kinds = {c.kind for m in members for c in m.candidates}
    where = " and ".join(places := sorted({c.location for m in members for c in m.candidates}))
    advice = []
    if any(reversal(a, b) for a, b in combinations(kinds, 2)):
        advice.append(f"a record in which the velocity at {where} changes its sign")
    curves = {kind for kind in kinds & set(EFFECTS) if EFFECTS[kind].over == "velocity"}
    if any(b != a and not reversal(a, b) for a in curves for b in kinds):
        advice.append(f"records at two or more clearly different speeds at {where}")
    advice += dict.fromkeys(fault.splitting for kind, fault in FAULTS.items() if kind in kinds)
    if len(places) > 1:
        advice.append(
            f"a record that excites {where} by different amounts, for example at another load or torque"
        )
    return "; ".join(advice) or f"a record with a wider range of speed and displacement at {where}"
