"""The figure of the costs: one panel for each number that a cost grows with."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from benchmarks.group import Curve
from scenarios.drawing.sheet import AFTER, BEFORE, DPI, LAW, NOISE, name_axes, sheet

PANELS = (("sigma points", "samples"), ("candidates", "cores"))
COLOURS = (AFTER, BEFORE, LAW)
ROOM = 1.35  # of an axis beside the points


def write_figure(curves: Sequence[Curve], file: Path) -> None:
    """Write a PNG of all curves on logarithmic axes, each with its first point scaled in proportion."""
    figure, axes = sheet(5.6, PANELS)
    for panel, ax in axes.items():
        own = [c for c in curves if c.panel == panel]
        for curve, colour in zip(own, COLOURS, strict=False):
            _draw(ax, curve, colour)
        ax.set_xscale("log")
        ax.set_yscale("log")
        if own:
            _label(ax, own)
        else:
            ax.text(0.5, 0.5, "not measured", transform=ax.transAxes, ha="center", fontsize=8.5, color=NOISE)
        name_axes(ax, f"number of {panel}", "", panel)
    figure.savefig(file, format="png", dpi=DPI)


def _draw(ax: Axes, curve: Curve, colour: str) -> None:
    shares = [n / curve.x[0] for n in curve.x]
    ideal = [curve.y[0] * (1 / s if curve.panel == "cores" else s) for s in shares]
    ax.plot(curve.x, ideal, color=colour, linewidth=0.9, linestyle=(0, (4, 3)))
    ax.plot(curve.x, curve.y, color=colour, linewidth=1.6, marker="o", markersize=4, label=curve.label)


def _label(ax: Axes, curves: Sequence[Curve]) -> None:
    """Ticks at the numbers that were measured, limits with room for the legend, and the legend."""
    x, y = ([v for c in curves for v in getattr(c, name)] for name in ("x", "y"))
    ticks = sorted(set(curves[0].x) if len(curves) == 1 else {min(x), max(x)})
    ax.set_xticks(ticks, [f"{n:g}" for n in ticks])
    ax.set_xticks([], minor=True)
    ax.set_xlim(min(x) / ROOM**0.5, max(x) * ROOM**0.5)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_ylim(min(y) / ROOM**2, max(y) * ROOM**4)
    ax.legend(loc="upper left", frameon=False, fontsize=8)
