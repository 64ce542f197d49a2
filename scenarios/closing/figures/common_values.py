"""An effect's parameters in several experiments, each with its standard error, and the value for all."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes

from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    INK,
    Plot,
    name_axes,
    sheet,
)
from scenarios.drawing.typography import label

ROW = 0.24  # inches, height of the row of an experiment
ERRORS = 2.0  # half length of a bar in standard errors
CAPTION = (
    "Parameters of {}, fitted to each experiment by itself and to all experiments together. "
    "The bars reach two standard errors to either side."
)
Value = Sequence[float]  # value and standard error


def common_plot(
    name: str, words: str, together: Mapping[str, Value], alone: Mapping[str, Mapping[str, Value]],
    units: Mapping[str, str],
) -> Plot:  # fmt: skip
    """One panel per parameter; together: values by parameter; alone: by experiment, then parameter."""
    figure, axes = sheet(0.9 + ROW * (len(alone) + 1), [list(together)])
    for i, (parameter, value) in enumerate(together.items()):
        rows = {e: own[parameter] for e, own in alone.items() if parameter in own}
        _intervals(axes[parameter], rows, value, named=i == 0)
        short = parameter.removeprefix(f"{name}_")
        name_axes(axes[parameter], label(short, units.get(parameter)))
    return Plot(f"common_{name}", figure, CAPTION.format(words))


def _intervals(ax: Axes, rows: Mapping[str, Value], together: Value, named: bool) -> None:
    for i, (value, error) in enumerate(rows.values()):
        ax.errorbar(value, i, xerr=ERRORS * error, fmt="o", color=BEFORE, markersize=4, capsize=3)
    value, error = together
    ax.axvspan(value - ERRORS * error, value + ERRORS * error, color=AFTER, alpha=0.12, linewidth=0)
    ax.errorbar(value, len(rows), xerr=ERRORS * error, fmt="D", color=AFTER, markersize=4, capsize=3)
    ax.set_ylim(len(rows) + 0.6, -0.6)
    ax.set_yticks(range(len(rows) + 1), [*rows, "all"] if named else [""] * (len(rows) + 1))
    ax.tick_params(axis="y", length=0, colors=INK)
    ax.locator_params(axis="x", nbins=4)
