"""Figures of a scenario."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimator.record import Array
from fmus.errors import BadInput
from fmus.units import conversion
from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    DPI,
    INK,
    LAW,
    NOISE,
    as_it_stands,
    envelope,
    name_axes,
    sheet,
)
from scenarios.drawing.typography import unit as typeset
from scenarios.simulating.asking import Asked, Question, lookup
from scenarios.simulating.case import Run
from scenarios.simulating.declaration import Panel, Picture
from scenarios.simulating.expression import Expression
from scenarios.simulating.value import Value

COLOURS = (AFTER, BEFORE, LAW, "#4f8a5b", NOISE, "#7d5ba6", CLOUD, INK)
PANEL = 1.75  # inches, height of a panel
HEAD = 0.75  # inches, for title, legend and the axis below
COLUMNS = 4  # of a legend
LINE = 78  # characters in a line of a title


@dataclass(frozen=True)
class Curve:
    """A curve in the units shown; `even` is true if x is the axis of the run, which increases."""

    x: Array
    y: Array
    label: str
    even: bool


def write_figure(picture: Picture, place: int, asked: Asked, runs: Mapping[str, Run], folder: Path) -> Path:
    """Draw figure number `place` of a scenario and write it as PNG; returns its path."""
    names = [f"{j}" for j in range(len(picture.panels))]
    heights = [panel.height for panel in picture.panels]
    figure, axes = sheet(HEAD + PANEL * sum(heights), [[n] for n in names], height_ratios=heights)
    for j, panel in enumerate(picture.panels):
        _draw(axes[f"{j}"], panel, asked.curves[place, j], runs, f"key 'figure[{place}].panels[{j}]")
    _join([axes[name] for name in names])
    figure.suptitle(fill(picture.title, LINE), x=0.01, ha="left", fontsize=10, fontweight="bold", color=INK)
    _legends(figure, [axes[name] for name in names])
    target = folder / f"{picture.name}.png"
    as_it_stands(figure)
    figure.savefig(target, dpi=DPI)
    return target


Curves = tuple[list[Question[Expression]], Question[Expression] | None]


def _draw(ax: Axes, panel: Panel, curves: Curves, runs: Mapping[str, Run], where: str) -> None:
    drawn, over = curves
    found = [
        _curve(panel, question, over, k, variant, runs, where)
        for k, question in enumerate(drawn)
        for variant in question.asked()
    ]
    for curve, colour in zip(found, COLOURS * (1 + len(found) // len(COLOURS)), strict=False):
        x, y = envelope(curve.x, curve.y) if curve.even else (curve.x, curve.y)
        ax.plot(x, y, color=colour, linewidth=0.9, label=curve.label if len(found) > 1 else None)
    shown = typeset(panel.unit) if panel.unit else ""
    name_axes(ax, _x_label(panel, runs), f"{panel.label}\nin {shown}" if shown else panel.label)
    if panel.window is not None:
        ax.set_xlim(*panel.window)
    elif all(curve.even for curve in found):
        ax.set_xlim(min(c.x[0] for c in found), max(c.x[-1] for c in found))


def _curve(
    panel: Panel,
    question: Question[Expression],
    over: Question[Expression] | None,
    k: int,
    variant: str | None,
    runs: Mapping[str, Run],
    where: str,
) -> Curve:
    """One curve, cut to the panel's window."""
    signals = lookup(runs, variant)
    value = question.formula.value(signals)
    if value.x is None:
        raise BadInput(
            f"{question.formula.where}: '{question.formula.text}' is a single number; give a signal to draw"
        )
    x = Value(value.x, value.x, _axis(runs)[1]) if over is None else over.formula.value(signals)
    if np.shape(x.y) != np.shape(value.y):
        raise BadInput(f"{where}.x': has different times from '{question.formula.text}'; use on(a, b)")
    shown = _shown(x, panel.x_unit, f"{where}.x_unit'"), _shown(value, panel.unit, f"{where}.unit'")
    if over is None and panel.window is not None:
        kept = (shown[0] >= panel.window[0]) & (shown[0] <= panel.window[1])
        shown = shown[0][kept], shown[1][kept]
    return Curve(*shown, _label(panel, question, k, variant, len(runs)), over is None)


def _label(panel: Panel, question: Question[Expression], k: int, variant: str | None, variants: int) -> str:
    named = panel.names[k] if panel.names else question.formula.text if len(panel.draw) > 1 else ""
    which = (variant or "").replace("_", " ") if variants > 1 else ""
    return ", ".join(part for part in (which, named) if part) or question.formula.text


def _shown(value: Value, unit: str | None, where: str) -> Array:
    """Samples in the unit that the axis shows."""
    if unit is None or value.unit is None:
        return np.asarray(value.y, dtype=np.float64)
    try:
        factor, offset = conversion(value.unit, unit, where)
    except BadInput as error:
        raise BadInput(
            f"{where}: curves in '{value.unit}' cannot be shown in '{unit}'; give a unit of the same kind"
        ) from error
    return np.asarray(factor * value.y + offset, dtype=np.float64)


def _axis(runs: Mapping[str, Run]) -> tuple[str, str]:
    """The label of the runs' axis, with its unit."""
    recording = next(iter(runs.values())).recording
    return ("lateral shift", "m") if recording.data.columns[0] == "y" else ("time", "s")


def _x_label(panel: Panel, runs: Mapping[str, Run]) -> str:
    what, unit = (panel.x_label, None) if panel.x_label else _axis(runs)
    shown = panel.x_unit or unit
    return f"{what} in {typeset(shown)}" if shown and shown != "1" else str(what)


def _join(axes: list[Axes]) -> None:
    """If all panels have the same axis label, show it only once, below."""
    for upper, lower in pairwise(axes):
        if upper.get_xlabel() == lower.get_xlabel() and upper.get_xlim() == lower.get_xlim():
            upper.set_xlabel("")


def _legends(figure: Figure, axes: list[Axes]) -> None:
    """One legend if all panels show the same curves, else one in each panel."""
    labels = [tuple(ax.get_legend_handles_labels()[1]) for ax in axes]
    if not any(labels):
        return
    style = {"frameon": False, "fontsize": 8, "handlelength": 1.6, "columnspacing": 1.2}
    if len(set(labels)) == 1:
        handles = axes[0].get_legend_handles_labels()[0]
        columns = min(COLUMNS, len(handles))
        figure.legend(handles, labels[0], loc="outside lower left", ncols=columns, **style)
        return
    for ax, some in zip(axes, labels, strict=True):
        if some:
            ax.legend(loc="best", ncols=min(2, len(some)), **style)
