"""Figures: amplitude, frequency and multiplier over the parameter, and motions beside a cycle."""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes

from scenarios.bifurcation.branch import Fold
from scenarios.bifurcation.result import Bifurcation
from scenarios.drawing.sheet import AFTER, BEFORE, INK, LAW, NOISE, Plot, legend, name_axes, sheet
from scenarios.drawing.typography import label

Item = TypeVar("Item")

WIDTH = 4.9  # in; read on a telephone, too
MILLI = 1e3
SMALL = 0.05  # of the base unit m or rad, below which an amplitude is drawn in thousandths
NEAR = 0.08  # of the range, within which two numbers of folds would lie on each other
SHOWN = 5.0  # multipliers are drawn up to this
STABLE: dict[str, Any] = {"color": AFTER, "linewidth": 1.7}
UNSTABLE: dict[str, Any] = {"color": LAW, "linewidth": 1.4, "linestyle": (0, (4, 2))}


def all_plots(found: Bifurcation) -> list[Plot]:
    """Every figure of the page, in its order."""
    plots = [diagram(found)]
    if any(limb.branch.cycles for limb in found.limbs):
        plots.append(course(found))
    if any(limb.releases for limb in found.limbs):
        plots.append(beside(found))
    return plots


def scale_of(found: Bifurcation) -> tuple[float, str | None]:
    """Factor and unit in which amplitudes of the output are drawn."""
    largest = max((c.amplitude for limb in found.limbs for c in limb.branch.cycles), default=1.0)
    if found.output_unit in ("m", "rad", "m/s", "rad/s") and largest < SMALL:
        return MILLI, f"m{found.output_unit}"
    return 1.0, found.output_unit


def diagram(found: Bifurcation) -> Plot:
    """Amplitude over the parameter: rest and limit cycles, stable drawn through, unstable dashed."""
    figure, axes = sheet(3.6, [["amplitude"]], width=WIDTH)
    ax = axes["amplitude"]
    factor, of = scale_of(found)
    said: set[str] = set()
    for begin, end, unstable in found.rest_stretches():
        _line(ax, said, unstable, [begin, end], [0.0, 0.0])
    for limb in found.limbs:
        for unstable, cycles in _joined(limb.branch.cycles, lambda c: c.unstable > 0):
            _line(ax, said, unstable, [c.parameter for c in cycles], [c.amplitude * factor for c in cycles])
        for fold in limb.folds:
            ax.plot(fold.parameter, fold.cycle.amplitude * factor, "o", color=INK, markersize=4, zorder=4)
        for fold in _apart(found, limb.folds):
            first = fold.parameter == min(f.parameter for f in limb.folds)
            off, side = ((-6, -3), "right") if first else ((6, -10), "left")
            _mark(ax, fold.parameter, fold.cycle.amplitude * factor, off, side)
        if limb.start is not None:
            ax.plot(limb.start, 0.0, "s", color=INK, markersize=4, zorder=4, clip_on=False)
            _mark(ax, limb.start, 0.0, (-4, 6), "right")
    across = label(found.parameter, found.parameter_unit)
    name_axes(ax, across, label(f"amplitude of {found.output}", of))
    ax.set_xlim(found.low, found.high)
    ax.set_ylim(bottom=0)
    legend(figure, ax)
    return Plot(
        "diagram", figure,
        "Rest and limit cycles over the parameter: half of the output's range in a period. Stable motions "
        "are drawn through, unstable ones dashed. Dots: folds; squares: where the limit cycles begin.",
    )  # fmt: skip


def course(found: Bifurcation) -> Plot:
    """Frequency, and the largest Floquet multiplier, over the parameter."""
    figure, axes = sheet(4.2, [["frequency"], ["multiplier"]], width=WIDTH, sharex=True)
    for limb in found.limbs:
        for unstable, cycles in _joined(limb.branch.cycles, lambda c: c.unstable > 0):
            how = UNSTABLE if unstable else STABLE
            at = [c.parameter for c in cycles]
            axes["frequency"].plot(at, [1 / c.period for c in cycles], **how)
            if len(cycles[0].multipliers) > 1:
                size = np.abs([c.multipliers[0] for c in cycles])
                axes["multiplier"].plot(at, np.minimum(size, SHOWN), **how)
    axes["multiplier"].axhline(1, color=NOISE, linewidth=0.8)
    name_axes(axes["frequency"], "", "frequency in Hz")
    name_axes(axes["multiplier"], label(found.parameter, found.parameter_unit), "largest multiplier")
    axes["multiplier"].set_xlim(found.low, found.high)
    return Plot(
        "course", figure,
        "Frequency of the limit cycles, and their largest Floquet multiplier: by how much a disturbance "
        f"grows in a period (cut off at {SHOWN:g}). Below 1 the cycle is stable.",
    )  # fmt: skip


def beside(found: Bifurcation) -> Plot:
    """Simulations from just inside and just outside of unstable cycles."""
    every = [r for limb in found.limbs for r in limb.releases]
    places = list(dict.fromkeys(r.cycle.parameter for r in every))[:3]
    figure, axes = sheet(1.9 * len(places) + 0.6, [[f"{k}"] for k in range(len(places))], width=WIDTH)
    factor, of = scale_of(found)
    for k, place in enumerate(places):
        ax = axes[f"{k}"]
        for release in (r for r in every if r.cycle.parameter == place):
            inside = release.share < 1
            name = f"from {abs(release.share - 1):.0%} {'inside' if inside else 'outside'}"
            colour = AFTER if inside else BEFORE
            ax.plot(
                release.t,
                release.output * factor,
                color=colour,
                linewidth=0.8,
                label=name,
                zorder=3 if inside else 2,
            )
            for extreme in release.cycle.extremes:
                ax.axhline(extreme * factor, color=LAW, linewidth=0.9, linestyle=(0, (4, 2)))
        name_axes(ax, "", label(found.output, of), f"{found.parameter} = {found.of_parameter(place)}")
    axes[f"{len(places) - 1}"].set_xlabel("time in s", fontsize=9)
    legend(figure, axes["0"])
    return Plot(
        "beside", figure,
        "Simulations that start from the states of an unstable limit cycle (dashed: its extremes), moved "
        "a little towards rest and away from it.",
    )  # fmt: skip


def _joined(items: Sequence[Item], unstable: Callable[[Item], bool]) -> Iterator[tuple[bool, list[Item]]]:
    """Stretches of equal stability; each begins where the last one ends, so that lines have no gaps."""
    last: list[Item] = []
    for kind, stretch in groupby(items, unstable):
        some = [*last, *stretch]
        last = some[-1:]
        yield kind, some


def _apart(found: Bifurcation, folds: Sequence[Fold]) -> Iterator[Fold]:
    """The folds whose numbers can be read beside one another, the least first."""
    written: list[float] = []
    for fold in sorted(folds, key=lambda f: f.parameter):
        if all(abs(fold.parameter - p) > NEAR * (found.high - found.low) for p in written):
            written.append(fold.parameter)
            yield fold


def _line(ax: Axes, said: set[str], unstable: bool, x: list[float], y: list[float]) -> None:
    name = "unstable" if unstable else "stable"
    ax.plot(x, y, label=None if name in said else name, **(UNSTABLE if unstable else STABLE), clip_on=False)
    said.add(name)


def _mark(ax: Axes, x: float, y: float, off: tuple[int, int], side: str = "left") -> None:
    ax.annotate(f"{x:.4g}", (x, y), off, textcoords="offset points", fontsize=8, color=INK, ha=side)
