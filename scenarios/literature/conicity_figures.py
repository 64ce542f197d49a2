"""Figures of the conicity's row: filters over time, and the curves over the shift."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    LAW,
    Plot,
    legend,
    name_axes,
    sheet,
)
from scenarios.literature.conicity_fits import yaw_response

if TYPE_CHECKING:
    from scenarios.literature.conicity import Tried

SHOWN = 8.0  # s of the filters, at the end
YAWED = 2.0  # s of the yaw's course, there
ROOM = 0.15  # of conicity, above and below the true one


def figures(one: Tried) -> list[Plot]:
    """Over time, and over the shift."""
    name = one.case.name.replace(" ", "_")
    return [_over_time(one, f"conicity_filters_{name}"), _over_shift(one, f"conicity_curves_{name}")]


def _over_time(one: Tried, name: str) -> Plot:
    figure, axes = sheet(1.7 * len(one.filters) + 0.4, [[way] for way in one.filters], sharex=True)
    t = one.record.t
    part = t >= t[-1] - SHOWN
    for way, found in one.filters.items():
        ax = axes[way]
        ax.plot(t[part], one.true[part], color=CLOUD, linewidth=2.6, label="true")
        value, off = found.value["conicity"][part], 2 * found.std["conicity"][part]
        ax.fill_between(t[part], value - off, value + off, color=AFTER, alpha=0.18, linewidth=0)
        ax.plot(t[part], value, color=AFTER, linewidth=0.8, label="estimated")
        if way != "constant":
            ax.set_ylim(min(0.0, one.true.min()) - ROOM, one.true.max() + ROOM)
        last = way == list(one.filters)[-1]
        name_axes(ax, "time [s]" if last else "", "conicity", f"filter: {way}")
        ax.set_xlim(t[part][0], t[-1])
    legend(figure, axes["constant"])
    return Plot(name, figure, "Conicity under the wheelset, and what filters make of it.")


def _over_shift(one: Tried, name: str) -> Plot:
    figure, axes = sheet(5.2, [["table", "fits"], ["yaw", "yaw"]])
    x, nodes = 1e3 * one.grid, one.table.nodes
    axes["fits"].plot(x, one.both.curve(one.grid), color=LAW, linewidth=1.2, linestyle="--", zorder=5)
    axes["table"].plot([], [], color=LAW, linestyle="--", label="hybrid, track unknown")  # for the legend
    for key in ("table", "fits"):
        axes[key].plot(x, one.curve(one.grid), color=CLOUD, linewidth=2.8, label="true")
    axes["table"].plot(
        x, one.table.curve(one.grid), color=AFTER, linewidth=1.0, label="table, piecewise cubics"
    )
    shown = (nodes >= one.grid[0]) & (nodes <= one.grid[-1])
    axes["table"].plot(1e3 * nodes[shown], one.table.values[shown], "x", color=AFTER, markersize=5)
    t = one.record.t
    part = t >= t[-1] - YAWED
    axes["yaw"].plot(t[part], 1e3 * one.record.columns["psi_true"][part], color=CLOUD, linewidth=2.8)
    for curve, colour in zip(one.fits.values(), (BEFORE, AFTER), strict=True):
        axes["fits"].plot(x, curve(one.grid), color=colour, linewidth=1.0)
        axes["yaw"].plot(t[part], 1e3 * yaw_response(one.record, curve)[part], color=colour, linewidth=1.0)
    axes["table"].plot([], [], color=BEFORE, label="one cubic")  # for the legend
    name_axes(axes["table"], "y - d [mm]", "conicity", "table that the filter taught itself")
    name_axes(axes["fits"], "y - d [mm]", "", "least squares")
    name_axes(axes["yaw"], "time [s]", "yaw [mrad]", "yaw by the fitted equation")
    low, high = np.min(one.curve(one.grid)), np.max(one.curve(one.grid))
    for key in ("table", "fits"):
        axes[key].set_ylim(low - 0.1, high + 0.1)
    axes["yaw"].set_xlim(t[part][0], t[-1])
    legend(figure, axes["table"])
    return Plot(name, figure, "Conicity over the shift, found and true, and the yaw that follows from it.")
