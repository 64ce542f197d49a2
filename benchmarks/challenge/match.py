"""When an answer names what was there: the same kind and place, or another name of the same equation.

Other names are identities of the models, not lacks of a record: whatever the record, the two cannot differ.
What one record cannot tell apart is for the answer to say, by naming a class.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from benchmarks.challenge.truth import Item, Pair, Truth
from tests.truth.laws import LAWS
from tests.truth.wheelset_effects import FRICTION

NAMING = ("traced", "several", "ambiguous", "sensor_fault")
CONFIDENT = ("traced", "several", "sensor_fault")
SILENT = ("no_discrepancy", "insufficient_excitation")
OF_NO_MOTION = ("constant_force", "step_force", "harmonic_excitation")  # laws without q and v
SUSPENSIONS = ("secondary", "primary")


@dataclass(frozen=True)
class Answer:
    """What the chain said of a record; failure: why it said nothing."""

    verdict: str = ""
    names: tuple[Pair, ...] = ()
    effects: tuple[dict[str, Any], ...] = ()
    gap_closed: dict[str, float] = field(default_factory=dict)
    error: dict[str, dict[str, float]] = field(default_factory=dict)
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    failure: str = ""
    split: dict[str, float] = field(default_factory=dict)  # seconds by stage

    @classmethod
    def of(cls, kept: dict[str, Any]) -> Answer:
        """From what is kept of a record's run."""
        times = {"seconds": kept["seconds"], "cpu_seconds": kept.get("cpu_seconds", 0.0)}
        if "failure" in kept:
            return cls(failure=kept["failure"], **times)
        r = kept["result"]
        names = tuple((e["kind"], e["location"]) for e in r["effects"])
        return cls(
            r["verdict"],
            names,
            tuple(r["effects"]),
            r["gap_closed"],
            r["error"],
            **times,
            split=r.get("seconds", {}),
        )

    @property
    def label(self) -> str:
        """Verdict and what it names."""
        said = ", ".join(f"{k}@{p}" for k, p in self.names)
        return self.failure.splitlines()[0] if self.failure else f"{self.verdict} {said}".strip()


def other_names(system: str, item: Item) -> set[Pair]:
    """Kind and location of an effect with all that are the same equation there."""
    kind, at = item.pair
    found = {item.pair}
    if system == "wheelset" and kind in LAWS:
        if at in ("primary_yaw", "wheelset_yaw") and not kind.endswith("_change"):
            found |= {(kind, "primary_yaw"), (kind, "wheelset_yaw")}  # one port under two names
        if at in ("wheelset_lateral", "contact") and kind in OF_NO_MOTION:
            found |= {(kind, "wheelset_lateral"), (kind, "contact")}  # both push the wheelset aside
    if system in ("vehicle", "wheelset") and at.startswith(SUSPENSIONS):
        if kind == "viscous_damping":
            found.add(("damping_change", at))  # the damper with more of it
        whole = not item.parameters.get("t0")
        if kind == "damping_change" and whole and float(item.parameters["change"]) > 0:  # type: ignore[arg-type]
            found |= other_names(system, Item("viscous_damping", at))
    if system == "rig" and kind.startswith("parameter_") and at in ("mu0", "N"):
        found |= {(kind, "mu0"), (kind, "N")}  # nearly: Polach's force depends on their product
    if system == "wheelset" and kind.startswith("parameter_"):
        if at == "friction_condition":
            found.add((kind, "mu0"))  # the member that changes most
        if at in FRICTION:
            found.add((kind, "friction_condition"))  # the group that it belongs to
    return found


def named(truth: Truth, names: Iterable[Pair]) -> list[bool]:
    """Of each effect that was there, whether it is among the names."""
    said = set(names)
    return [bool(other_names(truth.system, item) & said) for item in truth.items]


def judged(truth: Truth, a: Answer) -> str:
    """One word on an answer: right, part, abstained, wrong or failed.

    part: the effect with one too many, or one of two; abstained: nothing named, nothing wrongly (or for a
    record that cannot show its effect, right); wrong: something named that was not there.
    """
    if a.failure:
        return "failed"
    if truth.group == "none":
        return "right" if a.verdict in SILENT else "wrong" if a.names else "abstained"
    if truth.group == "outside":
        return "right" if a.verdict == "unexplained" else _of_a_stranger(truth, a)
    if not a.names:
        return "right" if truth.quiet and a.verdict in SILENT else "abstained"
    hits = named(truth, a.names)
    if len(hits) == 2:
        return "right" if all(hits) else "part" if any(hits) and a.verdict != "traced" else "wrong"
    if not any(hits):
        return "wrong"
    return "part" if a.verdict == "several" else "right"


def _of_a_stranger(truth: Truth, a: Answer) -> str:
    if not a.names or a.verdict == "ambiguous":
        return "abstained"
    return "part" if set(a.names) <= set(truth.near) else "wrong"
