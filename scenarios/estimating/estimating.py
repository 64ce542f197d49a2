"""Estimate states, parameters and unknown inputs of an FMU from a measured record."""

import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from estimator.filters.consistency import checks
from estimator.record import Array
from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.host.archive import Archive
from fmus.models import model_class
from scenarios.estimating.findings import (
    Findings,
    Tell,
    find,
    informed,
    standings,
)
from scenarios.estimating.page import write_page
from scenarios.estimating.result import (
    EstimateResult,
    alarms,
    estimated,
    identified,
    innovations,
    nis,
    passes,
    write_csv,
)
from scenarios.estimating.setup import set_up
from scenarios.experiment.declaration import Options
from scenarios.experiment.experiment import Experiment, load_experiment
from scenarios.experiment.record import load_record
from scenarios.output import writable


def estimate(
    experiment: str | Path,
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    tell: Tell = lambda _: None,
    options: Options | None = None,
    truth: Mapping[str, tuple[Array, Array]] | None = None,
) -> EstimateResult:
    """What `railfmi estimate` does; returns the result that is written as result.json.

    experiment: path of an experiment.toml, or its folder; out: folder for estimate.csv, result.json,
    estimate.html and its figures (nothing is written without); data_dir: where the data files lie, by
    default beside the experiment; options: in place of those of the experiment; truth: true values by name
    as (times, values), for errors and figures. Raises BadInput for a wrong experiment. A filter that
    diverges stops with what it has, and says so in `diverged` and `reason`.
    """
    begun = time.monotonic()
    path = Path(experiment)
    e = load_experiment(path / "experiment.toml" if path.is_dir() else path, data_dir)
    if e.estimate is None:
        raise BadInput(f"{e.file}: has no [estimate]; say there which parameters, states or inputs to find")
    chosen = options or e.estimate.options
    folder = None if out is None else writable(Path(out))
    with tempfile.TemporaryDirectory(prefix="railfmi_estimate_") as work:
        tell("opening the FMU and the record")
        with Archive(fmu_of(e, Path(work))) as archive:
            record = load_record(e, archive.description, missing=True)
            setup = set_up(e, chosen, record, archive)
            found = find(setup, archive, tell)
            try:
                notes = [n.sentence for n in record.notes] + _notes(found)
                result = result_of(found, truth or {}, notes, time.monotonic() - begun)
                if folder is not None:
                    tell("writing the page")
                    _write(folder, found, result, truth or {})
            finally:
                found.joint.close()
    return result


def fmu_of(e: Experiment, work: Path) -> Path:
    """The FMU of an experiment: the foreign one it names, or ours, built."""
    if e.model is not None:
        return build_python(model_class(e.model)(), work)
    if e.fmu_path is None:
        raise BadInput(f"{e.file}: names neither a model nor an FMU")
    return e.fmu_path


def _standing_notes(found: Findings) -> Iterator[str]:
    """Of each unknown that lies at a bound, or of which the data tell too little, where it came from."""
    told = informed(found)
    for name, s in standings(found).items():
        if s.side:
            yield (
                f"'{name}' is at its {s.side} bound {s.bound:.4g}: the record pushes it there from "
                f"{s.start:.4g}, so its standard error says nothing; widen the bound, or look for what the "
                "model lacks"
            )
        elif not told.get(name, True) and not s.moved:
            yield f"the data tell nothing of '{name}': its value is what was believed before"
        elif not told.get(name, True):
            left = max(
                i.left[i.names.index(name)] for i in (found.before, found.after) if i and name in i.names
            )
            yield (
                f"the data tell little of '{name}': {left:.0%} of its first deviation is left, yet its value "
                f"moved from {s.start:.4g} to {s.value:.4g}"
            )


def _notes(found: Findings) -> list[str]:
    """What must be known of the outcome, in sentences."""
    notes = list(_standing_notes(found))
    if found.after is not None:
        notes += [
            f"'{a}' and '{b}' cannot be told apart (correlation {c:.3f}); only a combination of both is known"
            for a, b, c in found.after.alike
        ]
    undeclared = [
        o for o, known in zip(found.setup.outputs, found.setup.declared_noise, strict=True) if not known
    ]
    notes += [f"the noise of '{o}' was not declared; it was taken from its roughness" for o in undeclared]
    if found.joint.others:
        notes.append(f"carried, not estimated: {', '.join(found.joint.others)}")
    return notes


def result_of(
    found: Findings, truth: Mapping[str, tuple[Array, Array]], notes: list[str], seconds: float
) -> EstimateResult:
    """Put findings into words and numbers."""
    s, h, joint = found.setup, found.history, found.joint
    reason = h.broken and f"{h.broken}; the estimate ends there"
    access = joint.access
    tests = checks(h.nis, h.freedom, h.innovation, s.outputs)
    bounds = {name: ended.side for name, ended in standings(found).items() if ended.side}
    return EstimateResult(
        experiment=s.experiment.id,
        filter=s.options.filter,
        estimated=estimated(joint, h, informed(found), bounds),
        innovations=innovations(h, s.outputs, s.noise),
        nis=nis(h),
        checks=tests,
        consistent=not h.broken and passes(tests),
        log_likelihood=h.log_likelihood,
        identifiability=identified(found.before, found.after),
        alarms=alarms(joint, h, s.options),
        process_noise={state.name: state.noise for state in joint.states},
        process_noise_share=found.share,
        access=access.sentence,
        refused={way.name.lower(): why for way, why in access.refused.items()},
        samples=len(h.t),
        seconds_of_record=float(h.t[-1] - h.t[0]) if len(h.t) else 0.0,
        wall_seconds=round(seconds, 2),
        diverged=bool(h.broken),
        reason=reason,
        rms_error=rms_errors(found, truth),
        notes=notes,
    )


def rms_errors(found: Findings, truth: Mapping[str, tuple[Array, Array]]) -> dict[str, float]:
    """Root mean square of estimate minus truth, by name."""
    h = found.history
    return {
        name: float(np.sqrt(np.mean((found.value[:, h.names.index(name)] - np.interp(h.t, *true)) ** 2)))
        for name, true in truth.items()
        if name in h.names and len(h.t)
    }


def _write(
    folder: Path, found: Findings, result: EstimateResult, truth: Mapping[str, tuple[Array, Array]]
) -> None:
    """All files beside one another first, then into the folder, result.json last: whole or not at all."""
    with tempfile.TemporaryDirectory(prefix=".writing_", dir=folder) as part:
        made = Path(part)
        write_csv(made / "estimate.csv", found.history.names, found.history.t, found.value, found.std)
        write_page(made, found, result, truth)
        result.write(made / "result.json")
        for file in sorted(made.iterdir(), key=lambda f: f.name == "result.json"):
            file.replace(folder / file.name)
