"""The report of close-loop: one self-contained page, with each figure also as a file."""

from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.search.free_form import curve_of
from estimator.record import Array
from estimator.sensor_faults import FAULTS
from fmus.host.archive import describe
from scenarios.closing.figures.channels import record_plots, residual_plots, spectrum_plots
from scenarios.closing.figures.errors import error_plot
from scenarios.closing.figures.forces import OTHERS, force_plots, laws_found
from scenarios.closing.figures.free_form import free_form_plot
from scenarios.closing.figures.headline import headline_plot
from scenarios.closing.figures.simulated import simulation_chart, simulation_plots
from scenarios.closing.page import error_table, sections
from scenarios.closing.page.case import Case
from scenarios.closing.page.checks import decided, figures
from scenarios.closing.page.glossary import effect_words, glossary, hypothesis_words
from scenarios.closing.page.power_table import power_rows
from scenarios.closing.page.rejected import (
    chance_words,
    detection_words,
    probable_rows,
    rejected,
    tried,
)
from scenarios.closing.page.wording import missed_words, story
from scenarios.closing.result import Result, best_wrong
from scenarios.drawing.chart.chart import scripts, styles
from scenarios.drawing.pages import rendered
from scenarios.drawing.sheet import Plot
from scenarios.drawing.typography import unit
from scenarios.output import written

HERE = Path(__file__).parent
ROWS = 15  # of the table of rejected hypotheses
LONG = 120.0  # s, from which on the time of a run is told in minutes
Values = dict[str, Any]


def write_report(folder: Path, problem: Problem, found: Outcome, result: Result) -> None:
    """Write report.html and the figures into a folder.

    The page contains its figures and its style sheet and loads no other file.
    """
    free = (found.free_form,) if found.free_form else ()
    case = Case(problem, found, result, glossary(problem, (*found.judgement.members, *free)))
    parts = {
        **_figures(case, folder),
        **_measured(case),
        **_law(case),
        **_rejection(case),
        **_use(case, folder),
    }
    page = rendered(HERE, "report.html.j2", result=result, story=story(case), **parts)
    written(folder / "report.html", page)


def _figures(case: Case, folder: Path) -> Values:
    """Draw all figures, write them to files, and embed them in the page."""
    problem, found, words, free = case.problem, case.found, case.words, case.found.free_form

    errors = error_table.error_values(case)

    def embed(plots: Iterable[Plot]) -> list[Values]:
        return [plot.embedded(folder) for plot in plots]

    return {
        "simulation_figures": embed(simulation_plots(problem, found, words, free)),
        "chart": simulation_chart(problem, found, words, free),
        "chart_scripts": scripts(),
        "chart_styles": styles(),
        "headline_figure": embed([headline_plot(problem, found, words, free)]),
        "record_figures": embed(record_plots(problem, words)),
        "force_figures": embed(force_plots(found, words)),
        "free_form_figures": embed([free_form_plot(found, free, words)] if free else []),
        "error_figures": embed([error_plot(errors, words, free is not None)] if found.singles else []),
        "residual_figures": embed(residual_plots(problem, found, words, free)),
        "spectrum_figures": embed(spectrum_plots(problem, found, words, free)),
    }


def _measured(case: Case) -> Values:
    return {
        "cards": error_table.gap_cards(case),
        "channels": list(sections.channels(case)),
        "runs": sections.runs(case),
        "start_values": list(sections.start_values(case)),
    }


def _law(case: Case) -> Values:
    shown = len(laws_found(case.found)) + OTHERS
    return {
        "missed": missed_words(case),
        "ports_left_out": [m.port.name for m in case.found.forces[shown:]],
        "laws": list(sections.laws(case)),
        "calibrated": list(sections.calibrated(case)),
        "has_effect": case.found.chosen is not None,
        "has_after": case.found.built_in is not None,
        "curve": curve_of(case.found.free_form) if case.found.free_form else None,
    }


def _rejection(case: Case) -> Values:
    rows, wrong = rejected(case.problem, case.found), best_wrong(case.found)
    return {
        "errors": error_table.error_rows(case),
        "wrong": hypothesis_words(wrong) if wrong else "",
        "rejected": rows[:ROWS],
        "more_rejected": max(0, len(rows) - ROWS),
        "best": hypothesis_words(case.found.chosen or case.found.base),
        "outputs": {o: unit(case.words.unit(o)) for o in case.problem.record.outputs},
        "statistics": list(figures(case.found.detection.figures)),
        "probable": list(probable_rows(case.result.probability)) if case.result.weighed else [],
        "decision": [decided(c) for c in case.found.judgement.checks],
        "detection": detection_words(case.problem, case.found),
        "chance": chance_words(case.found, case.diagnostics) if case.diagnostics else "",
        "black_box": case.diagnostics.black_box if case.diagnostics else None,
        "power": power_rows(case),
        "tried": [(", ".join(at), ", ".join(map(effect_words, k))) for k, at in _alike(tried(case.problem))],
        "faults": ", ".join(map(effect_words, FAULTS)),
        "known_noise": not any(c["noise"].endswith("(estimated)") for c in sections.channels(case)),
    }


def _use(case: Case, folder: Path) -> Values:
    """Values for the section on running the augmented FMU and repeating the run."""
    best, fmu = case.found.built_in or case.found.base, folder / case.result.augmented_fmu
    effects, theta = [c for c in best.candidates if not c.is_fault], best.fit.theta
    known = describe(fmu).variables if fmu.is_file() else {}
    others = {
        n: v
        for n, v in case.problem.declared.items()
        if n in known and known[n].start != v and n not in theta
    }
    return {
        "effect_values": {u.name: f"{theta[u.name]:.6g}" for c in effects for u in c.unknowns},
        "switches": [u.name for c in effects for u in c.amplitudes],
        "settings": {n: float(f"{v:.9g}") for n, v in others.items()},
        "times": _times(case.problem.record.runs[0].t),
        "took": _took(case.result.wall_seconds),
        "version": version("railfmi"),
    }


def _alike(tried: Mapping[str, Sequence[str]]) -> list[tuple[tuple[str, ...], list[str]]]:
    """Kinds of effects with the locations at which just these were tried."""
    found: dict[tuple[str, ...], list[str]] = {}
    for at, kinds in tried.items():
        found.setdefault(tuple(kinds), []).append(at)
    return list(found.items())


def _times(t: Array) -> str:
    """Begin and end of a record as arguments of a simulation; t: (N,) s."""
    start = f"start_time={t[0]:.9g}, " if t[0] else ""
    return f"{start}stop_time={t[-1]:.9g}"


def _took(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < LONG else f"{seconds / 60:.0f} min"
