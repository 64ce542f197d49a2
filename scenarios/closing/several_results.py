"""What several closed loops found together, as it is written to results.json and table.csv."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from estimator.closeloop.decision.model_form import gap_closed
from estimator.closeloop.several.chart import chart
from estimator.closeloop.several.common import Common
from estimator.closeloop.several.estimates import Estimates
from estimator.closeloop.several.standing import Standing
from estimator.closeloop.several.transfer import Status, Traced, Transfer
from scenarios.closing.page.glossary import glossary
from scenarios.closing.result import Effect, Figure, Result

Table = dict[str, str | float]
COLUMNS = (
    "experiment", "verdict", "effects", "gap_closed", "output", "unit", "before", "after", "noise",
    "seconds", "together", "report",
)  # fmt: skip


@dataclass(frozen=True)
class Carried:
    """An effect found in `source`, in the FMU of `target`; see estimator.closeloop.several.transfer.Status.

    error: RMSE on the test part of `target` by output, `before` without an effect, `transferred` with the
    values of `source`, `own` with values fitted to `target`, and `noise`; distance: between both values in
    standard errors, p_value its chance; free: values that `source` does not tell.
    """

    source: str
    target: str
    effect: str
    status: Status
    reason: str
    error: dict[str, dict[str, float]] = field(default_factory=dict)
    gap_closed: dict[str, float] = field(default_factory=dict)
    distance: float | None = None
    p_value: float | None = None
    free: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Joint:
    """An effect with one value for several experiments; parameters by the FMU's names, [value, error].

    units: of the parameters.

    alone: the same of each experiment's own fit; chi2, chi2_alone: mean square of the weighted residual on
    the identify part with the common values and with its own; rise: of the sum of squares by having one value
    for all, and p_value its chance where one value is true; serves: whether it accounts for all of them.
    """

    effect: str
    experiments: list[str]
    parameters: dict[str, Figure]
    units: dict[str, str]
    alone: dict[str, dict[str, Figure]]
    chi2: dict[str, float]
    chi2_alone: dict[str, float]
    rise: float
    p_value: float
    serves: bool
    reason: str


@dataclass(frozen=True)
class Results:
    """All that close_loops found.

    together: by experiment what the others of the same FMU say of its finding; units: of its outputs;
    interrupted: not all that was asked for was done.
    """

    results: list[Result]
    transfers: list[Carried] = field(default_factory=list)
    joint: list[Joint] = field(default_factory=list)
    together: dict[str, str] = field(default_factory=dict)
    units: dict[str, dict[str, str]] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def table(self) -> list[Table]:
        """One row an experiment, with the output that is farthest from its noise; keys are COLUMNS."""
        return [self._row(r) for r in self.results]

    def write(self, folder: Path) -> None:
        """results.json and table.csv, each whole or not at all."""
        part = folder / "results.part"
        part.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        part.replace(folder / "results.json")
        with part.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(self.table)
        part.replace(folder / "table.csv")

    def _row(self, r: Result) -> Table:
        output = max(r.error, key=lambda o: r.error[o]["after"] / r.error[o]["noise"])
        return {
            "experiment": r.experiment,
            "verdict": r.verdict,
            "effects": "; ".join(effect_text(e) for e in r.effects),
            "gap_closed": r.gap_closed.get(output, ""),
            "output": output,
            "unit": self.units.get(r.experiment, {}).get(output, ""),
            **{k: r.error[output][k] for k in ("before", "after", "noise")},
            "seconds": r.wall_seconds,
            "together": self.together.get(r.experiment, ""),
            "report": f"{r.experiment}/report.html",
        }


def effect_text(e: Effect) -> str:
    """An effect in a cell: kind@location NAME = value +- error, ..."""
    values = ", ".join(f"{n} = {v:.4g} +- {s:.2g}" for n, (v, s) in e.parameters.items())
    return f"{e.kind}@{e.location} {values}"


def carried(t: Transfer, target: Traced) -> Carried:
    """A transfer in figures."""
    said = Carried(t.source, t.target, t.member.label, t.status, t.reason)
    if t.held is None or t.own is None or t.difference is None:
        return said
    problem, noise = target.problem, target.found.noise
    rms = {"before": target.found.base, "transferred": t.held, "own": t.own}
    figures = {k: h.rms(problem, "test") for k, h in rms.items()} | {"noise": noise}
    closed = gap_closed(figures["before"], figures["transferred"], noise)
    outputs = problem.record.outputs
    return Carried(
        **{k: getattr(said, k) for k in ("source", "target", "effect", "status", "reason")},
        error={o: {k: float(v[j]) for k, v in figures.items()} for j, o in enumerate(outputs)},
        gap_closed={o: float(closed[j]) for j, o in enumerate(outputs)},
        distance=t.difference.distance,
        p_value=t.difference.p_value,
        free=list(t.loose),
    )


def joint(c: Common, target: Traced) -> Joint:
    """A joint fit in figures; target: one of its records."""
    each = dict(zip(c.names, c.said, strict=True))
    effects = [x for x in c.alone[0].candidates if x.label in c.label.split(" + ")]
    words = glossary(target.problem, [c.alone[0]])
    units = {
        u.name: words.unit_of_parameter(x, u.name.removeprefix(x.prefix))
        for x in effects
        for u in chart([x]).machine
    }
    return Joint(
        c.label,
        list(c.names),
        _figures(c.together.shared),
        units,
        {name: _figures(said) for name, said in each.items()},
        dict(zip(c.names, c.chi2, strict=True)),
        dict(zip(c.names, c.chi2_alone, strict=True)),
        c.likeness.rise,
        c.likeness.p_value,
        c.serves,
        c.sentence,
    )


def _figures(said: Estimates) -> dict[str, Figure]:
    return {n: list(f) for n, f in said.figures.items()}


def together(standings: Sequence[Standing]) -> Mapping[str, str]:
    """What each comes to, by experiment; those left out of which nothing is to be said."""
    return {s.record: s.sentence for s in standings if s.sentence}
