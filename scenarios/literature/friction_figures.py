"""Figures of the friction row: the estimates with their bands, and the alignment found along."""

from collections.abc import Mapping

import numpy as np

from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    INK,
    LAW,
    NOISE,
    Plot,
    envelope,
    legend,
    name_axes,
    sheet,
)
from scenarios.literature.following import Followed, moving_mean
from scenarios.literature.row import Measured

WAYS = {
    "a": (CLOUD, "(a) published, mean of 2 s"),
    "b": (AFTER, "(b) alignment too"),
    "c": (BEFORE, "(c) alignment known"),
}
SHOWN = 4.0  # s of the alignment
PANEL = 1.55  # in
WINDOW = 2000  # samples, of the mean

Found = Mapping[str, Mapping[str, Followed]]


def friction_figure(measured: Measured, found: Found) -> Plot:
    """mu0 of every case and way over time, with the band of two deviations of (b)."""
    rows = -(-len(measured) // 2)
    layout = [[f"{2 * i + j}" if 2 * i + j < len(measured) else "." for j in (0, 1)] for i in range(rows)]
    figure, axes = sheet(PANEL * rows + 0.5, layout, sharex=True)
    for ax, (case, record) in zip(axes.values(), measured, strict=False):
        for way, (colour, label) in WAYS.items():
            f = found[case.name][way]
            mu0 = f.value["mu0"]
            if way == "a":  # the published filter's estimate moves over its whole range
                mu0 = moving_mean(np.nan_to_num(mu0), WINDOW)
            ax.plot(*envelope(f.t, mu0), color=colour, linewidth=0.8, label=label)
        b = found[case.name]["b"]
        thin = slice(None, None, 100)
        mean, off = b.value["mu0"][thin], 2 * b.std["mu0"][thin]
        ax.fill_between(b.t[thin], mean - off, mean + off, color=AFTER, alpha=0.2, linewidth=0)
        ax.plot(record.t, case.truth("mu0", record.t), color=INK, linewidth=1.0, linestyle="--", label="true")
        ax.axhline(0.15, color=LAW, linewidth=0.6, linestyle=":", label="0.15")
        name_axes(ax, "time [s]", "mu0", case.name.replace("_", " ").replace("-", " to "))
    legend(figure, next(iter(axes.values())))
    return Plot("friction_ukf", figure, "Friction coefficient, estimated three ways.")


def alignment_figure(measured: Measured, found: Found) -> Plot:
    """A few seconds of the alignment, true and as (b) found it."""
    static = [(case, record) for case, record in measured if not case.later] or list(measured)
    figure, axes = sheet(PANEL * len(static) + 0.5, [[case.name] for case, _ in static], sharex=True)
    for case, record in static:
        ax, b = axes[case.name], found[case.name]["b"]
        last = record.t[-1] - SHOWN
        part = record.t >= max(last, record.t[0])
        t, off = record.t[part], 2e3 * b.std["y_irr"][part]
        guess = 1e3 * b.value["y_irr"][part]
        ax.fill_between(t, guess - off, guess + off, color=AFTER, alpha=0.2, linewidth=0)
        ax.plot(t, guess, color=AFTER, linewidth=0.9, label="estimated")
        ax.plot(
            t, 1e3 * record.columns["y_irr"][part], color=NOISE, linestyle="--", linewidth=1.0, label="true"
        )
        ax.set_xlim(t[0], t[-1])
        name_axes(
            ax, "time [s]" if np.array_equal(ax, axes[static[-1][0].name]) else "", "y_irr [mm]", case.name
        )
    legend(figure, axes[static[0][0].name])
    return Plot("alignment", figure, "Alignment of the track, found along with the friction coefficient.")
