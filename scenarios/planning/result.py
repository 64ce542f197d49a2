"""The result of plan, as it is written to plan.json."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from estimator.closeloop.planning.classes import EffectClass, Splitter
from estimator.closeloop.planning.plan import Plan, Sight
from estimator.sensor_faults import FAULTS
from fmus.effects import EFFECTS
from scenarios.experiment.experiment import Experiment
from scenarios.output import written
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIMES_DIGITS = 3  # significant digits of what is advised, which is computed to first order


@dataclass(frozen=True, repr=False)
class PlanResult(Shown):
    """The plan of an experiment; each field is a key of plan.json.

    seconds: length of the planned record; noise: of each measured output, and whether it is declared; ratio,
    power, false_alarm: what was asked; visible: for each effect and parameter the smallest amplitude that is
    `detected`, that `matters`, and both (`smallest`), null if there is none within the limits; classes: the
    effects that are not told apart, with what would split them; alone: effects that are told from all others;
    hidden: effects that are not detected at the size that is compared, or that cannot be that large;
    refused: changes of the inputs that are not possible.
    """

    experiment: str
    seconds: float
    noise: dict[str, dict[str, Any]]
    ratio: float
    power: float
    false_alarm: float
    policy: str
    visible: list[dict[str, Any]]
    classes: list[dict[str, Any]]
    alone: list[str]
    hidden: list[str]
    refused: dict[str, str]
    wall_seconds: float

    def lines(self) -> list[str]:
        """See Shown.lines."""
        return [*table_of(self)]

    def to_frame(self) -> pd.DataFrame:
        """A row for each parameter of each effect: from which size it is seen, and effects like it."""
        like = {e: c["effects"] for c in self.classes for e in c["effects"]}
        table = pd.DataFrame(self.visible)
        labels = [f"{v['kind']}@{v['location']}" for v in self.visible]
        table["not_told_from"] = [", ".join(e for e in like.get(x, []) if e != x) for x in labels]
        return table.drop(columns="shape", errors="ignore")

    def plot(self, ax: Axes | None = None) -> Axes:
        """The smallest visible size of each effect, as the share of an output that it changes."""
        from scenarios.planning.figures import draw_sizes  # which imports this module

        return draw_sizes(axes_or_new(ax), self)

    def write(self, path: Path) -> None:
        """Write the plan as JSON; an interrupted write leaves no partial file."""
        written(path, json.dumps(asdict(self), indent=1))


def result_of(e: Experiment, found: Plan, seconds: float) -> PlanResult:
    """The result of a plan."""
    question, units = found.question, units_of(found)
    return PlanResult(
        experiment=e.id,
        seconds=question.length,
        noise={
            name: {"std": float(question.std[j]), "declared": e.outputs[name].noise_std is not None}
            for j, name in enumerate(question.measured)
        },
        ratio=question.ratio,
        power=question.power,
        false_alarm=found.comparison.test.false_alarm,
        policy=question.problem.policy.version,
        visible=[line for s in found.sights for line in _lines(s, units)],
        classes=[_class(c, question.length) for c in found.alike],
        alone=sorted(c.members[0].label for c in found.classes if len(c.members) == 1),
        hidden=sorted(s.effect.label for s in found.sights if s.hidden),
        refused=dict(found.refused),
        wall_seconds=round(seconds, 1),
    )


def units_of(found: Plan) -> dict[str, str]:
    """The unit of each parameter of each effect, by its full name."""
    site = found.question.problem.builder.outside()
    chosen = [(s.effect.kind, s.effect.location) for s in found.sights]
    site.build([(EFFECTS[kind], location) for kind, location in chosen if kind in EFFECTS])
    units = {name: v.unit for name, v in site.variables.items()}
    known = found.question.problem.plant.fmu.description.variables
    for kind, location in chosen:
        if kind in FAULTS:
            fault = FAULTS[kind]
            units[f"{kind}_{location}_{fault.parameter}"] = fault.unit.format(known[location].unit or "1")
        elif (wave := f"{kind}_{location}_{EFFECTS[kind].amplitudes[0]}") in units:
            units[f"{kind}_{location}_amplitude"] = units[wave]
    return units


def _lines(s: Sight, units: dict[str, str]) -> Iterator[dict[str, Any]]:
    for v in s.visible:
        name = FAULTS[s.effect.kind].parameter if s.effect.kind in FAULTS else v.parameter
        full = f"{s.effect.kind}_{s.effect.location}_{name}"
        yield {
            "kind": s.effect.kind,
            "location": s.effect.location,
            "parameter": name,
            "unit": units.get(full, ""),
            "detected": _number(v.detected),
            "matters": _number(v.matters),
            "smallest": _number(v.smallest),
            "largest": _number(max(s.largest, v.smallest)),
            "output": v.output,
            "share": _number(v.share),
            "shape": dict(s.shape),
        }


def _class(c: EffectClass, length: float) -> dict[str, Any]:
    return {
        "effects": [m.label for m in c.members],
        "margin": c.margin,
        "score": c.score,
        "pairs": c.pairs,
        "size": _number(c.size),
        "seconds": None if c.times is None else c.times * length,
        "sensors": [_splitter(s) for s in c.sensors],
        "excitations": [_splitter(s) for s in c.excitations],
    }


def _splitter(s: Splitter) -> dict[str, Any]:
    told: dict[str, Any] = {"what": s.what, "pairs": s.pairs, "margin": s.margin, "score": s.score}
    return told | ({"noise": s.noise} if isfinite(s.noise) else {})


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def table_of(result: PlanResult) -> Iterator[str]:
    """The lines that the command prints."""
    seen = len(result.alone) + sum(len(c["effects"]) for c in result.classes)
    yield (
        f"{result.experiment}: {result.seconds:g} s; of {seen + len(result.hidden)} effects, {seen} "
        f"could be seen, {len(result.alone)} of these told from all others"
    )
    yield (
        f"compared with residuals of {result.ratio:g} times the noise; false alarm {result.false_alarm:.2g}, "
        f"power {result.power:g}"
    )
    for c in result.classes:
        yield f"not told apart: {', '.join(c['effects'])}"
        yield f"    {_advice(c)}"
    if result.hidden:
        yield f"not visible: {', '.join(result.hidden)}"


def _advice(c: dict[str, Any]) -> str:
    """What would split a class, in one line."""
    found = []
    for kind, words in (("sensors", "sensor"), ("excitations", "input")):
        if c[kind]:
            best = c[kind][0]
            found.append(f"{words} {best['what']} ({best['pairs']} of {c['pairs']} pairs)")
    if c["size"] is not None:
        found.append(f"effects {c['size']:.{TIMES_DIGITS}g} times as large")
    if c["seconds"] is not None:
        found.append(f"a record of {c['seconds']:.{TIMES_DIGITS}g} s")
    return "would be split by: " + "; ".join(found) if found else "nothing that was tried would split them"
