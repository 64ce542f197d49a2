"""The page of `railfmi bifurcation`: a self-contained file, with each figure also as a file beside it."""

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scenarios.bifurcation.figures import all_plots, scale_of
from scenarios.bifurcation.result import Bifurcation, Limb
from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import NOTHING, label, number, percent, quantity
from scenarios.output import written

HERE = Path(__file__).parent
Row = dict[str, Any]


def write_page(folder: Path, found: Bifurcation, command: str) -> None:
    """Write bifurcation.html and its figures into a folder."""
    text = rendered(
        HERE,
        "page.html.j2",
        found=found,
        headline=headline(found),
        amplitude=label("amplitude", scale_of(found)[1]),
        critical=list(critical_rows(found)),
        limbs=[list(limb_rows(found, limb)) for limb in found.limbs],
        ends=[limb.branch.end for limb in found.limbs],
        releases=list(release_rows(found)),
        notes=list(found.notes()),
        figures=[plot.embedded(folder) for plot in all_plots(found)],
        range=f"{found.low:g} to {quantity(f'{found.high:g}', found.parameter_unit)}",
        version=version("railfmi"),
        command=command,
    )
    written(folder / "bifurcation.html", text)


def headline(found: Bifurcation) -> str:
    """The critical values in one sentence."""
    if found.linear is None:
        return f"Rest is stable wherever {found.parameter} was varied" if not found.rests[0].unstable else (
            f"Rest is unstable from the beginning of the range of {found.parameter} on"
        )  # fmt: skip
    said = f"Rest is unstable from {found.parameter} = {found.of_parameter(found.linear[0])} on"
    if found.stable_throughout:
        return f"{said}; stable limit cycles exist down to the beginning of the range"
    if found.nonlinear is None:
        return said
    return f"{said}; stable limit cycles exist from {found.of_parameter(found.nonlinear[0])} on"


def critical_rows(found: Bifurcation) -> Iterator[Row]:
    """Crossings of the rates, and the smallest cycles."""
    for crossing in found.crossings:
        kind = "Hopf bifurcation" if crossing.frequency else "static"
        change = "begin" if crossing.begins else "cease"
        yield {
            "what": f"{kind}, motions about rest {change} to grow, by the rates of rest",
            "at": found.of_parameter(crossing.parameter, crossing.error),
            "frequency": f"{crossing.frequency:.4g}" if crossing.frequency else NOTHING,
            "amplitude": "0",
        }
    factor, _ = scale_of(found)
    for limb in found.limbs:
        if limb.start is not None:
            first = limb.branch.cycles[0]
            yield {
                "what": "smallest limit cycle", "at": found.of_parameter(first.parameter, limb.branch.error),
                "frequency": f"{1 / first.period:.4g}", "amplitude": number(first.amplitude * factor, 3),
            }  # fmt: skip


def limb_rows(found: Bifurcation, limb: Limb) -> Iterator[Row]:
    """Folds and other changes of a branch."""
    factor, _ = scale_of(found)
    for fold in limb.folds:
        yield {
            "what": "fold", "at": found.of_parameter(fold.parameter, fold.error),
            "frequency": f"{1 / fold.cycle.period:.4g}",
            "amplitude": number(fold.cycle.amplitude * factor, 4),
        }  # fmt: skip
    for change in limb.changes:
        at = " to ".join(map(found.of_parameter, (change.low, change.high)))
        yield {"what": change.kind, "at": at, "amplitude": NOTHING, "frequency": NOTHING}


def release_rows(found: Bifurcation) -> Iterator[Row]:
    """Simulations beside unstable cycles."""
    for limb in found.limbs:
        for r in limb.releases:
            yield {
                "at": found.of_parameter(r.cycle.parameter),
                "start": f"{percent(abs(r.share - 1))} {'outside' if r.share > 1 else 'inside'}",
                "multiplier": number(float(abs(r.cycle.multipliers[0])), 3),
                "periods": len(r.amplitudes),
                "end": number(float(r.amplitudes[-1]), 3),
                "leaves": "yes" if r.leaves else "no",
            }
