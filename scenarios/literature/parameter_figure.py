"""One panel for each case: a parameter over time, with its true value and its estimates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from matplotlib.axes import Axes

from estimator.record import Array
from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    INK,
    LAW,
    Plot,
    envelope,
    legend,
    name_axes,
    sheet,
)
from scenarios.literature.following import Followed

COLOURS = (AFTER, BEFORE, LAW, CLOUD)
PANEL = 2.0  # in
THIN = 400  # points of a band


@dataclass(frozen=True)
class Line:
    """An estimate and its deviation over time, (N,) each."""

    t: Array  # s
    value: Array
    std: Array

    @classmethod
    def of(cls, found: Followed, name: str, scale: float = 1.0) -> Self:
        """Of a filter's estimates, in another unit."""
        return cls(found.t, scale * found.value[name], scale * found.std[name])


@dataclass(frozen=True)
class Panel:
    """A case: the truths (N,) at the times of the first line, and the estimates by label."""

    title: str
    truths: Sequence[Array]
    lines: Mapping[str, Line]
    label: str = ""
    limits: tuple[float, float] | None = None
    log_time: bool = False


def parameter_figure(name: str, panels: Sequence[Panel]) -> Plot:
    """Estimates with the band of two deviations of the first one."""
    layout = [[f"{i}"] for i in range(len(panels))]
    figure, axes = sheet(PANEL * len(panels) + 0.4, layout)
    for i, panel in enumerate(panels):
        ax = axes[f"{i}"]
        _draw(ax, panel)
        name_axes(ax, "time [s]" if i == len(panels) - 1 else "", panel.label, panel.title)
    shown: set[tuple[str, ...]] = set()
    for i, panel in enumerate(panels):
        if tuple(panel.lines) not in shown and shown:
            axes[f"{i}"].legend(fontsize=7.5, frameon=False, ncols=3)
        elif not shown:
            legend(figure, axes["0"])
        shown.add(tuple(panel.lines))
    return Plot(name, figure, "Estimates, the band of two standard deviations, and the truth.")


def _draw(ax: Axes, panel: Panel) -> None:
    first = next(iter(panel.lines.values()))
    for (label, line), colour in zip(panel.lines.items(), COLOURS, strict=False):
        points = (line.t, line.value) if panel.log_time else envelope(line.t, line.value)
        ax.plot(*points, color=colour, linewidth=0.9, label=label)
    thin = slice(None, None, max(1, len(first.t) // THIN))
    t, x, off = first.t[thin], first.value[thin], 2 * first.std[thin]
    ax.fill_between(t, x - off, x + off, color=AFTER, alpha=0.18, linewidth=0)
    for i, true in enumerate(panel.truths):
        ax.plot(first.t, true, color=INK, linewidth=1.0, linestyle="--", label="" if i else "true")
    if panel.log_time:
        ax.set_xscale("log")
    ax.set_xlim(first.t[1] if panel.log_time else first.t[0], first.t[-1])
    if panel.limits:
        ax.set_ylim(*panel.limits)
