"""Effects that one vehicle shows, tested on others of its class by what their records would have shown."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from scipy.stats import binomtest

from scenarios.fleet.declaration import CALIBRATED
from scenarios.fleet.findings import SURE
from scenarios.fleet.planning import Plan
from scenarios.fleet.policy import POLICY
from scenarios.fleet.scatter import Mean, mean_over
from scenarios.tasks.store import FAILED, Answer

GROUP = ("setup", "model", "class")
DENY_NOTHING = ("unexplained", "insufficient_excitation")  # verdicts beside which an effect may be there


@dataclass(frozen=True)
class Pooled:
    """An effect in a class of vehicles.

    parameter, size: that which says how large it is, with its mean over the vehicles that show it.
    shown: vehicles with an answer that has it; possible: it is one of several in an ambiguous answer;
    absent: vehicles without it, of which a record would have shown it at the mean size; blind: vehicles
    without it whose records would not have shown it; untraced: vehicles of which close-loop has no answer;
    share: of shown among shown and absent, with its exact 95 % interval. It is None where a triage has left
    vehicles out, since those that were traced are no sample of the class.
    """

    setup: str
    model: str
    vehicle_class: str
    kind: str
    location: str
    parameter: str
    unit: str
    size: Mean
    shown: list[str]
    possible: list[str]
    absent: list[str]
    blind: list[str]
    untraced: list[str]
    share: float | None
    share_low: float | None
    share_high: float | None


@dataclass(frozen=True)
class _Seen:
    """An answered record of close-loop."""

    vehicle: str
    answer: Answer

    def has(self, effect: tuple[str, str], sure: bool) -> bool:
        """Whether its answer has the effect, alone or as one of a class that it does not tell apart."""
        rows = self.answer["rows"]
        return (self.answer["verdict"] in SURE) == sure and any(_effect(r) == effect for r in rows)

    def would_show(self, effect: tuple[str, str], parameter: str, size: float) -> bool:
        """Whether it would have shown the effect at this size, in each of the shapes that were tried.

        A record with a discrepancy that no effect explains, or that says too little, does not deny an effect.
        """
        if self.answer["verdict"] in DENY_NOTHING:
            return False
        lines = [v for v in self.answer["visible"] if (v["kind"], v["location"]) == effect]
        limits = [v["largest"] for v in lines if v["parameter"] == parameter]
        return any(limit is not None and limit <= abs(size) for limit in limits)


def pooled(plan: Plan, answers: Mapping[str, Answer]) -> list[Pooled]:
    """Every effect that was found, in each class where it was found, in the order of the fleet."""
    groups: dict[tuple[str, ...], _Group] = defaultdict(_Group)
    for job in plan.jobs:
        if job.command == "close-loop" and job.record:
            answer = answers.get(job.task.key) if job.task else None
            group = groups[job.setup, job.model.name, job.record.kind]
            group.vehicles[job.record.vehicle] = None
            if answer is None:
                group.triaged |= job.triaged
            elif answer["verdict"] != FAILED:
                group.seen.append(_Seen(job.record.vehicle, answer))
    return [found for key, group in groups.items() for found in _of_group(key, group)]


@dataclass
class _Group:
    """The vehicles of a class in their order, the answered records, and whether a triage left some out."""

    vehicles: dict[str, None] = field(default_factory=dict)
    seen: list[_Seen] = field(default_factory=list)
    triaged: bool = False


def _effect(row: Mapping[str, Any]) -> tuple[str, str] | None:
    kind = row.get("kind")
    return (kind, row["location"]) if kind and kind != CALIBRATED else None


def _of_group(key: tuple[str, ...], group: _Group) -> Iterator[Pooled]:
    sure = [s for s in group.seen if s.answer["verdict"] in SURE]
    effects = dict.fromkeys(e for s in sure for row in s.answer["rows"] if (e := _effect(row)))
    for effect in effects:
        rows = [
            (s.vehicle, row)
            for s in sure
            for row in s.answer["rows"]
            if _effect(row) == effect and row["size"] is not None and row["std"]
        ]
        parameter = _amplitude(effect, sure, rows)
        sizes: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
        for vehicle, row in rows:
            if row["parameter"] == parameter:
                sizes[vehicle].append(row)
        if sizes:
            unit = next(iter(sizes.values()))[0]["unit"]
            every = [*sizes.values()]
            yield _standing(key, effect, parameter, unit, _mean_size(every), _mean_size(every, abs), group)


def _mean_size(vehicles: Sequence[Sequence[Mapping[str, Any]]], of: Callable[[float], float] = float) -> Mean:
    """The mean over vehicles of the mean of each: the records of one vehicle are no independent sizes."""
    each = [mean_over([of(r["size"]) for r in rows], [r["std"] for r in rows]) for rows in vehicles]
    return mean_over([m.value for m in each], [m.std for m in each])


def _amplitude(
    effect: tuple[str, str], sure: Sequence[_Seen], rows: Sequence[tuple[str, Mapping[str, Any]]]
) -> str:
    """The parameter that says how large an effect is: the one of which records say what they would show."""
    named = [
        v["parameter"]
        for s in sure
        for v in s.answer["visible"]
        if (v["kind"], v["location"]) == effect
    ]  # fmt: skip
    present = [row["parameter"] for _, row in rows]
    return next((n for n in named if n in present), present[0] if present else "")


def _standing(
    key: tuple[str, ...], effect: tuple[str, str], parameter: str, unit: str, size: Mean, magnitude: Mean,
    group: _Group,
) -> Pooled:  # fmt: skip
    """Each vehicle by its best record; magnitude: the mean size whatever its sign, for a record to show."""
    by_vehicle: dict[str, list[_Seen]] = defaultdict(list)
    for s in group.seen:
        by_vehicle[s.vehicle].append(s)
    shown: list[str] = []
    possible: list[str] = []
    absent: list[str] = []
    blind: list[str] = []
    for vehicle, records in by_vehicle.items():
        if any(s.has(effect, sure=True) for s in records):
            shown.append(vehicle)
        elif any(s.has(effect, sure=False) for s in records):
            possible.append(vehicle)
        elif any(s.would_show(effect, parameter, magnitude.value) for s in records):
            absent.append(vehicle)
        else:
            blind.append(vehicle)
    untraced = [v for v in group.vehicles if v not in by_vehicle]
    share: tuple[float | None, ...] = (None,) * 3
    if not (group.triaged and untraced):
        n, decided = len(shown), len(shown) + len(absent)
        interval = binomtest(n, decided).proportion_ci(POLICY.confidence, "exact")
        share = n / decided, float(interval.low), float(interval.high)
    setup, model, vehicle_class = key
    return Pooled(
        setup, model, vehicle_class, effect[0], effect[1], parameter, unit, size, shown, possible, absent,
        blind, untraced, *share,
    )  # fmt: skip
