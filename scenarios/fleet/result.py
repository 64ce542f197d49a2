"""The result of fleet, as it is written to result.json beside the tables."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pandas as pd

from scenarios.drawing.typography import quantity, unit, with_error
from scenarios.fleet.policy import POLICY
from scenarios.fleet.rows import Row
from scenarios.shown import axes_or_new
from scenarios.tasks.result import TasksResult
from scenarios.tasks.store import FAILED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMED = 20  # vehicles and records that are named on the command line; the tables have all
RESULTS, DRIFTS, LEVELS, EFFECTS = "results", "drifts.parquet", "levels.parquet", "effects.parquet"


@dataclass(frozen=True, repr=False)
class FleetResult(TasksResult):
    """The result of a fleet; each field is a key of result.json.

    tasks: how many are `planned`, `finished`, `failed` (answered with a reason), `left` (not done, with a
    reason that may pass) and left out by `triage`. verdicts: by command, how many answers have each. failed:
    records that could not be answered, with the reason. drifts, deviates, effects: rows of the tables of
    these names, of drifts and levels those alone that are beyond the fleet's level. limits: by which they
    were found, by name.
    """

    fleet: str
    vehicles: int
    records: int
    verdicts: dict[str, dict[str, int]]
    failed: list[dict[str, str]]
    drifts: list[dict[str, Any]]
    deviates: list[dict[str, Any]]
    effects: list[dict[str, Any]]
    level: float
    mileage_unit: str
    limits: dict[str, float] = field(default_factory=lambda: POLICY.values)

    @property
    def headline(self) -> str:
        """What was looked at and what was found, in one sentence."""
        drifting = len({d["vehicle"] for d in self.drifts})
        return (
            f"{self.fleet}: {self.records} records of {self.vehicles} vehicles; "
            f"{drifting or 'no'} vehicle{'s' * (drifting != 1)} with a parameter that drifts or changes, "
            f"{len({d['vehicle'] for d in self.deviates}) or 'none'} beyond the spread of the class, "
            f"{len(self.failed) or 'no'} record{'s' * (len(self.failed) != 1)} without an answer"
        )

    def lines(self) -> list[str]:
        """See Shown.lines."""
        said = [self.headline]
        for command, counts in self.verdicts.items():
            said.append(f"{command}: {', '.join(f'{n} {v}' for v, n in counts.items())}")
        said += [f"  {drift_words(d, self.mileage_unit)}" for d in self.drifts[:NAMED]]
        said += [f"  {level_words(d)}" for d in self.deviates[:NAMED]]
        said += [f"  {effect_words(e)}" for e in self.effects[:NAMED]]
        said += [f"  {f['record'] or f['model']}: {f['reason']}" for f in self.failed[:NAMED]]
        return said

    def to_frame(self) -> pd.DataFrame:
        """The courses that drift or change, a row each."""
        return pd.DataFrame(self.drifts)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """How many answers have each verdict."""
        drawn = axes_or_new(ax)
        bars = {f"{c}: {v}": n for c, counts in self.verdicts.items() for v, n in counts.items()}
        drawn.barh([*bars], [*bars.values()])
        drawn.set(xlabel="answers", title=self.fleet)
        return drawn


def verdicts_of(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """Answers by command and verdict; the rows of one answer count once, and each check by itself."""
    found: dict[str, Counter[str]] = {}
    seen = set()
    for row in rows:
        each = row["kind"] if row["command"] == "check" else ""
        key = (*(row[n] for n in ("command", "setup", "model", "record")), each)
        if key not in seen:
            seen.add(key)
            found.setdefault(row["command"], Counter())[row["verdict"]] += 1
    return {command: dict(counts.most_common()) for command, counts in found.items()}


def failures_of(rows: Sequence[Row]) -> list[dict[str, str]]:
    """The records without an answer, with the reason."""
    names = ("command", "setup", "model", "vehicle", "record", "reason")
    return [{n: row[n] for n in names} for row in rows if row["verdict"] == FAILED]


def drift_words(d: Mapping[str, Any], mileage_unit: str) -> str:
    """A course that drifts or changes, in words."""
    what = f"{d['vehicle']}{' at ' + d['place'] if d['place'] else ''}: {quantity_words(d)}"
    if d["form"] == "change":
        size = quantity(with_error(d["change_size"], d["change_std"]), d["unit"])
        where = f"between {d['change_low_95']:g} and {d['change_high_95']:g} {mileage_unit}"
        return f"{what} changes by {size} {where} (q = {d['q_value']:.1g})"
    per = f"{unit(d['unit'])}/{mileage_unit}" if unit(d["unit"]) else f"per {mileage_unit}"
    return f"{what} drifts by {with_error(d['slope'], d['slope_std'])} {per} (q = {d['q_value']:.1g})"


def level_words(x: Mapping[str, Any]) -> str:
    """A vehicle that deviates from its class, in words."""
    value = quantity(with_error(x["value"], x["std"]), x["unit"])
    return (
        f"{x['vehicle']}: {quantity_words(x)} = {value}, {abs(x['distance']):.1f} standard deviations from "
        f"the median {x['class_median']:.4g} of {x['vehicles']} vehicles (q = {x['q_value']:.1g})"
    )


def effect_words(e: Mapping[str, Any]) -> str:
    """An effect of a class, in words."""
    of = f" of class {e['class']}" if e["class"] else ""
    size = quantity(with_error(e["size"], e["std"]), e["unit"])
    shown, decided = len(e["shown"]), len(e["shown"]) + len(e["absent"])
    open_ = len(e["possible"]) + len(e["blind"])
    band = "" if e["share"] is None else f" ({e['share_low_95']:.0%} to {e['share_high_95']:.0%})"
    untraced = f", not traced in {len(e['untraced'])}" if e["untraced"] else ""
    return (
        f"{e['kind']}@{e['location']}, {e['parameter']} = {size}: in {shown} of the {decided} "
        f"vehicles{of} that would have shown it{band}, not decided in {open_}{untraced}"
    )


def quantity_words(d: Mapping[str, Any]) -> str:
    """A quantity by the place where it was found."""
    if d["command"] == "estimate" or d["kind"] == "calibrated":
        return str(d["parameter"])
    return f"{d['parameter']} of {d['kind']}@{d['location']}"
