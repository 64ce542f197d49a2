"""What close-loop found, as it is written to result.json."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.chain import Outcome
from estimator.closeloop.compare import Hypothesis, lead
from estimator.closeloop.problem import Problem
from estimator.closeloop.verdict import Verdict, gap_closed

Figure = list[float]  # value and standard error


@dataclass(frozen=True)
class Effect:
    """An effect found: kind, location, and its parameters as [value, standard error] in SI."""

    kind: str
    location: str
    parameters: dict[str, Figure]


@dataclass(frozen=True)
class Alternative:
    """A hypothesis that was rejected; score: held-out log score below that of the best, 0 at most."""

    kind: str
    location: str
    score: float


@dataclass(frozen=True)
class Result:
    """The contract's result of close-loop; `error` holds RMSE on the test part by output."""

    experiment: str
    verdict: Verdict
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

    def write(self, path: Path) -> None:
        """Write as JSON, whole or not at all."""
        part = path.with_suffix(".part")
        part.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        part.replace(path)


def result_of(name: str, problem: Problem, found: Outcome, seconds: float, augmented: Path | None) -> Result:
    """Put an outcome into the contract's words."""
    members = found.judgement.members
    best = found.chosen or found.base
    errors = {"declared": found.declared, "before": found.base, "after": best}
    rms = {k: h.rms(problem) for k, h in errors.items()}
    rms["noise"] = found.noise
    outputs = problem.record.outputs
    closed = gap_closed(rms["before"], rms["after"], found.noise)
    return Result(
        experiment=name,
        verdict=found.judgement.verdict,
        effects=list(_unique(e for h in members for e in effects_of(h))),
        alternatives=alternatives(problem, found),
        calibrated={n: _figure(best, n) for n in problem.calibrate},
        error={o: {k: float(v[j]) for k, v in rms.items()} for j, o in enumerate(outputs)},
        wall_seconds=round(seconds, 1),
        reason=found.judgement.reason,
        next_experiment=found.judgement.next_experiment,
        gap_closed={o: float(closed[j]) for j, o in enumerate(outputs)} if members else {},
        detection={
            "p_value": found.detection.p_value,
            "material": found.detection.material,
            "figures": dict(found.detection.figures),
        },
        notes=[n.sentence for n in problem.record.notes],
        augmented_fmu=augmented.name if augmented else "",
    )


def effects_of(h: Hypothesis) -> list[Effect]:
    """The effects of a hypothesis with their parameters."""
    return [Effect(c.kind, c.location, _parameters(h, c)) for c in h.candidates]


def _parameters(h: Hypothesis, c: Candidate) -> dict[str, Figure]:
    prefix = f"{c.kind}_{c.location}_"
    if c.is_fault:
        return {c.kind.removeprefix("sensor_"): _figure(h, c.amplitudes[0].name)}
    found = {u.name.removeprefix(prefix): _figure(h, u.name) for u in c.unknowns}
    if len(c.amplitudes) == 2:  # a sine and a cosine: their size is what an engineer asks for
        values, errors = np.array([found[u.name.removeprefix(prefix)] for u in c.amplitudes]).T
        size = float(np.hypot(*values))
        found["amplitude"] = [size, float(np.hypot(*(values * errors)) / size) if size else 0.0]
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
            -lead(problem, best, h, found.size)[0],
        )
        for h in rejected
    ]
    return sorted(rows, key=lambda r: -r.score)


def _unique(effects: Any) -> list[Effect]:
    seen: dict[tuple[str, str], Effect] = {}
    for e in effects:
        seen.setdefault((e.kind, e.location), e)
    return list(seen.values())
