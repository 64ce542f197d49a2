"""What close-loop found, as it is written to result.json."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

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

Figure = list[float]  # value and standard error


@dataclass(frozen=True)
class Effect:
    """An effect found: kind, location, and its parameters as [value, standard error] in SI."""

    kind: str
    location: str
    parameters: dict[str, Figure]


@dataclass(frozen=True)
class Alternative:
    """A hypothesis that was rejected; score: log score on the part to choose, less that of the best."""

    kind: str
    location: str
    score: float


@dataclass(frozen=True)
class Result:
    """The contract's result of close-loop; `error` holds RMSE on the test part by output.

    decision: the checks that the verdict follows from, in their order, with the number and the limit of each;
    policy: the version of all limits. In `error`, `placebo` is that of the best wrong effect, `black_box`
    that of the calibrated FMU with a linear model of its residual. power: the smallest effects that the
    record would have shown, null where none; free_form: where nothing explains, the curve that comes nearer,
    which `after` and the FMU then hold.
    seconds: of wall time, by stage. start_values: of the states that are not declared, see start_values.
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

    def write(self, path: Path) -> None:
        """Write as JSON, whole or not at all."""
        part = path.with_suffix(".part")
        part.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        part.replace(path)


def result_of(
    name: str,
    problem: Problem,
    found: Outcome,
    seconds: float,
    augmented: Sequence[Path],
) -> Result:
    """Put an outcome into the contract's words; augmented: files of the augmented FMU, the FMU first."""
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
        notes=[n.sentence for n in problem.record.notes],
        augmented_fmu=augmented[0].name if augmented else "",
        augmented_files=[file.name for file in augmented],
        power=[_line(v) for v in diagnostics.power] if diagnostics else [],
        nomination=_nomination(diagnostics) if diagnostics else {},
        free_form=_curve(curve) if curve else {},
        seconds={stage: round(s, 2) for stage, s in found.seconds.items()},
        start_values=start_values(problem, found),
    )


def start_values(problem: Problem, found: Outcome) -> dict[str, dict[str, Any]]:
    """Start values that are not declared, by state: `value`, and `how` it came about.

    "fitted", with `std_error`; all others are left at the FMU's own start value, None where it states none:
    "not seen" where another start would not have shown in the residual; of outputs of a foreign FMU that are
    measured or at a port, "not settable" where it takes no start value, "not exact" where it does not say
    that the start value is exactly that of the state.
    """
    fitted, known = found.base.fit, describe(problem.builder(())).variables
    best = found.built_in or found.base
    table: dict[str, dict[str, Any]] = {}
    for name in problem.free_states:
        if name in fitted.std:
            fit = best.fit if name in best.fit.std else fitted
            table[name] = {"how": "fitted", "value": fit.theta[name], "std_error": fit.std[name]}
        else:
            table[name] = {"how": "not seen", "value": known[name].start}
    if isinstance(problem.builder, ForeignBuilder):  # our own outputs are states, or worked out from these
        own = describe(problem.builder.fmu).variables
        at_ports = [name for port in problem.ports for name in (port.displacement, port.velocity)]
        for name in dict.fromkeys([*problem.record.outputs, *at_ports]):
            if name not in (*problem.free_states, *problem.declared):
                how = "not settable" if own[name].initial == "calculated" else "not exact"
                table[name] = {"how": how, "value": own[name].start}
    return table


def errors(problem: Problem, found: Outcome, best: Hypothesis) -> dict[str, Array]:
    """RMSE on the test part, free run, of everything that is compared, (n_y,) each, and the noise floor."""
    compared = {"declared": found.declared, "before": found.base, "after": best}
    wrong = best_wrong(found)
    if wrong:
        compared["placebo"] = wrong
    rms = {k: h.rms(problem, "test") for k, h in compared.items()}
    if found.diagnostics:
        rms["black_box"] = found.diagnostics.black_box.rms
    return rms | {"noise": found.noise}


def best_wrong(found: Outcome) -> Hypothesis | None:
    """The best single hypothesis that was rejected: an error that any effect of the kind would reach.

    A law that becomes a member at a limit of its shape, or that a member becomes, holds what was found: its
    error says nothing of a wrong effect, and it is passed over.
    """
    members = found.judgement.members
    return next((h for h in found.singles if h not in members and not _nested(h, members)), None)


def _nested(h: Hypothesis, members: Sequence[Hypothesis]) -> bool:
    return any(becomes(h, m) or becomes(m, h) for m in members)


def _check(c: Check) -> dict[str, Any]:
    """A line of the decision; JSON has no infinity."""
    return {
        "check": c.name,
        "value": c.value if np.isfinite(c.value) else None,
        "limit": c.limit,
        "passed": c.passed,
    }


def _line(v: Visible) -> dict[str, Any]:
    """A line of the power statement; JSON has no infinity."""
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
    if is_wave(c):  # the size of sine and cosine together is what an engineer asks for
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
    """Rejected hypotheses, best first; pairs are named by their parts joined with '+'."""
    best = found.chosen or found.base
    rejected = [h for h in (*found.pairs, *found.singles) if h not in found.judgement.members]
    rows = [
        Alternative(
            "+".join(c.kind for c in h.candidates),
            "+".join(c.location for c in h.candidates),
            -found.baseline.lead(best, h)[0],
        )
        for h in rejected
    ]
    return sorted(rows, key=lambda r: -r.score)


def _unique(effects: Any) -> list[Effect]:
    seen: dict[tuple[str, str], Effect] = {}
    for e in effects:
        seen.setdefault((e.kind, e.location), e)
    return list(seen.values())
