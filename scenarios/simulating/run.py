"""Run scenarios: simulate the variants, check the expectations, write figures and recordings."""

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from fmus.errors import BadInput
from fmus.host.apart.isolation import ISOLATED, FmuEnded, Isolation
from fmus.host.apart.room import closing_rooms
from fmus.host.fmu import FmuError
from fmus.host.master.recording import TIME, Recording
from scenarios.experiment.validation import of_file
from scenarios.output import writable, written_at_once
from scenarios.simulating.asking import (
    Asked,
    asked,
    lookup,
    wanted,
)
from scenarios.simulating.building import Builder
from scenarios.simulating.case import (
    Case,
    Progress,
    Run,
    prepared,
)
from scenarios.simulating.reading import SINGLE, Scenario, load_scenario
from scenarios.simulating.result import (
    Finding,
    Result,
    RunSummary,
    finite,
)

Tell = Callable[[str], None]
Done = Callable[[Result], None]


def run(
    scenario: str | Path,
    out: str | Path,
    tell: Tell = lambda _: None,
    builder: Builder | None = None,
    isolation: Isolation | None = ISOLATED,
) -> Result:
    """Run one scenario as `railfmi run` does; writes result.json, recordings and figures to `out`.

    tell: called from time to time with a line on the progress, the simulated time and the speed.
    builder: builder of the FMUs, if several scenarios share it.
    After Ctrl-C, the recordings are kept, the result is marked as interrupted, and no expectation is checked.
    isolation: limits of the process in which foreign FMUs run; None runs them in this process.
    Raises BadInput if the scenario is wrong, FmuError if an FMU refuses a call, FmuEnded if a foreign FMU
    crashes or passes a limit; what was recorded until then is written.
    """
    begun = perf_counter()
    read = load_scenario(scenario)
    folder = writable(Path(out))
    with ExitStack() as stack:
        stack.enter_context(closing_rooms())
        if builder is None:
            builder = Builder(Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="railfmi_run_"))))
        with of_file(read.file):
            questions = asked(read)
            cases = _all_prepared(read, questions, builder, stack, tell, isolation)
            runs, summaries = _run_all(cases, read, folder, tell)
            result = _judged(read, questions, runs, summaries, folder, begun)
            _write(result)  # before the figures, which may fail
            if result.interrupted_at is not None:
                return result
            from scenarios.simulating.drawing import write_figure  # loads Matplotlib

            tell(f"{read.id}: drawing")
            pictures = enumerate(read.declared.figure)
            with written_at_once(folder) as part:
                drawn = [write_figure(p, i, questions, runs, part).name for i, p in pictures]
    figures = tuple(folder / name for name in drawn)
    result = replace(result, figures=figures, wall_seconds=perf_counter() - begun)
    _write(result)
    return result


def _write(result: Result) -> None:
    with written_at_once(result.folder) as part:
        result.write(part / "result.json")


def run_all(
    files: Sequence[str | Path],
    out: str | Path,
    tell: Tell = lambda _: None,
    done: Done = lambda _: None,
    isolation: Isolation | None = ISOLATED,
) -> list[Result]:
    """Run scenarios one after the other; each of several gets a folder named by its id in `out`.

    Several scenarios also get a contact sheet of their figures, `out`/contact-sheet.png.
    done: called with each result as soon as it is finished. isolation: see run.
    All files are read before the first scenario is run. After Ctrl-C, no further scenario is run.
    """
    if not files:
        raise BadInput("no scenario given; name at least one file")
    read = [load_scenario(file) for file in files]
    ids = [s.id for s in read]
    for twice in sorted({i for i in ids if ids.count(i) > 1}):
        raise BadInput(f"id '{twice}' occurs twice among the scenarios; their folders would be the same")
    folder = writable(Path(out))
    results = []
    with tempfile.TemporaryDirectory(prefix="railfmi_run_") as built:
        builder = Builder(Path(built))
        for scenario in read:
            target = folder if len(read) == 1 else folder / scenario.id
            results.append(run(scenario.file, target, tell, builder, isolation))
            done(results[-1])
            if results[-1].interrupted_at is not None:
                break
    if len(results) > 1:
        from scenarios.simulating.contact_sheet import write_contact_sheet  # loads a library of pictures

        with written_at_once(folder) as part:
            write_contact_sheet(results, part / "contact-sheet.png")
    return results


def _called(variant: str, scenario: Scenario) -> str:
    return "its run" if variant == SINGLE and not scenario.declared.variants else f"variant '{variant}'"


def _all_prepared(
    scenario: Scenario, questions: Asked, builder: Builder, stack: ExitStack, tell: Tell,
    isolation: Isolation | None,
) -> dict[str, Case]:  # fmt: skip
    """All variants, checked before the first one runs."""
    cases: dict[str, Case] = {}
    for name, declared in scenario.variants.items():
        tell(f"{scenario.id}: preparing {_called(name, scenario)}")
        formulas = wanted(questions, name, scenario)
        try:
            cases[name] = prepared(declared, scenario.file, formulas, builder, stack, isolation)
        except BadInput as error:
            said = str(error).removeprefix(f"{scenario.file}: ")
            which = f"variant '{name}': " if scenario.declared.variants else ""
            raise BadInput(f"{which}{said}") from error
    return cases


def _run_all(
    cases: Mapping[str, Case], scenario: Scenario, folder: Path, tell: Tell
) -> tuple[dict[str, Run], dict[str, RunSummary]]:
    """Run the variants in turn and write their recordings, until all are done or one is interrupted."""
    runs: dict[str, Run] = {}
    summaries: dict[str, RunSummary] = {}
    for name, case in cases.items():
        begun = perf_counter()
        try:
            runs[name] = case.run(_progress(case, name, scenario, tell))
        except (FmuError, FmuEnded) as error:
            kept = _kept(error.so_far, name, case, scenario, folder, perf_counter() - begun)
            raise type(error)(f"{scenario.file}: {_called(name, scenario)}: {error}{kept}") from error
        took = perf_counter() - begun
        summaries[name] = _written(runs[name], name, case, scenario, folder, took)
        if summaries[name].interrupted_at is not None:
            break
    return runs, summaries


def _kept(
    so_far: Recording | None, name: str, case: Case, scenario: Scenario, folder: Path, took: float
) -> str:
    """Write what a broken run had recorded, and say so."""
    if so_far is None or so_far.data.empty:
        return ""
    summary = _written(Run(so_far, {}), name, case, scenario, folder, took)
    until = so_far.interrupted_at or 0.0
    return f"; what was recorded until t = {until:.9g} s is in {folder / summary.recording}"


def _progress(case: Case, name: str, scenario: Scenario, tell: Tell) -> Progress:
    what = f"{scenario.id}: {_called(name, scenario)}"

    def progress(time: float, speed: float) -> None:
        tell(f"{what}, {time:.2f} of {case.duration:g} s, {speed:.1f} times real time")

    return progress


def _written(run: Run, name: str, case: Case, scenario: Scenario, folder: Path, took: float) -> RunSummary:
    """Write a variant's recording and the readings of its sensors."""
    ending = scenario.variants[name].record.format
    file, measured = f"{name}.{ending}", None if run.measured is None else f"{name}-measured.{ending}"
    recording = run.recording
    with written_at_once(folder) as part:
        (recording.to_csv if ending == "csv" else recording.to_parquet)(part / file)
        if run.measured is not None and measured is not None:
            (run.measured.to_csv if ending == "csv" else run.measured.to_parquet)(part / measured)
    stopped = recording.interrupted_at
    if recording.ended:
        simulated: float | None = float(recording.data[TIME].iloc[-1])
    else:
        simulated = case.duration if stopped is None else stopped
    return RunSummary(file, measured, simulated, took, stopped, recording.ended)


def _judged(
    scenario: Scenario,
    questions: Asked,
    runs: Mapping[str, Run],
    summaries: Mapping[str, RunSummary],
    folder: Path,
    begun: float,
) -> Result:
    """The result without figures; the expectations of an interrupted run are not checked."""
    stopped = next((s.interrupted_at for s in summaries.values() if s.interrupted_at is not None), None)
    findings = tuple(_findings(questions, runs)) if stopped is None else ()
    d = scenario.declared
    took = perf_counter() - begun
    return Result(d.id, d.question, folder, findings, dict(summaries), (), took, stopped)


def _findings(questions: Asked, runs: Mapping[str, Run]) -> Iterator[Finding]:
    """The verdict on each expectation; one that cannot be evaluated from the signals is not met."""
    for expectation, question in questions.expectations:
        for variant in question.asked():
            which = variant if len(runs) > 1 else None
            asked_for = expectation.that, expectation.because, which
            try:
                verdict = question.formula.verdict(lookup(runs, variant))
            except BadInput as error:
                yield Finding(*asked_for, False, (), str(error))
            else:
                yield Finding(*asked_for, verdict.holds, finite(verdict.values), verdict.problem)
