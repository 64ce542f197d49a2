"""The results of several experiments, as they are written to results.json and table.csv."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from estimator.closeloop.decision.model_form import gap_closed
from estimator.closeloop.several.chart import chart
from estimator.closeloop.several.common import Common
from estimator.closeloop.several.estimates import Estimates
from estimator.closeloop.several.standing import Standing
from estimator.closeloop.several.transfer import Status, Traced, Transfer
from scenarios.closing.page.glossary import glossary
from scenarios.closing.result import Effect, Figure, Result
from scenarios.output import written
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Table = dict[str, str | float]
COLUMNS = (
    "experiment", "verdict", "effects", "gap_closed", "output", "unit", "before", "after", "noise",
    "seconds", "together", "report",
)  # fmt: skip


@dataclass(frozen=True)
class Carried:
    """An effect found in `source` and tested on the record of `target`.

    status: see estimator.closeloop.several.transfer.Status.
    error: RMSE on the test part of `target` by output: `before` without an effect, `transferred` with the
    values found in `source`, `own` with values fitted to `target`, and `noise`.
    distance: difference between both sets of values in standard errors; p_value: probability of at least this
    distance by chance.
    free: parameters that `source` does not determine.
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
    """An effect fitted with one value for several experiments.

    parameters: [value, standard error] by the names in the FMU; units: their units.
    alone: the parameters from each experiment's own fit.
    chi2, chi2_alone: mean square of the weighted residual on the identify part, with the common values and
    with the experiment's own values.
    rise: increase of the sum of squares caused by one value for all; p_value: probability of at least this
    increase if one value is true for all.
    serves: whether the effect with common values accounts for the residual of every experiment.
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


@dataclass(frozen=True, repr=False)
class Results(Shown):
    """The results of close_loops.

    together: for each experiment, a sentence on what the other records of the same FMU say about its finding.
    units: for each experiment, the units of its outputs.
    interrupted: whether the run stopped before all experiments were finished.
    """

    results: list[Result]
    transfers: list[Carried] = field(default_factory=list)
    joint: list[Joint] = field(default_factory=list)
    together: dict[str, str] = field(default_factory=dict)
    units: dict[str, dict[str, str]] = field(default_factory=dict)
    interrupted: bool = False

    @property
    def table(self) -> list[Table]:
        """One row per experiment, for the output with the largest error over noise; keys are COLUMNS."""
        return [self._row(r) for r in self.results]

    def lines(self) -> list[str]:
        """See Shown.lines."""
        from scenarios.closing.lines import table_of  # which imports this module

        return [*table_of(self)]

    def to_frame(self) -> pd.DataFrame:
        """The table as it is written to table.csv, a row for each experiment."""
        return pd.DataFrame(self.table, columns=[*COLUMNS]).set_index("experiment")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Errors before and after over the noise, of the worst output of each experiment."""
        table = self.to_frame()
        ratios = table[["before", "after"]].astype(float).div(table["noise"].astype(float), axis=0)
        drawn: Axes = ratios.plot.bar(ax=axes_or_new(ax), logy=True, rot=0)
        drawn.axhline(1.0, color="0.5", linewidth=0.8)
        drawn.set(xlabel="", ylabel="error over noise of the worst output")
        return drawn

    def write(self, folder: Path) -> None:
        """Write results.json and table.csv; an interrupted write leaves no part of a file."""
        written(folder / "results.json", json.dumps(asdict(self), indent=1))
        table = io.StringIO(newline="")
        writer = csv.DictWriter(table, COLUMNS)
        writer.writeheader()
        writer.writerows(self.table)
        written(folder / "table.csv", table.getvalue())

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
    """An effect as the text of one cell: kind@location NAME = value +- error, ..."""
    values = ", ".join(f"{n} = {v:.4g} +- {s:.2g}" for n, (v, s) in e.parameters.items())
    return f"{e.kind}@{e.location} {values}"


def carried(t: Transfer, target: Traced) -> Carried:
    """The numbers of a transfer to the record of `target`."""
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
    """The numbers of a joint fit; target: one of its records, which supplies the units."""
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
    """The conclusion on each experiment's finding; experiments without a conclusion are left out."""
    return {s.record: s.sentence for s in standings if s.sentence}
