"""The result of a record after its effects have been tested in other records of the same FMU."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.several.transfer import Status, Traced, Transfer

SAYS_NOTHING: tuple[Status, ...] = ("open", "impossible")
EXCLUDED: tuple[Status, ...] = ("differs", "surpassed", "absent")


@dataclass(frozen=True, eq=False)
class Standing:
    """The members of a record's answer that are left, those that are ruled out, and the records that decide.

    confirmed: names of the confirming records by label; ruled_out: the record and its reason by label;
    disputed: records to which no member carries over, with their transfers; undecided: reasons of transfers
    without a result.
    """

    record: str
    members: tuple[Hypothesis, ...]
    left: tuple[Hypothesis, ...]
    confirmed: Mapping[str, tuple[str, ...]]
    ruled_out: Mapping[str, tuple[str, str]]
    disputed: Mapping[str, tuple[Transfer, ...]]
    undecided: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The result as a sentence for the report; empty if there was nothing to test."""
        said = [_kept(h.label, self.confirmed[h.label]) for h in self.left if self.confirmed[h.label]]
        said += [f"{label} is ruled out by {by}" for label, (by, _) in self.ruled_out.items()]
        said += self._disputes()
        if len(self.members) > 1 and len(self.left) == 1:
            said.insert(0, f"the class comes down to {self.left[0].label}")
        return "; ".join(said or self.undecided)

    def _disputes(self) -> list[str]:
        """Phrases on the records to which no member carries over."""
        other = [t for found in self.disputed.values() for t in found if t.status == "differs"]
        said = [f"{t.member.label} has other values in {t.target}, {_far(t)}" for t in other]
        without = [by for by in self.disputed if by not in {t.target for t in other}]
        if without:
            alone = f"{self.members[0].label} is not found in {' and '.join(without)}"
            every = f"no member of the class is found in {' and '.join(without)}"
            said.append(alone if len(self.members) == 1 else every)
        return said


def _far(t: Transfer) -> str:
    return f"{t.difference.distance:.3g} standard errors apart" if t.difference else "not compared"


def _kept(label: str, by: Sequence[str]) -> str:
    return f"{label} is confirmed by {' and '.join(by)}"


def standing(a: Traced, found: Sequence[Transfer]) -> Standing:
    """The standing of a record's members, from their transfers to other records.

    If a member carries over to a record, the members that do not are ruled out by that record. If none does,
    nothing is ruled out but the record is disputed, since the two records may come from different machines.
    """
    own = [t for t in found if t.source == a.name]
    ruled: dict[str, tuple[str, str]] = {}
    disputed: dict[str, tuple[Transfer, ...]] = {}
    for target in dict.fromkeys(t.target for t in own):
        asked = [t for t in own if t.target == target and t.status not in SAYS_NOTHING]
        fails = [t for t in asked if not t.carries]
        if any(t.carries for t in asked):
            for t in fails:
                ruled.setdefault(t.member.label, (target, t.reason))
        elif out := [t for t in fails if t.status in EXCLUDED]:
            disputed[target] = tuple(out)
    left = tuple(h for h in a.members if h.label not in ruled)
    by = {h.label: tuple(t.target for t in own if t.carries and t.member is h) for h in left}
    undecided = tuple(t.reason for t in own if not t.carries and t.status not in EXCLUDED)
    return Standing(a.name, a.members, left, by, ruled, disputed, undecided)
