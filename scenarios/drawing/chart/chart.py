"""The numbers of a chart for a page, and the scripts and styles that draw it.

A chart stands in place of a picture of the same lines. Without scripts, and in a
print, the picture is shown.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from estimator.record import Array

HOME = Path(__file__).parent
SAMPLES = 60_000  # numbers of all charts of a page: about half a megabyte
DIGITS = 5  # of a drawn value: finer than a pixel at any useful zoom


@dataclass(frozen=True)
class Line:
    """A line of a panel: its name, its values (N,), a colour of the style sheet, its width in pixels."""

    name: str
    y: Array
    colour: str
    width: float = 1.2


@dataclass(frozen=True)
class Panel:
    """Lines over a common time (N,) s."""

    title: str
    t: Array
    lines: Sequence[Line]


def chart(panels: Sequence[Panel], shaded: Sequence[tuple[float, float]], time: str) -> Markup:
    """The data of a chart as JSON that may stand in a page; shaded: intervals of time, s."""
    most = max(2, SAMPLES // sum(len(p.lines) for p in panels))
    value = {"time": time, "shaded": shaded, "panels": [_panel(p, most) for p in panels]}
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    # nothing in a name may end the element that holds the data
    return Markup(text.replace("<", "\\u003c"))


def _panel(panel: Panel, most: int) -> Mapping[str, Any]:
    drawn = [thinned(panel.t, line.y, most) for line in panel.lines]
    series = [
        {"name": line.name, "colour": line.colour, "width": line.width, "y": _numbers(y, DIGITS)}
        for line, (_, y) in zip(panel.lines, drawn, strict=True)
    ]
    return {"title": panel.title, "t": _numbers(drawn[0][0], 8), "series": series}


def thinned(t: Array, y: Array, most: int) -> tuple[Array, Array]:
    """A line in at most `most` points that keep its least and greatest values; short lines unchanged."""
    if len(t) <= most:
        return t, y
    begin = np.linspace(0, len(t), most // 2, endpoint=False).astype(int)
    both = np.column_stack([np.fmin.reduceat(y, begin), np.fmax.reduceat(y, begin)])
    middle = (t[begin] + t[np.append(begin[1:], len(t)) - 1]) / 2
    return np.column_stack([t[begin], middle]).ravel(), both.ravel()


def _numbers(values: Array, digits: int) -> list[float | None]:
    return [float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in values]


def scripts() -> Markup:
    """The script elements of a page with charts."""
    return Markup("\n".join(f"<script>\n{_text(name)}\n</script>" for name in ("uplot.min.js", "chart.js")))


def styles() -> Markup:
    """The style sheet of a page with charts."""
    return Markup(_text("uplot.min.css") + "\n" + _text("chart.css"))


def _text(name: str) -> str:
    return (HOME / name).read_text(encoding="utf-8")
