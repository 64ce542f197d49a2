"""Figures of a plan: how large effects must be to be seen, and what would split each class."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from scenarios.drawing.sheet import AFTER, BEFORE, LAW, NOISE, Plot, name_axes, sheet
from scenarios.planning.result import PlanResult

ROW = 0.19  # inches per line
SHOWN = 40  # effects in the figure of sizes, those that need the largest share of an output first
WORDS = 44  # characters of a class
MARGINS = (1e-3, 30.0)  # range of the axis of margins


def size_plot(result: PlanResult) -> Plot | None:
    """The smallest visible size of each effect, as share of the output that shows most of it."""
    count = len(_lines(result))
    if not count:
        return None
    figure, axes = sheet(1.0 + ROW * count, [["a"]])
    draw_sizes(axes["a"], result)
    return Plot(
        "sizes",
        figure,
        "Smallest visible size of the effects, as the residual that they leave in the output that shows most "
        f"of it. Those {SHOWN} are shown that need the largest share of their output.",
    )


def _lines(result: PlanResult) -> list[dict[str, Any]]:
    """The effects that are drawn, those that need the largest share of an output last."""
    lines = [v for v in result.visible if v["share"] is not None]
    return sorted(lines, key=lambda v: v["share"])[-SHOWN:]


def draw_sizes(ax: Axes, result: PlanResult) -> Axes:
    """Draw into axes from which size on each effect is detected, and from which on it also matters."""
    lines = _lines(result)
    at = np.arange(len(lines))
    both = np.array([v["share"] for v in lines])
    ratio = np.array([v["detected"] / v["smallest"] if v["detected"] else np.nan for v in lines])
    ax.hlines(at, 100 * both * ratio, 100 * both, color=NOISE, linewidth=0.8)
    ax.plot(100 * both * ratio, at, "o", color=AFTER, markersize=4, label="is detected")
    ax.plot(100 * both, at, "s", color=BEFORE, markersize=4, label="also matters")
    ax.set_xscale("log")
    ax.set_yticks(at, [f"{v['kind']} @ {v['location']}, {v['parameter']}" for v in lines], fontsize=7)
    ax.set_ylim(-0.7, len(lines) - 0.3)
    name_axes(ax, "residual that is left after calibration, % of the rms of its output")
    ax.legend(frameon=False, fontsize=8, loc="lower right")
    return ax


def split_plot(result: PlanResult) -> Plot | None:
    """How far the best sensor and the best change of an input tell each group apart."""
    classes = result.classes
    if not classes:
        return None
    figure, axes = sheet(1.1 + 1.6 * ROW * len(classes), [["a"]])
    ax = axes["a"]
    rows = classes[::-1]
    for i, c in enumerate(rows):
        ax.plot(_on_axis(c["margin"]), i, "o", color=NOISE, markersize=5, label=_once("as planned", i))
        for kind, colour, marker, word in (
            ("sensors", AFTER, "s", "with the best sensor"),
            ("excitations", BEFORE, "^", "with the best change of an input"),
        ):
            if c[kind]:
                best = max(s["margin"] for s in c[kind])
                ax.plot(_on_axis(best), i, marker, color=colour, markersize=5)
            ax.plot([], [], marker, color=colour, markersize=5, label=_once(word, i))
    ax.axvline(1.0, color=LAW, linewidth=0.9, linestyle="--")
    ax.set_xscale("log")
    ax.set_xlim(MARGINS[0] / 1.5, MARGINS[1] * 1.5)
    ax.set_yticks(range(len(rows)), [_words(c) for c in rows], fontsize=7)
    ax.set_ylim(-0.7, len(rows) - 0.3)
    name_axes(ax, "margin of the closest pair")
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return Plot(
        "classes",
        figure,
        "Margin of the closest pair of each group, which is told apart from 1 on (dashed): as planned, and "
        "with the one sensor or change of an input that helps most. Margins outside of "
        f"{MARGINS[0]:g} to {MARGINS[1]:g} are drawn at the edge.",
    )


def _on_axis(margin: float) -> float:
    return float(np.clip(margin, *MARGINS))


def _once(label: str, i: int) -> str:
    """A label for the first entry of the legend only."""
    return label if i == 0 else "_nolegend_"


def _words(c: dict[str, Any]) -> str:
    first, *more = c["effects"]
    text = f"{first} and {len(more)} more"
    return text if len(text) <= WORDS else text[: WORDS - 1] + "…"
