"""Estimate states, parameters and unknown inputs of an FMU from a measured record."""

import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from estimator.filters.consistency import checks
from estimator.record import Array
from fmus.errors import BadInput
from fmus.export.builders.hypotheses import build_quick
from fmus.export.provenance import isolation_of
from fmus.files import passing_folder
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.apart.room import closing_rooms
from fmus.host.archive import Archive
from fmus.host.grading.honest import check_honest
from fmus.models import model_class
from scenarios.drawing.typography import quantity
from scenarios.estimating.alarms import alarms
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
    estimated,
    identified,
    innovations,
    nis,
    passes,
    sensor_noise,
    write_csv,
)
from scenarios.estimating.sensors import TIME
from scenarios.estimating.setup import set_up
from scenarios.experiment.conversions import Show, conversion_lines
from scenarios.experiment.estimated import Options
from scenarios.experiment.experiment import Experiment
from scenarios.experiment.given import Given, given
from scenarios.experiment.record import load_record
from scenarios.output import writable, written_at_once

BUILDING = ".building_"  # begin of the name of a folder in which a build is made


def estimate(
    experiment: Given,
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    tell: Tell = lambda _: None,
    options: Options | None = None,
    truth: Mapping[str, tuple[Array, Array]] | None = None,
    isolation: Isolation | None = ISOLATED,
    show: Show = lambda _: None,
    data: pd.DataFrame | None = None,
    builds: Path | None = None,
) -> EstimateResult:
    """Run `railfmi estimate` and return the result that is written as result.json.

    experiment: path of an experiment.toml, or of its folder; or its content as a dictionary or an object.
    out: folder for estimate.csv, result.json, estimate.html and its figures; None writes nothing.
    data_dir: folder of the data files, by default the folder of the experiment.
    options: replace the options of the experiment.
    truth: true values by name as (times, values), for errors and figures.
    isolation: limits of the process in which a foreign FMU runs; None runs it in this process.
    show: gets the table of conversions as lines, before anything is estimated.
    data: the record, in place of the data file; units by column in data.attrs["units"].
    builds: folder in which the build of a model is found, or kept for further experiments; None keeps none.
    Raises BadInput if the experiment is wrong, FmuEnded if a foreign FMU crashes or passes a limit. If the
    filter diverges, the result contains the estimates up to that time, and `diverged` and `reason` are set.
    """
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="railfmi_estimate_") as work, closing_rooms():
        e = given(experiment, data_dir, data, Path(work))
        if e.estimate is None:
            raise BadInput(
                f"{e.file}: has no [estimate]; list there the parameters, states or inputs to find"
            )
        chosen = options or e.estimate.options
        folder = None if out is None else writable(Path(out))
        tell("opening the FMU and the record")
        fmu = fmu_of(e, builds or Path(work))
        if e.model is None:
            check_honest(fmu, isolation or ISOLATED)
        with Archive(fmu, isolation_of(fmu, isolation) if e.model is None else None) as archive:
            record = load_record(e, archive.description, missing=True)
            setup = set_up(e, chosen, record, archive)
            show(conversion_lines(record))
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
    """The FMU of an experiment: the foreign FMU that it names, or a build of its model in `work`."""
    if e.model is not None:
        model = model_class(e.model)()
        made = work / f"{model.name}.fmu"
        if not made.exists():
            with passing_folder(work, BUILDING) as part:  # others may build the same at once
                build_quick(model, part).replace(made)
        return made
    if e.fmu_path is None:
        raise BadInput(f"{e.file}: names neither a model nor an FMU; add one of the keys 'model' and 'fmu'")
    return e.fmu_path


def _standing_notes(found: Findings) -> Iterator[str]:
    """A note on each unknown that lies at a bound, or about which the record contains too little."""
    told = informed(found)
    for name, s in standings(found).items():
        if name in found.setup.form:
            continue
        if s.side:
            yield (
                f"'{name}' was moved from its start {s.start:.4g} to its {s.side} bound {s.bound:.4g} by the "
                "record, so its standard error is not valid; widen the bound, or look for an effect that the "
                "model lacks"
            )
        elif not told.get(name, True) and not s.moved:
            yield f"the record contains no information on '{name}': its value is still the start value"
        elif not told.get(name, True):
            left = max(
                i.left[i.names.index(name)] for i in (found.before, found.after) if i and name in i.names
            )
            yield (
                f"the record contains little information on '{name}': {left:.0%} of its start deviation is "
                f"left, yet its value moved from {s.start:.4g} to {s.value:.4g}"
            )


def _notes(found: Findings) -> list[str]:
    """Sentences that a reader of the estimates has to know."""
    notes = list(_standing_notes(found))
    if found.after is not None:
        notes += [
            f"'{a}' and '{b}' cannot be told apart (correlation {c:.3f}); only a combination of both is known"
            for a, b, c in found.after.alike
        ]
    notes += _notes_on_form(found)
    notes += _notes_on_noise(found)
    notes += _notes_on_inputs(found)
    if found.joint.others:
        notes.append(f"states that are simulated, not estimated: {', '.join(found.joint.others)}")
    return notes


def _notes_on_noise(found: Findings) -> Iterator[str]:
    """How the noise of each output was found that was not declared, or was to be estimated."""
    s = found.setup
    for n in s.sensors:
        wanted = {w.what for w in s.sought if w.output == n.output}
        declared = s.experiment.outputs[n.output].noise_std is not None
        lead = f"the noise of '{n.output}' was " + ("to be estimated" if declared else "not declared")
        bands = s.bands.get(n.output, {})
        said = [
            f"{what} {getattr(n, what):.3g} ({low:.3g} to {high:.3g}{' s' if what == TIME else ''})"
            for what, (low, high) in bands.items()
        ]
        if said:
            yield f"{lead}; the likelihood of the record is largest with {', '.join(said)}"
        elif not declared or wanted:
            yield f"{lead}; it was estimated from the roughness of the measurements"


def _notes_on_inputs(found: Findings) -> Iterator[str]:
    """Which inputs have noise that the filter counts with."""
    variables = found.joint.archive.description.variables
    for w in found.setup.input_noise:
        std = quantity(f"{w.std:.2g}", variables[w.name].unit)
        if w in found.setup.possible:
            yield f"'{w.name}' has white noise of {std} by its spectrum, and the record is likelier with it"


def _notes_on_form(found: Findings) -> Iterator[str]:
    """What the estimate would be with each choice of the model's form, and what that form lets wander."""
    for form in found.forms:
        choice = ", ".join(f"{name} = {value:g}" for name, value in form.choice.items())
        values = ", ".join(f"{name} = {value:.4g}" for name, value in form.values.items())
        counts = "" if form.consistent else "; this filter is not consistent with the record"
        yield f"with {choice}: {values}, log likelihood {form.log_likelihood:.1f}{counts}"
    for p in found.setup.parameters:
        if p.walk and p.name not in found.setup.options.walk:
            yield (
                f"'{p.name}' may wander by {p.walk:.2g} in a second, the most that the record "
                "does not reject, since no constant makes up for what the model's form leaves open"
            )
    if sum(form.consistent for form in found.forms) > 1:
        yield "the scatter between the consistent choices of the model's form is part of the standard errors"


def result_of(
    found: Findings, truth: Mapping[str, tuple[Array, Array]], notes: list[str], seconds: float
) -> EstimateResult:
    """The result of the findings, in words and numbers."""
    s, h, joint = found.setup, found.history, found.joint
    reason = h.broken and f"{h.broken}; the estimate ends at this time"
    access = joint.access
    tests = checks(h.nis, h.freedom, h.accepted, s.outputs)
    bounds = {name: ended.side for name, ended in standings(found).items() if ended.side}
    return EstimateResult(
        experiment=s.experiment.id,
        filter=s.options.filter,
        estimated=estimated(joint, h, informed(found), bounds, s.form),
        innovations=innovations(h, s.outputs, s.noise),
        nis=nis(h),
        checks=tests,
        consistent=not h.broken and passes(tests),
        log_likelihood=h.log_likelihood,
        identifiability=identified(found.before, found.after),
        alarms=alarms(joint, h, s.options),
        sensor_noise=sensor_noise(s.sensors, s.bands),
        input_noise={w.name: w.std for w in s.input_noise},
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
    """Write all files."""
    with written_at_once(folder) as made:
        write_csv(made / "estimate.csv", found.history.names, found.history.t, found.value, found.std)
        write_page(made, found, result, truth)
        result.write(made / "result.json")
