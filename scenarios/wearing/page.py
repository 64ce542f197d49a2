"""The page of `railfmi wear`: a self-contained file, with each figure also as a file beside it."""

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import NOTHING
from scenarios.output import written
from scenarios.wearing.evolution import State
from scenarios.wearing.figures import all_plots
from scenarios.wearing.result import MILLI, Wear
from scenarios.wearing.service import SIDES

HERE = Path(__file__).parent


def write_page(folder: Path, found: Wear, command: str) -> None:
    """Write wear.html and its figures into a folder."""
    e = found.evolution
    text = rendered(
        HERE,
        "page.html.j2",
        version=version("railfmi"),
        headline=headline(found),
        scenario=e.service.scenario.id,
        question=e.service.scenario.declared.question,
        notes=[n[:1].upper() + n[1:] for n in found.notes()],
        sides=list(SIDES),
        rows=list(state_rows(found)),
        figures=[plot.embedded(folder) for plot in all_plots(found)],
        step=f"{MILLI * e.plan.step:g}",
        both_ways=e.plan.both_ways,
        command=command,
    )
    written(folder / "wear.html", text)


def headline(found: Wear) -> str:
    """How much is worn off, in one sentence."""
    return f"{MILLI * found.deepest:.2f} mm worn off after {found.last.km:.0f} km"


def state_rows(found: Wear) -> Iterator[dict[str, Any]]:
    """A row a state."""
    for s in found.evolution.states:
        yield {
            "km": f"{s.km:.0f}",
            "conicity": f"{s.conicity:.3f}" if np.isfinite(s.conicity) else NOTHING,
            **{side: _wheel(s, side) for side in SIDES},
        }


def _wheel(s: State, side: str) -> dict[str, str]:
    size, wheel = s.sizes[side], s.wheels[side]
    shown = {
        "worn": f"{MILLI * float(wheel.worn.max()):.3f}",
        "T_gamma": f"{s.T_gamma[side]:.2f}",
        "at_flange": f"{100 * s.at_flange[side]:.0f}",
    }
    return shown | {name: f"{MILLI * getattr(size, name):.2f}" for name in ("Sh", "Sd", "qR")}
