"""What a worker does with one record: check, estimate or close-loop, and the rows that say what was found."""

import time
from collections.abc import Iterator, Mapping
from math import isfinite, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.several.chart import chart
from estimator.plant import PLANTS
from fmus.errors import BadInput
from fmus.export.builders.hypotheses import build_quick
from fmus.host.apart.isolation import Isolation
from fmus.host.grading.check import grade
from fmus.models import model_class
from scenarios.closing.closing import Posed, closed, with_test_part
from scenarios.closing.page.glossary import Glossary, glossary
from scenarios.closing.result import Result, effects_of
from scenarios.estimating.estimating import estimate
from scenarios.estimating.policy import POLICY as OF_ESTIMATE
from scenarios.estimating.result import EstimateResult
from scenarios.estimating.setup import BAND
from scenarios.experiment.declaration import Declaration
from scenarios.experiment.experiment import Experiment, placed
from scenarios.experiment.validation import of_file, read_table
from scenarios.fleet.beliefs import alone
from scenarios.fleet.declaration import CALIBRATED
from scenarios.fleet.policy import POLICY
from scenarios.tasks.hashes import hash_of_data
from scenarios.tasks.running import Passing, Place, may_pass
from scenarios.tasks.store import FAILED, Answer

Row = dict[str, Any]


def answered(given: Mapping[str, Any], place: Place) -> Answer:
    """The answer of a task: rows of what was found, or one row with the reason why nothing was.

    given: `command`, `model` or `fmu` (its checksum), `isolation`, and of a record `table` (its experiment),
    `file` (which messages name), `data_sha256` and `seed`. Raises the error of a reason that may pass,
    such as a full disk.
    """
    try:
        return {"check": _check, "estimate": _estimate, "close-loop": _close_loop}[given["command"]](
            given, place
        )
    except Exception as error:  # whatever one record does, it is one row
        if may_pass(error):
            raise
        said = str(error) if isinstance(error, BadInput) else f"{type(error).__name__}: {error}"
        return failed(place.without(said).replace(f"{Path(given.get('file', '')).parent}/", ""))
    finally:
        PLANTS.close()


def failed(reason: str) -> Answer:
    """The answer of a task that cannot be done, with the reason."""
    return {"verdict": FAILED, "rows": [{"verdict": FAILED, "reason": " ".join(reason.split())}]}


def _experiment(given: Mapping[str, Any], place: Place) -> Experiment:
    """The experiment of a task with the FMU that was shipped; Passing if its data have changed."""
    file, table = Path(given["file"]), dict(given["table"])
    if given["fmu"]:
        table["fmu"] = str(place.fmu(given["fmu"]))
    else:
        table["model"] = given["model"]
    with of_file(file):
        e = placed(read_table(Declaration, table), file)
    for data in e.data_files:
        if hash_of_data(data) != given["data_sha256"]:
            raise Passing(f"{data}: has changed since the fleet was planned; run the command again")
    return e


def _isolation(given: Mapping[str, Any]) -> Isolation | None:
    return Isolation(**given["isolation"]) if given["isolation"] else None


def _builds(given: Mapping[str, Any], place: Place) -> Path:
    """The folder of the builds of a task's model, which all records of the model share."""
    folder = place.builds / str(given["fmu"] or given["model"])
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _check(given: Mapping[str, Any], place: Place) -> Answer:
    """One row for each trial of the FMU."""
    if given["fmu"]:
        fmu = place.fmu(given["fmu"])
    else:
        fmu = build_quick(model_class(given["model"])(), _builds(given, place) / "checked")
    found = grade(fmu)
    words = {True: "passed", False: "failed check", None: "not offered"}
    rows = [{"kind": c.title, "verdict": words[c.passed], "reason": c.sentence} for c in found.checks]
    return {"verdict": words[found.ok], "rows": rows}


def _estimate(given: Mapping[str, Any], place: Place) -> Answer:
    """One row for each state, parameter and unknown input, with its last value."""
    e = _experiment(given, place)
    found = estimate(e, isolation=_isolation(given), builds=_builds(given, place))
    verdict = "diverged" if found.diverged else "consistent" if found.consistent else "inconsistent"
    reason = found.reason if found.diverged else found.doubt
    rows = [*_estimated(found)] or [{}]
    return {"verdict": verdict, "rows": [{**row, "verdict": verdict, "reason": reason or ""} for row in rows]}


def _estimated(found: EstimateResult) -> Iterator[Row]:
    own = _own(found)
    for name, e in found.estimated.items():
        if e["kind"] == "noise":  # of a sensor at the last sample, of which nothing follows for the machine
            continue
        low, high = e["band_95"]
        yield {
            "kind": e["kind"], "location": name, "parameter": name, "size": finite(e["value"]),
            "std": finite(e["std_error"]), "low_95": finite(low), "high_95": finite(high),
            "unit": e["unit"] or "", **_leaning(e), **own.get(name, {}),
        }  # fmt: skip


def _own(found: EstimateResult) -> dict[str, Row]:
    """What the record alone says of each constant parameter, by name; none where that is not known."""
    after = found.identifiability.get("after")
    if after is None or found.diverged:
        return {}
    told = [*after["deviation_left"]]
    names = [n for n in told if "prior" in found.estimated[n] and "at_bound" not in found.estimated[n]]
    if not names:
        return {}
    at = [told.index(n) for n in names]
    entries = [found.estimated[n] for n in names]
    value, std = (np.array([e[key] for e in entries]) for key in ("value", "std_error"))
    start, believed = np.array([e["prior"] for e in entries]).T
    own, error = alone(value, std, np.array(after["correlation"])[np.ix_(at, at)], start, believed)
    return {
        n: {"own": finite(x), "own_std": finite(s)}
        for n, x, s in zip(names, own.tolist(), error.tolist(), strict=True)
    }


def _leaning(e: Mapping[str, Any]) -> Row:
    """How far an estimate is that of the record: what was believed before it, and why it says nothing."""
    start, deviation = e.get("prior", (None, None))
    held = "at a bound" if "at_bound" in e else "" if e.get("informed_by_data", True) else "not in the record"
    return {"prior": start, "prior_std": deviation, "held": held}


def _close_loop(given: Mapping[str, Any], place: Place) -> Answer:
    """A row for each parameter of each effect in the answer and each calibrated one, and what was visible."""
    e = with_test_part(_experiment(given, place))
    posed = Posed.of(e, _builds(given, place), _isolation(given))
    begun = time.monotonic()
    found, result = closed(posed, None, lambda _: None, 1, given["seed"], begun, Stages())
    ratios = [x["after"] / x["noise"] for x in result.error.values() if x["noise"]]
    common = {
        "verdict": str(result.verdict),
        "reason": result.reason,
        "error_over_noise": finite(max(ratios)) if ratios else None,
        "policy": result.policy,
    }
    words = glossary(found.baseline.problem, found.judgement.members)
    rows = [*_effects(found, result, words), *_calibrated(found, result, words)]
    return {
        "verdict": str(result.verdict),
        "rows": [{**row, **common} for row in rows],
        "visible": [
            {k: line[k] for k in ("kind", "location", "parameter", "smallest", "largest")}
            for line in result.power
        ],
        "decision": result.decision,
    }


def _effects(found: Outcome, result: Result, words: Glossary) -> Iterator[Row]:
    """The effects of the answer; of one without effects a row that has none."""
    members = found.judgement.members
    if not members:
        yield {"probability": result.probability.get("no_discrepancy")}
    for h in members:
        for c, effect in zip(h.candidates, effects_of(h), strict=True):
            named = {
                "kind": c.kind, "location": c.location, "probability": result.probability.get(h.label),
            }  # fmt: skip
            machine = None if c.is_fault else {u.name.removeprefix(c.prefix) for u in chart([c]).machine}
            for parameter, (size, std) in effect.parameters.items():
                held = "" if machine is None or parameter in machine else "of the run"
                unit = words.unit_of_parameter(c, parameter)
                yield {**named, **sized(parameter, size, std, unit), "held": held}


def _calibrated(found: Outcome, result: Result, words: Glossary) -> Iterator[Row]:
    unknowns = {u.name: u for u in found.baseline.hypothesis.fit.unknowns}
    for name, (size, std) in result.calibrated.items():
        held = _holding(unknowns[name], size, std) if name in unknowns else ""
        yield {
            "kind": CALIBRATED, "location": name, **sized(name, size, std, words.unit(name)), "held": held,
        }  # fmt: skip


def _holding(u: Unknown, size: float, std: float) -> str:
    """Why a calibrated value is not that of the record alone; empty if it is.

    Between bounds that are declared, all that is believed before is an even distribution.
    """
    width = u.high - u.low
    if not isfinite(width):
        return ""
    if min(size - u.low, u.high - size) <= OF_ESTIMATE.at_bound * width:
        return "at a bound"
    return "not in the record" if std >= POLICY.informed * width / sqrt(12) else ""


def sized(parameter: str, size: float, std: float, unit: str) -> Row:
    """A parameter with its standard error and its 95 % interval."""
    half = BAND * std
    return {
        "parameter": parameter, "size": finite(size), "std": finite(std), "low_95": finite(size - half),
        "high_95": finite(size + half), "unit": unit,
    }  # fmt: skip


def finite(value: float) -> float | None:
    """A number that JSON can hold."""
    return float(value) if isfinite(value) else None
