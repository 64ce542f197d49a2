"""The figure of compare: the outputs that differ most, from both FMUs, each with its difference below."""

from collections.abc import Sequence

import numpy as np

from estimator.record import Array, Record
from scenarios.closing.figures.channels import time_label
from scenarios.comparing.result import Comparison
from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    INK,
    Plot,
    envelope,
    legend,
    name_axes,
    sheet,
    times,
)
from scenarios.drawing.typography import unit

MOST = 4  # outputs drawn


def difference_plot(
    found: Comparison, record: Record, names: Sequence[str], courses: Sequence[Array]
) -> Plot:
    """Time series (N, n) of both FMUs over all runs, for the first MOST outputs of the comparison."""
    shown = list(found.outputs)[:MOST]
    layout = [[f"{name}{panel}"] for name in shown for panel in ("", "-")]
    heights = [1.3, 0.8] * len(shown)
    figure, axes = sheet(0.7 + 1.05 * sum(heights), layout, sharex=True, height_ratios=heights)
    ends = np.cumsum([len(run.t) for run in record.runs])[:-1]
    lines = ("first FMU", "-", 1.2, BEFORE), ("second FMU", (0, (4, 2)), 0.9, AFTER)
    for name in shown:
        j, said_unit = list(names).index(name), found.outputs[name].unit
        both = [np.split(course[:, j], ends) for course in courses]
        for i, t in enumerate(times(record)):
            for x, (text, style, width, colour) in zip(both, lines, strict=True):
                said = text if i == 0 else None
                axes[name].plot(
                    *envelope(t, x[i]), color=colour, linestyle=style, linewidth=width, label=said
                )
            axes[f"{name}-"].plot(*envelope(t, both[1][i] - both[0][i]), color=INK, linewidth=0.7)
        name_axes(axes[name], "", unit(said_unit), name)
        name_axes(axes[f"{name}-"], "", "difference")
    legend(figure, axes[shown[0]])
    axes[layout[-1][0]].set_xlabel(time_label(record), fontsize=9)
    return Plot(
        "compare", figure, "The outputs that differ most; below each, the second FMU minus the first."
    )
