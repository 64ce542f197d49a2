"""Errors on the test part as bars."""

import numpy as np
from matplotlib.axes import Axes

from scenarios.closing.page.glossary import Glossary
from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    INK,
    NOISE,
    Plot,
    name_axes,
    sheet,
)
from scenarios.drawing.typography import HELD, number, quantity

COLOURS = {"declared": CLOUD, "before": BEFORE, "after": AFTER, "placebo": NOISE, "black_box": NOISE}
NAMES = {
    "declared": "as declared",
    "before": "before",
    "after": "after",
    "placebo": "best wrong effect",
    "black_box": "black box",
}
FREE = NAMES | {"before": "calibrated", "after": "with free form", "placebo": "nearest effect"}
ALONE = {k: v for k, v in FREE.items() if k != "after"}  # used if nothing was added to the FMU
STEPS = {1.2: (1, 2, 5), 2.5: (1, 3), np.inf: (1,)}  # labels in each decade, by the decades of the axis
LABELS = 3  # largest number of decades that get a label
CAPTION = (
    "Error on the test part in multiples of the noise floor, on a logarithmic scale. The bars begin at "
    "the noise floor: no model can be expected to have a smaller error."
)


def error_plot(errors: dict[str, dict[str, float]], words: Glossary, free: bool) -> Plot:
    """Bars of the errors of each output.

    errors: by output, then by the keys of NAMES and `noise`.
    free: whether a force of free form was added to the FMU instead of an effect.
    """
    added = all("after" in values for values in errors.values())
    names = (FREE if free else NAMES) if added else ALONE
    outputs = list(errors)
    rows = [outputs[i : i + 2] for i in range(0, len(outputs), 2)]
    layout = [row if len(row) == 2 or len(rows) == 1 else [*row, "."] for row in rows]
    bars = len(next(iter(errors.values()))) - 1
    figure, axes = sheet((0.75 + 0.27 * bars) * len(rows), layout)
    for output, values in errors.items():
        _bars(axes[output], values, names, words.unit(output))
        name_axes(axes[output], "error over noise", "", output)
    return Plot("error", figure, CAPTION)


def _bars(ax: Axes, values: dict[str, float], names: dict[str, str], unit: str) -> None:
    """One bar per model, from the noise floor to its error."""
    shown = [k for k in reversed(names) if k in values]
    over = {k: values[k] / values["noise"] for k in shown}
    decades = np.log10(max(*over.values(), 3.0))
    ax.set_xscale("log")
    for i, key in enumerate(shown):
        ax.barh(i, over[key] - 1, left=1, color=COLOURS[key], height=0.62)
        text, at = quantity(number(values[key]), unit), max(over[key], 1.0) * 10 ** (0.03 * decades)
        ax.text(at, i, text, va="center", fontsize=8, color=INK)
    ax.axvline(1, color=INK, linewidth=0.9)
    low = min(*over.values(), 10 ** (-0.05 * decades))
    ax.set_xlim(low, 10 ** (1.55 * decades))
    steps = next(s for limit, s in STEPS.items() if decades <= limit)
    powers = range(0, int(decades) + 1, max(1, int(np.ceil(decades / LABELS))))  # so that none overlap
    ticks = [s * 10**d for d in powers for s in steps if s * 10**d <= 10 ** (1.1 * decades)]
    ax.set_xticks(ticks, [number(t, 1).removeprefix(f"1{HELD}×{HELD}") for t in ticks])
    ax.minorticks_off()
    ax.set_yticks(range(len(shown)), [names[k] for k in shown])
    ax.grid(False, axis="y")
