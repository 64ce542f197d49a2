"""The page of estimate: one self-contained file, with each figure also as a file beside it."""

import math
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from estimator.access.recipe import Way
from estimator.record import Array
from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import (
    NOTHING,
    number,
    percent,
    short,
    unit,
    with_error,
)
from scenarios.estimating.findings import Findings
from scenarios.estimating.page_figures import band_plots, correlation_plots, innovation_plots
from scenarios.estimating.result import EstimateResult, main_values

HERE = Path(__file__).parent
MEANING = {"input": "rate of the input in the row above", "noise": "noise of the sensor that is correlated"}
WAYS = {way.name.lower(): way.words for way in Way}
Row = dict[str, Any]
Truth = Mapping[str, tuple[Array, Array]]


def write_page(folder: Path, found: Findings, result: EstimateResult, truth: Truth) -> None:
    """Write estimate.html and its figures into a folder; the page loads no other file."""
    page = rendered(
        HERE,
        "page.html.j2",
        result=result,
        headline=headline(result),
        quantities=list(quantities(found, result)),
        channels=list(channels(result)),
        alarms=list(raised(result)),
        unknowns=list(unknowns(result)),
        noise=list(noise(found, result)),
        nis=_number(result.nis["mean"]),
        checks=list(checked(result)),
        refused=[(WAYS.get(way, way), why) for way, why in result.refused.items()],
        bands=[plot.embedded(folder) for plot in band_plots(found, truth)],
        innovations=[plot.embedded(folder) for plot in innovation_plots(found)],
        correlations=[plot.embedded(folder) for plot in correlation_plots(found)],
        version=version("railfmi"),
    )
    (folder / "estimate.html").write_text(page, encoding="utf-8")


def headline(result: EstimateResult) -> str:
    """The main estimates in one sentence."""
    if result.diverged:
        return "The filter diverged; the estimates up to that time are shown."
    values = main_values(result.estimated)
    return f"{values}: {result.doubt}" if result.doubt else values


def quantities(found: Findings, result: EstimateResult) -> Iterator[Row]:
    """Last values, one row for each quantity, parameters and inputs first."""
    variables = found.joint.archive.description.variables
    for name, e in sorted(result.estimated.items(), key=lambda pair: pair[1]["kind"] == "state"):
        low, high = e["band_95"]
        error = result.rms_error.get(name)
        yield {
            "name": name,
            "kind": e["kind"],
            "meaning": variables[name].description if name in variables else MEANING[e["kind"]],
            "value": with_error(e["value"], e["std_error"]),
            "unit": unit(e["unit"]),
            "band": " to ".join(short(v, _digits(v, e["std_error"])) for v in (low, high)),
            "informed": e.get("informed_by_data", True),
            "bound": e.get("at_bound"),
            "error": NOTHING if error is None else number(error),
        }


def channels(result: EstimateResult) -> Iterator[Row]:
    """One row for each output: how well the filter predicted it."""
    for name, c in result.innovations.items():
        gated = c["gated_share"]
        yield {
            "name": name,
            "noise": _noise(result.sensor_noise[name]),
            "rms": _number(c["rms_over_expected"]),
            "mean": _number(c["mean_over_expected"]),
            "correlation": f"{_number(c['largest_correlation'])} ({_number(c['white_below'])})",
            "p": _number(c["p_white"]),
            "gated": NOTHING if gated is None else percent(gated),
        }


def _noise(of: Mapping[str, Any]) -> str:
    """The noise of an output, with the 95 % bands of what was estimated of it."""
    said = {what: short(of[what], 3) for what in ("std", "share", "time") if of[what] is not None}
    for what, band in of["band_95"].items():
        said[what] += f" ({' to '.join(short(end, 3) for end in band)})"
    if of["time"] is None:
        return said["std"]
    return f"{said['std']}, share {said['share']} of the variance correlated over {said['time']} s"


def checked(result: EstimateResult) -> Iterator[Row]:
    """One row for each consistency test of the filter."""
    for c in result.checks:
        limit = " to ".join(short(end) for end in c.limit)
        yield {"check": c.check, "value": short(c.value), "limit": limit, "passed": c.passed}


def raised(result: EstimateResult) -> Iterator[Row]:
    """One row for each alarm."""
    for a in result.alarms:
        end = "the end" if a.end is None else f"{short(a.end)} s"
        yield {
            "what": f"{a.name} {a.limit}", "begin": f"{short(a.begin)} s", "end": end,
            "probability": percent(a.probability),
        }  # fmt: skip


def unknowns(result: EstimateResult) -> Iterator[Row]:
    """One row for each unknown: the share of its start deviation that is left, before and after."""
    left = {when: told["deviation_left"] for when, told in result.identifiability.items()}
    for name in left.get("after", left.get("before", {})):
        yield {"name": name} | {
            when: percent(left[when][name]) if name in left.get(when, {}) else NOTHING
            for when in ("before", "after")
        }


def noise(found: Findings, result: EstimateResult) -> Iterator[Row]:
    """One row for each state: the process noise that drives it."""
    variables = found.joint.archive.description.variables
    for name, value in result.process_noise.items():
        of = unit(variables[name].unit)
        yield {"name": name, "value": number(value), "unit": f"{of}/√s" if of else "1/√s"}


def _digits(value: float, std: float) -> int:
    """Significant digits of a value so that two digits of its standard deviation are visible."""
    if not (value and std > 0):
        return 4
    return min(max(3, math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2), 12)


def _number(value: float | None) -> str:
    return NOTHING if value is None else number(value)
