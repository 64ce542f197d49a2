"""The result of close-loop, as it is written to result.json."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from estimator.closeloop.decision.model_form import gap_closed
from estimator.closeloop.diagnostics.diagnostics import Diagnostics
from estimator.closeloop.diagnostics.power import Visible
from estimator.closeloop.evidence import Check, Verdict
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.relations import becomes
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.regressors import is_wave
from estimator.closeloop.search.free_form import curve_of
from estimator.record import Array
from estimator.sensor_faults import FAULTS
from fmus.export.builders.hypotheses import ForeignBuilder
from fmus.host.archive import describe
from scenarios.closing.notes import notes_of
from scenarios.output import written
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Figure = list[float]  # value and standard error


@dataclass(frozen=True)
class Effect:
    """An effect found: kind, location, and its parameters as [value, standard error] in SI."""

    kind: str
    location: str
    parameters: dict[str, Figure]


@dataclass(frozen=True)
class Alternative:
    """A rejected hypothesis; score: its log score on the part to choose minus that of the best one."""

    kind: str
    location: str
    score: float


@dataclass(frozen=True, repr=False)
class Result(Shown):
    """The result of close-loop, one field for each key of result.json.

    decision: the checks that lead to the verdict, in order, each with its value and limit.
    probability: of each answer, by its label, most probable first; what is missing to 1 is none of these.
    policy: the version of all limits.
    error: RMSE on the test part by output. `placebo` is the error with the best wrong effect. `black_box` is
    the error of the calibrated FMU with a linear model of its residual.
    power: the smallest size of each effect that the record would have shown, null if it could show none.
    free_form: the curve that comes nearest if no effect explains the residual; `after` and the augmented FMU
    then contain this curve.
    seconds: wall time by stage.
    start_values: see the function start_values.
    """

    experiment: str
    verdict: Verdict
    decision: list[dict[str, Any]]
    policy: str
    effects: list[Effect]
    alternatives: list[Alternative]
    calibrated: dict[str, Figure]
    error: dict[str, dict[str, float]]
    wall_seconds: float
    reason: str
    next_experiment: str
    gap_closed: dict[str, float]
    detection: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    augmented_fmu: str = ""
    augmented_files: list[str] = field(default_factory=list)
    power: list[dict[str, Any]] = field(default_factory=list)
    nomination: dict[str, Any] = field(default_factory=dict)
    free_form: dict[str, Any] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    start_values: dict[str, dict[str, Any]] = field(default_factory=dict)
    probability: dict[str, float] = field(default_factory=dict)

    @property
    def weighed(self) -> bool:
        """Whether answers were compared; where none has a thousandth of the probability, none is listed."""
        return bool(self.probability) or self.verdict == "unexplained"

    def lines(self) -> list[str]:
        """See Shown.lines."""
        from scenarios.closing.lines import lines_of  # which imports this module

        return [*lines_of(self)]

    def to_frame(self) -> pd.DataFrame:
        """Error of each output on the test part, in the FMU's units: a row each, a column each model."""
        return pd.DataFrame(self.error).T.rename_axis("output")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Errors before and after over the noise, as bars for each output."""
        table = self.to_frame()
        ratios = table[["before", "after"]].div(table["noise"], axis=0)
        drawn: Axes = ratios.plot.bar(ax=axes_or_new(ax), logy=True, rot=0)
        drawn.axhline(1.0, color="0.5", linewidth=0.8)
        drawn.set(ylabel="error over noise", title=f"{self.experiment}: {self.verdict}")
        return drawn

    def write(self, path: Path) -> None:
        """Write the result as JSON; an interrupted write leaves no partial file."""
        written(path, json.dumps(asdict(self), indent=1))


def none_of_these(said: Mapping[str, float]) -> float:
    """The probability that the probabilities of all answers leave for a mechanism outside the library."""
    return max(0.0, 1 - sum(said.values()))


def result_of(
    name: str,
    problem: Problem,
    found: Outcome,
    seconds: float,
    augmented: Sequence[Path],
) -> Result:
    """The result of an outcome; augmented: files of the augmented FMU, the FMU itself first."""
    members, diagnostics, curve = found.judgement.members, found.diagnostics, found.free_form
    best = found.built_in or found.base
    rms = errors(problem, found, best)
    outputs = problem.record.outputs
    closed = gap_closed(rms["before"], rms["after"], found.noise)
    return Result(
        experiment=name,
        verdict=found.judgement.verdict,
        decision=[_check(c) for c in found.judgement.checks],
        policy=problem.policy.version,
        effects=list(_unique(e for h in members for e in effects_of(h))),
        alternatives=alternatives(problem, found),
        calibrated={n: _figure(best, n) for n in problem.calibrate},
        error={o: {k: float(v[j]) for k, v in rms.items()} for j, o in enumerate(outputs)},
        wall_seconds=round(seconds, 1),
        reason=found.judgement.reason,
        next_experiment=found.judgement.next_experiment,
        gap_closed={o: float(closed[j]) for j, o in enumerate(outputs)} if members or curve else {},
        detection={
            "p_value": found.detection.p_value,
            "material": found.detection.material,
            "figures": dict(found.detection.figures),
        },
        notes=notes_of(problem, found, rms),
        augmented_fmu=augmented[0].name if augmented else "",
        augmented_files=[file.name for file in augmented],
        power=[_line(v) for v in diagnostics.power] if diagnostics else [],
        nomination=_nomination(diagnostics) if diagnostics else {},
        free_form=_curve(curve) if curve else {},
        seconds={stage: round(s, 2) for stage, s in found.seconds.items()},
        start_values=start_values(problem, found),
        probability={label: round(p, 4) for label, p in found.probability.items()},
    )


def start_values(problem: Problem, found: Outcome) -> dict[str, dict[str, Any]]:
    """Start values that the experiment does not declare, by state: `value`, and `how` it was obtained.

    "fitted": estimated, with `std_error`. All others keep the FMU's own start value, or None if it has none.
    "not seen": another start value would not have changed the residual.
    The last two apply to a foreign FMU's outputs that are measured or belong to a port.
    "not settable": the FMU accepts no start value.
    "not exact": the FMU does not state that the start value is exactly that of the state.
    """
    fitted, known = found.base.fit, describe(problem.fmu).variables
    best = found.built_in or found.base
    table: dict[str, dict[str, Any]] = {}
    for name in problem.free_states:
        if name in fitted.std:
            fit = best.fit if name in best.fit.std else fitted
            table[name] = {"how": "fitted", "value": fit.theta[name], "std_error": fit.std[name]}
        else:
            table[name] = {"how": "not seen", "value": known[name].start}
    if isinstance(problem.builder, ForeignBuilder):  # outputs of our models follow from states
        own = describe(problem.builder.source).variables
        at_ports = [name for port in problem.ports for name in port.motion]
        for name in dict.fromkeys([*problem.record.outputs, *at_ports]):
            if name not in (*problem.free_states, *problem.declared):
                how = "not settable" if own[name].initial == "calculated" else "not exact"
                table[name] = {"how": how, "value": own[name].start}
    return table


def errors(problem: Problem, found: Outcome, best: Hypothesis) -> dict[str, Array]:
    """RMSE on the test part in free simulation of each compared model, (n_y,) each, and the noise floor."""
    compared = {"declared": found.declared, "before": found.base, "after": best}
    wrong = best_wrong(found)
    if wrong:
        compared["placebo"] = wrong
    rms = {k: h.rms(problem, "test") for k, h in compared.items()}
    if found.diagnostics:
        rms["black_box"] = found.diagnostics.black_box.rms
    return rms | {"noise": found.noise}


def best_wrong(found: Outcome) -> Hypothesis | None:
    """The best rejected single effect; its error shows what a wrong effect can reach.

    A law is skipped if it turns into the law found at a limit of its shape, or the law found turns into it:
    such a law contains the right effect, so its error says nothing about a wrong one.
    """
    members = found.judgement.members
    singles = (h for h in found.rejected if len(h.candidates) == 1)
    return next((h for h in singles if not _nested(h, members)), None)


def _nested(h: Hypothesis, members: Sequence[Hypothesis]) -> bool:
    return any(becomes(h, m) or becomes(m, h) for m in members)


def _check(c: Check) -> dict[str, Any]:
    """A check of the decision as a row; an infinite value becomes null, as JSON has no infinity."""
    return {
        "check": c.name,
        "value": c.value if np.isfinite(c.value) else None,
        "limit": c.limit,
        "passed": c.passed,
    }


def _line(v: Visible) -> dict[str, Any]:
    """A row of the power statement; an infinite size becomes null, as JSON has no infinity."""
    sizes = {k: x if np.isfinite(x) else None for k, x in (("smallest", v.smallest), ("largest", v.largest))}
    return {"kind": v.kind, "location": v.location, "parameter": v.parameter, **sizes, "shape": v.shape}


def _nomination(h: Diagnostics) -> dict[str, Any]:
    stable = {label: share for label, share in h.stability.items() if share > 0}
    return {"decoy_gain": h.decoy_gain, "stability": stable}


def _curve(h: Hypothesis) -> dict[str, Any]:
    c = curve_of(h)
    lines = {name: getattr(c, name).tolist() for name in ("x", "force", "std")}
    return {"kind": c.kind, "location": c.location, "against": c.against, **lines}


def effects_of(h: Hypothesis) -> list[Effect]:
    """The effects of a hypothesis with their parameters."""
    return [Effect(c.kind, c.location, _parameters(h, c)) for c in h.candidates]


def _parameters(h: Hypothesis, c: Candidate) -> dict[str, Figure]:
    prefix = c.prefix
    if c.is_fault:
        return {FAULTS[c.kind].parameter: _figure(h, c.amplitudes[0].name)}
    found = {u.name.removeprefix(prefix): _figure(h, u.name) for u in c.unknowns}
    if is_wave(c):  # engineers need the resultant amplitude of sine and cosine
        names = [u.name for u in h.fit.unknowns]
        i = [names.index(u.name) for u in c.amplitudes]
        values, covariance = h.fit.values[i], h.fit.covariance[np.ix_(i, i)]
        size = float(np.hypot(*values))
        along = values / size if size else np.full(2, np.sqrt(0.5))
        found["amplitude"] = [size, float(np.sqrt(along @ covariance @ along))]
    return found


def _figure(h: Hypothesis, name: str) -> Figure:
    return [h.fit.theta[name], h.fit.std[name]]


def alternatives(problem: Problem, found: Outcome) -> list[Alternative]:
    """Rejected hypotheses, best first; the names of a pair of effects are joined by '+'."""
    best = found.chosen or found.base
    rows = [
        Alternative(
            "+".join(c.kind for c in h.candidates),
            "+".join(c.location for c in h.candidates),
            -found.baseline.lead(best, h)[0],
        )
        for h in found.rejected
    ]
    return sorted(rows, key=lambda r: -r.score)


def _unique(effects: Any) -> list[Effect]:
    seen: dict[tuple[str, str], Effect] = {}
    for e in effects:
        seen.setdefault((e.kind, e.location), e)
    return list(seen.values())
