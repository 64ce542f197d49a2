"""The look of all figures: palette, axes, envelopes of long records, and how they are written."""

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from estimator.record import Array, Record
from scenarios.drawing.narrow import make_narrow

# colours differ in lightness, for printing in grey and for the colour-blind
INK, BEFORE, AFTER, LAW = "#1d2733", "#d98f3e", "#123f6b", "#a3122a"
NOISE, CLOUD, SHADE = "#77828e", "#9fb6ca", "#eaeff4"

WIDTH = 6.5  # inches; 9 pt text then has about the size of the page's text
DPI = 170
COLOURS = 96  # dots per inch of a PNG: enough for smooth lines in a small file
POINTS = 700  # points of an envelope: about what the width of a figure can show
ROWS = 4  # largest number of panels above one another on a sheet
Item = TypeVar("Item")


@dataclass(frozen=True)
class Plot:
    """A figure with its file name (without ending) and its caption."""

    name: str
    figure: Figure
    caption: str

    def write(self, folder: Path) -> bytes:
        """Write as PNG and SVG into a folder; returns the PNG."""
        picture = png(self.figure)
        (folder / f"{self.name}.png").write_bytes(picture)
        _settle(self.figure)
        self.figure.savefig(folder / f"{self.name}.svg", metadata={"Date": None})
        return picture

    def embedded(self, folder: Path) -> dict[str, str]:
        """Write into a folder; returns name, caption, and pictures as sources of images in a page.

        source: as it is written; narrow: for a telephone, the panels above one another.
        """
        source = _source(self.write(folder))
        make_narrow(self.figure)
        small = _source(png(self.figure))
        return {"name": self.name, "caption": self.caption, "source": source, "narrow": small}


def png(figure: Figure) -> bytes:
    """A figure as a small PNG; it is laid out by this."""
    small = BytesIO()
    _drawn(figure).quantize(COLOURS).save(small, "png", compress_level=6)
    return small.getvalue()


def _source(picture: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"


def _drawn(figure: Figure) -> Image.Image:
    """A figure as a picture; it is laid out by this."""
    as_it_stands(figure)
    figure.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def as_it_stands(figure: Figure) -> None:
    """Have every text drawn as it stands: dollars in a name or a title are no mathematics, broken or not.

    Nor is LaTeX run on them where a matplotlibrc in the working directory asks for it. The numbers at ticks,
    which Matplotlib writes itself, stay as they are.
    """
    ours = {*figure.findobj(Text)}
    for axis in (axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)):
        ours -= {text for tick in (*axis.majorTicks, *axis.minorTicks) for text in (tick.label1, tick.label2)}
    for text in ours:
        text.set_parse_math(False)
        text.set_usetex(False)


def _settle(figure: Figure) -> None:
    """Keep the axes and their labels where they are, so that the next format needs no other layout."""
    figure.set_layout_engine(None)
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            place = axis.label.get_transform().transform(axis.label.get_position())
            axis.set_label_coords(*ax.transAxes.inverted().transform(place))


def sheet(height: float, layout: Sequence[Sequence[str]], width: float = WIDTH, **more: Any) -> Any:
    """A figure [in] and its axes by name, from a mosaic of names."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    axes = figure.subplot_mosaic([list(row) for row in layout], **more)
    for ax in axes.values():
        dress(ax)
    return figure, axes


def dress(ax: Axes) -> None:
    """Thin grey frame at the left and below, light grid, small text."""
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set(color=NOISE, linewidth=0.7)
    ax.tick_params(colors=INK, labelsize=8, width=0.7, length=3, color=NOISE)
    ax.grid(True, color="#dde3e9", linewidth=0.5)
    ax.set_axisbelow(True)
    for label in (ax.xaxis.label, ax.yaxis.label, ax.title):
        label.set(fontsize=9, color=INK)


def name_axes(ax: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Labels in the figures' size."""
    ax.set_xlabel(x, fontsize=9)
    ax.set_ylabel(y, fontsize=9)
    if title:
        # at a fixed height: the search for a free one would measure the ticks in every drawing
        ax.set_title(title, loc="left", fontsize=9, fontweight="bold", y=1.0)


def legend(figure: Figure, ax: Axes) -> None:
    """One legend above all panels of a figure, with the entries of one panel."""
    handles, labels = ax.get_legend_handles_labels()
    made = figure.legend(
        handles, labels, loc="outside upper left", ncols=len(labels), frameon=False, fontsize=8.5,
        handlelength=2.0, columnspacing=1.6, borderaxespad=0.1,
    )  # fmt: skip
    for line in made.get_lines():
        line.set_linewidth(2.0)


def envelope(t: Array, x: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Least and greatest value in each of `points` pieces of a channel (N,); short channels unchanged."""
    if len(x) <= 2 * points:
        return t, x
    begin = np.linspace(0, len(x), points, endpoint=False).astype(int)
    both = np.column_stack([np.minimum.reduceat(x, begin), np.maximum.reduceat(x, begin)])
    return np.repeat(t[begin], 2), both.ravel()


def times(record: Record) -> list[Array]:
    """Time of each run (N,) s on one axis: each file is placed after the one before."""
    found: list[Array] = []
    for run in record.runs:
        late = found[-1][-1] - run.t[0] if found else -np.inf
        found.append(run.t + late * 1.02 if late > 0 else run.t)
    return found


def shade_test(ax: Axes, record: Record) -> None:
    """Shade the test part."""
    for t, run in zip(times(record), record.runs, strict=True):
        if run.test.any():
            held_out = t[run.test]
            ax.axvspan(held_out[0], held_out[-1], color=SHADE, linewidth=0, zorder=0)
    ax.set_xlim(times(record)[0][0], times(record)[-1][-1])


def sheets(items: Sequence[Item], rows: int = ROWS) -> Iterator[tuple[str, list[Item]]]:
    """Items for each sheet with an ending for its name: none, then _2, _3."""
    for first in range(0, len(items), rows):
        yield (f"_{first // rows + 1}" if first else ""), list(items[first : first + rows])
