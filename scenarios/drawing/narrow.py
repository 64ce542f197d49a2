"""A figure for a narrow screen: the same axes above one another, with text of the same size."""

from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.legend import Legend
from matplotlib.ticker import AutoLocator, MaxNLocator
from matplotlib.transforms import IdentityTransform, blended_transform_factory

WIDTH = 3.9  # inches: about the width of a telephone, so that 9 pt stays 9 pt
LEAST = 2.0  # inches, height of a panel that stood beside others
NUMBERS = 5  # along an axis, so that long ones do not touch
LETTERS = 44  # of a line below an axis
ENTRY = 16  # letters of an entry of a legend, of which two go beside each other


def make_narrow(figure: Figure) -> None:
    """Change a figure to the narrow width, with one panel in a row."""
    height = figure.get_size_inches()[1]
    panels = [ax for ax in figure.axes if ax.get_subplotspec() is not None]
    rows = {_row(ax) for ax in panels}
    if len(panels) > len(rows):
        grid = GridSpec(len(panels), 1, figure)
        for k, ax in enumerate(panels):
            ax.set_subplotspec(grid[k])
            ax.tick_params(labelbottom=True)
        height = max(height / len(rows), LEAST) * len(panels)
    figure.set_size_inches(WIDTH, height)
    for legend in list(figure.legends):
        _stack(figure, legend)
    for ax in panels:
        _free_labels(ax)
        ax.set_xlabel(fill(ax.get_xlabel(), LETTERS))
        if isinstance(ax.xaxis.get_major_locator(), AutoLocator):
            ax.xaxis.set_major_locator(MaxNLocator(NUMBERS))
    figure.set_layout_engine("constrained")


def _stack(figure: Figure, legend: Legend) -> None:
    """Lay a legend out anew in few columns; Matplotlib does so only when a legend is made."""
    texts = [text.get_text() for text in legend.get_texts()]
    columns = 1 if any(len(text) > ENTRY for text in texts) else 2
    size = legend.get_texts()[0].get_fontsize() if texts else None
    handles: Any = legend.legend_handles  # all are there once the legend was drawn
    made = figure.legend(
        handles, texts, loc="outside upper left", ncols=columns, frameon=False, fontsize=size
    )
    for line, old in zip(made.get_lines(), legend.get_lines(), strict=False):
        line.set_linewidth(old.get_linewidth())
    legend.remove()


def _free_labels(ax: Axes) -> None:
    """Let the labels of the axes follow the ticks again; Matplotlib cannot undo set_label_coords."""
    here, screen = ax.transAxes, IdentityTransform()
    ax.xaxis.label.set(position=(0.5, 0), transform=blended_transform_factory(here, screen))
    ax.yaxis.label.set(position=(0, 0.5), transform=blended_transform_factory(screen, here))
    for axis in (ax.xaxis, ax.yaxis):
        setattr(axis, "_autolabelpos", True)  # noqa: B010 - Matplotlib has no other way back


def _row(ax: Axes) -> tuple[int, int]:
    spec = ax.get_subplotspec()
    return (spec.rowspan.start, spec.rowspan.stop) if spec is not None else (0, 0)
