"""Comparison of an answer with the truth: same kind and location, or another name of the same equation.

Two names are accepted for one effect only if the models make them identical for every record. Effects that
one particular record cannot tell apart must be named as a class by the answer.
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
OF_NO_MOTION = ("constant_force", "step_force", "harmonic_excitation")  # forces that depend on no motion
SUSPENSIONS = ("secondary", "primary")
CHANGES = ("stiffness_change", "damping_change")
# stiffness and damping of which a whole suspension consists
PARTS = {
    "vehicle": {"secondary": ("k1", "b1"), "primary": ("k2", "b2")},
    "wheelset": {"primary_lateral": ("k_y", "b_y"), "primary_yaw": ("k_x", "b_x")},
}


@dataclass(frozen=True)
class Answer:
    """The answer of close-loop to a record; failure: the reason why there is none."""

    verdict: str = ""
    names: tuple[Pair, ...] = ()
    effects: tuple[dict[str, Any], ...] = ()
    gap_closed: dict[str, float] = field(default_factory=dict)
    error: dict[str, dict[str, float]] = field(default_factory=dict)
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    failure: str = ""
    split: dict[str, float] = field(default_factory=dict)  # wall time of each step, s
    probability: dict[str, float] = field(default_factory=dict)  # of each answer, by its label

    @classmethod
    def of(cls, kept: dict[str, Any]) -> Answer:
        """The answer from the file that is kept for a record."""
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
            probability=r.get("probability", {}),
        )

    @property
    def label(self) -> str:
        """The verdict with the effects that it names."""
        said = ", ".join(f"{k}@{p}" for k, p in self.names)
        return self.failure.splitlines()[0] if self.failure else f"{self.verdict} {said}".strip()


def other_names(system: str, item: Item) -> set[Pair]:
    """Kind and location of an effect, and of all effects with the same equation."""
    kind, at = item.pair
    found = {item.pair}
    if system == "wheelset" and kind in LAWS:
        if at in ("primary_yaw", "wheelset_yaw") and not kind.endswith("_change"):
            found |= {(kind, "primary_yaw"), (kind, "wheelset_yaw")}  # one port under two names
        if at in ("wheelset_lateral", "contact") and kind in OF_NO_MOTION:
            found |= {(kind, "wheelset_lateral"), (kind, "contact")}  # both push the wheelset aside
    if system in ("vehicle", "wheelset") and at.startswith(SUSPENSIONS):
        if kind == "viscous_damping":
            stronger = Item("damping_change", at)  # the same as a stronger damper
            found |= {stronger.pair, *_of_a_suspension(system, stronger)}
        whole = not item.parameters.get("t0")
        if kind == "damping_change" and whole and float(item.parameters["change"]) > 0:  # type: ignore[arg-type]
            found |= other_names(system, Item("viscous_damping", at))
    found |= _of_a_suspension(system, item)
    if system == "rig" and kind.startswith("parameter_") and at in ("mu0", "N"):
        found |= {(kind, "mu0"), (kind, "N")}  # nearly the same: Polach's force depends on their product
    if system == "wheelset" and kind.startswith("parameter_"):
        if at == "friction_condition":
            found.add((kind, "mu0"))  # the parameter of the group that changes most
        if at in FRICTION:
            found.add((kind, "friction_condition"))  # the group of the parameter
    return found


def _of_a_suspension(system: str, item: Item) -> set[Pair]:
    """The two names of a change of a whole suspension: of its component and of its parameter."""
    since = "parameter_step" if item.parameters.get("t0") else "parameter_offset"
    pairs = (
        {(change, place), (since, parameter)}
        for place, parameters in PARTS.get(system, {}).items()
        for change, parameter in zip(CHANGES, parameters, strict=True)
    )
    return {pair for names in pairs if item.pair in names for pair in names}


def named(truth: Truth, names: Iterable[Pair]) -> list[bool]:
    """For each true effect, whether it is among the names."""
    said = set(names)
    return [bool(other_names(truth.system, item) & said) for item in truth.items]


def judged(truth: Truth, a: Answer) -> str:
    """The grade of an answer: right, part, abstained, wrong or failed.

    part: the true effect with an additional one, or one of two true effects; abstained: no effect was named,
    which is right if the record cannot show its effect; wrong: an effect was named that is not true.
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
