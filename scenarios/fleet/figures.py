"""Figures of a fleet: verdicts over vehicles and places, distributions, courses over mileage."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    INK,
    LAW,
    NOISE,
    SHADE,
    Plot,
    name_axes,
    sheet,
    sheets,
)
from scenarios.drawing.typography import label, unit
from scenarios.fleet.drift import Points
from scenarios.fleet.findings import Drift, Level, Quantity
from scenarios.fleet.fleet import Assembled
from scenarios.fleet.result import quantity_words
from scenarios.fleet.tables import drift_row, level_row

# what a verdict means for who looks at the fleet, the most serious last
STANDINGS = {
    "not looked at": (SHADE, ()),
    "no answer": (INK, ("failed",)),
    "nothing found": (CLOUD, ("consistent", "no_discrepancy")),
    "not decided": (NOISE, ("ambiguous", "insufficient_excitation", "inconsistent")),
    "effect found": (BEFORE, ("traced", "several", "sensor_fault")),
    "unexplained": (LAW, ("unexplained", "diverged")),
}
LABELLED = 60  # vehicles that are named on the map
ROW = 0.16  # inches of a named vehicle
TALLEST = 9.6  # inches of the map
SHOWN = 8  # courses that are drawn, and quantities whose distribution is
BINS = 24


def map_plot(found: Assembled) -> Plot | None:
    """The most serious verdict of each vehicle at each place; a dot where a parameter drifts or changes."""
    rows = [r for r in found.rows if r["record"]]
    if not rows:
        return None
    vehicles = list(dict.fromkeys(r.vehicle for r in found.plan.records))
    places = list(dict.fromkeys(r.place for r in found.plan.records))
    names = list(STANDINGS)
    rank = {verdict: names.index(n) for n, (_, verdicts) in STANDINGS.items() for verdict in verdicts}
    worst = np.zeros((len(vehicles), len(places)), dtype=int)
    row_of, column_of = ({n: i for i, n in enumerate(group)} for group in (vehicles, places))
    for row in rows:
        at = row_of[row["vehicle"]], column_of[row["place"]]
        worst[at] = max(worst[at], rank.get(row["verdict"], 0))
    figure, axes = sheet(min(1.1 + ROW * len(vehicles), TALLEST), [["a"]])
    ax = axes["a"]
    colours = ListedColormap([colour for colour, _ in STANDINGS.values()])
    ax.imshow(worst, cmap=colours, vmin=-0.5, vmax=len(names) - 0.5, aspect="auto", interpolation="nearest")
    dots = {(row_of[d.vehicle], column_of[d.quantity[4]]) for d in found.findings.drifts if d.drifts}
    ax.plot([c for _, c in dots], [r for r, _ in dots], "o", color="white", mec=INK, markersize=5)
    ax.grid(False)
    every = max(1, -(-len(vehicles) // LABELLED))
    ax.set_yticks(range(0, len(vehicles), every), vehicles[::every], fontsize=7)
    ax.set_xticks(range(len(places)), [p or "–" for p in places], fontsize=8)
    used = sorted({int(x) for x in worst.ravel()})
    handles = [Patch(facecolor=STANDINGS[names[k]][0], label=names[k]) for k in used]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    name_axes(ax, "place", "vehicle")
    return Plot(
        "map",
        figure,
        "The most serious verdict of a vehicle at a place. A dot: a parameter drifts or changes there.",
    )


def level_plots(found: Assembled) -> Iterator[Plot]:
    """The distributions of the vehicles' means, those quantities first in which one deviates."""
    groups: dict[Quantity, list[Level]] = defaultdict(list)
    for level in found.findings.levels:
        groups[level.quantity].append(level)
    several = [g for g in groups.values() if len(g) > 1]
    several.sort(key=lambda g: -max(abs(x.distance) for x in g))
    for ending, some in sheets(several[:SHOWN]):
        names = [[f"{k}"] for k in range(len(some))]
        figure, axes = sheet(0.3 + 1.55 * len(some), names)
        for k, group in enumerate(some):
            _distribution(axes[f"{k}"], group)
        yield Plot(
            f"distributions{ending}",
            figure,
            "Means of the vehicles of a class, each quantity by itself; the line is the median, the shaded "
            "band the class's spread about it (95 %), red marks are vehicles that deviate.",
        )


def _distribution(ax: Any, group: Sequence[Level]) -> None:
    values = np.array([x.value for x in group])
    of = group[0].of_class
    ax.axvspan(of.centre - 2 * of.spread, of.centre + 2 * of.spread, color=SHADE, linewidth=0, zorder=0)
    ax.hist(values, bins=min(BINS, max(5, len(values) // 2)), color=CLOUD)
    ax.axvline(of.centre, color=AFTER, linewidth=1.2)
    for x in group:
        if x.deviates:
            ax.plot([x.value], [0.5], "v", color=LAW, markersize=6, clip_on=False)
    name_axes(ax, label(_words(group[0]), group[0].unit), "vehicles")


def course_plots(found: Assembled) -> Iterator[Plot]:
    """The courses that drift or change, the surest first, before all others of their class."""
    drifting = sorted((d for d in found.findings.drifts if d.drifts), key=lambda d: d.q_value)[:SHOWN]
    others: Mapping[Quantity, list[Points]] = _by_quantity(found.findings.drifts)
    for ending, some in sheets(drifting):
        names = [[f"{k}"] for k in range(len(some))]
        figure, axes = sheet(0.3 + 1.75 * len(some), names)
        for k, d in enumerate(some):
            _course(axes[f"{k}"], d, others[d.quantity], found.plan.declared.mileage_unit)
        yield Plot(
            f"courses{ending}",
            figure,
            "Values with their standard errors over mileage, and the line or the change that describes them; "
            "grey: the other vehicles of the class at the same place.",
        )


def _by_quantity(drifts: Sequence[Drift]) -> dict[Quantity, list[Points]]:
    found: dict[Quantity, list[Points]] = defaultdict(list)
    for d in drifts:
        found[d.quantity].append(d.points)
    return found


def _course(ax: Any, d: Drift, others: Sequence[Points], mileage_unit: str) -> None:
    for p in others:
        ax.plot(p.mileage, p.value, ".", color=CLOUD, markersize=2.5, zorder=1)
    p = d.points
    ax.errorbar(p.mileage, p.value, p.std, fmt="o", color=AFTER, markersize=3.5, linewidth=0.9, zorder=3)
    w = 1 / (p.std**2 + d.course.scatter**2)
    change = d.course.change
    if d.course.form == "change" and change is not None:
        ax.axvspan(change.low, change.high, color=SHADE, linewidth=0, zorder=0)
        for side in (p.mileage < change.at, p.mileage > change.at):
            mean = float(np.sum((w * p.value)[side]) / w[side].sum())
            ax.hlines(mean, p.mileage[side][0], p.mileage[side][-1], color=LAW, linewidth=1.4, zorder=2)
    else:
        middle = [float(np.sum(w * x) / w.sum()) for x in (p.mileage, p.value)]
        ends = p.mileage[[0, -1]]
        ax.plot(
            ends, middle[1] + d.course.line.slope * (ends - middle[0]), color=LAW, linewidth=1.4, zorder=2
        )
    where = f" at {d.quantity[4]}" if d.quantity[4] else ""
    name_axes(ax, f"mileage in {mileage_unit}", unit(d.unit), f"{d.vehicle}{where}: {_words(d)}")


def _words(x: Drift | Level) -> str:
    row = drift_row(x) if isinstance(x, Drift) else level_row(x)
    return quantity_words(row)
