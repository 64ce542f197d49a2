"""The pages of `railfmi conicity`: self-contained files, with each figure also as a file beside them."""

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np

from scenarios.conicity.evaluating import Evaluation
from scenarios.conicity.figures import all_plots
from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import NOTHING, number
from scenarios.output import written

HERE = Path(__file__).parent
FEW = 16  # rows of the table of amplitudes, at most about this many
MILLI = 1e3


def write_page(folder: Path, found: Evaluation, command: str) -> None:
    """Write conicity.html and its figures into a folder."""
    parameter = found.nonlinearity
    text = rendered(
        HERE,
        "page.html.j2",
        version=version("railfmi"),
        headline=headline(found),
        pair=list(pair_rows(found)),
        rows=list(amplitude_rows(found)),
        nonlinearity=number(parameter / MILLI) if np.isfinite(parameter) else NOTHING,
        figures=[plot.embedded(folder) for plot in all_plots(found)],
        notes=list(reading_notes(found)),
        roll=found.table.attrs["roll"],
        search=str(found.table.attrs["search"]).replace("_", "-"),
        command=command,
    )
    written(folder / "conicity.html", text)


def headline(found: Evaluation) -> str:
    """The conicity at 3 mm, which EN 14363 asks for, in one sentence."""
    value = found.at(0.003)
    if np.isfinite(value):
        return f"Equivalent conicity {value:.3f} at 3 mm"
    return "No equivalent conicity at 3 mm"


def pair_rows(found: Evaluation) -> Iterator[dict[str, str]]:
    """What each side is and how the pair stands, a row a quantity."""
    left, right = found.sides.left, found.sides.right
    for what, name in (("wheel", "wheel"), ("rail", "rail")):
        yield {"what": what, "left": getattr(left, name).name, "right": getattr(right, name).name}
    yield {
        "what": "radius at the tape circle, mm",
        "left": f"{left.r0 * MILLI:g}",
        "right": f"{right.r0 * MILLI:g}",
    }
    centred = found.table.iloc[int(np.argmin(np.abs(found.table.index.to_numpy(dtype=float))))]
    for what, column, scale in (
        ("contact of the centred wheel, mm", "eta", MILLI), ("contact angle there, mrad", "delta", MILLI),
    ):  # fmt: skip
        yield {
            "what": what,
            "left": f"{centred[f'{column}_left'] * scale:.2f}",
            "right": f"{centred[f'{column}_right'] * scale:.2f}",
        }


def amplitude_rows(found: Evaluation) -> Iterator[dict[str, str]]:
    """Some rows over the amplitude."""
    every = max(1, round(len(found.rows) / FEW))
    for a, row in found.rows.iloc[::every].iterrows():
        yield {
            "amplitude": f"{float(str(a)) * MILLI:g}",
            **{name: _three(row[name]) for name in ("conicity", "linear", "harmonic")},
            "turns": f"{_two(row['low'])}, {_two(row['high'])}" if np.isfinite(row["low"]) else NOTHING,
            "why": row["why"],
        }


def reading_notes(found: Evaluation) -> Iterator[str]:
    """How profiles that were measured were read."""
    for side, pair in (("left", found.sides.left), ("right", found.sides.right)):
        for profile in (pair.wheel, pair.rail):
            if profile.found and profile.found != "exact sections":
                yield f"{side} {profile.kind} {profile.name}: {profile.found}"
        if found.sides.alike:
            return


def _three(value: float) -> str:
    return f"{value:.3f}".replace("-", "−") if np.isfinite(value) else NOTHING


def _two(value: float) -> str:
    return f"{value * MILLI:+.2f}".replace("-", "−")
