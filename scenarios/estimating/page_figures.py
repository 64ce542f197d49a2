"""Figures of estimate: quantities with their bands, innovations, correlations."""

from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes

from estimator.filters.consistency import whiteness
from estimator.record import Array
from scenarios.drawing.sheet import (
    AFTER,
    CLOUD,
    INK,
    LAW,
    NOISE,
    POINTS,
    Plot,
    envelope,
    legend,
    name_axes,
    sheet,
    sheets,
)
from scenarios.drawing.typography import label
from scenarios.estimating.findings import Findings
from scenarios.estimating.setup import BAND

ROW = 1.55  # inches, height of a panel
SAID = "Estimate of {}, with the band that contains the true value with 95 % probability{}."


def band_plots(found: Findings, truth: Mapping[str, tuple[Array, Array]]) -> Iterator[Plot]:
    """Each quantity over time, parameters and inputs first."""
    n = len(found.joint.states)
    names = [*found.history.names[n:], *found.history.names[:n]] if len(found.history.t) else []
    for ending, some in sheets(names):
        figure, axes = sheet(ROW * len(some) + 0.6, [[name] for name in some], sharex=True)
        for name in some:
            _band(axes[name], found, name, truth.get(name))
        name_axes(axes[some[-1]], "time in s", axes[some[-1]].get_ylabel())
        if any(name in truth for name in some):
            legend(figure, axes[next(name for name in some if name in truth)])
        against = ", and the truth" if any(name in truth for name in some) else ""
        yield Plot(f"estimate{ending}", figure, SAID.format(", ".join(some), against))


def _band(ax: Axes, found: Findings, name: str, true: tuple[Array, Array] | None) -> None:
    h, i = found.history, found.history.names.index(name)
    at = np.unique(np.linspace(0, len(h.t) - 1, min(len(h.t), 2 * POINTS)).astype(int))
    low, high = (
        found.joint.values(h.x[at] + side * BAND * h.std[at], h.std[at])[0][:, i] for side in (-1, 1)
    )
    t, value = h.t[at], found.value[at, i]
    ax.fill_between(t, low, high, color=CLOUD, alpha=0.55, linewidth=0, label="95 % band")
    ax.plot(t, value, color=AFTER, linewidth=1.1, label="estimate")
    if true is not None:
        ax.plot(t, np.interp(t, *true), color=LAW, linewidth=1.0, linestyle="--", label="truth")
    # the wide band at the start is left out of the range of the axis
    later = slice(len(t) // 20, None)
    shown = np.concatenate([value[later], low[later], high[later]])
    margin = 0.06 * float(np.ptp(shown)) or 0.5 * abs(float(shown[0])) or 1.0
    ax.set_ylim(float(shown.min()) - margin, float(shown.max()) + margin)
    ax.set_xlim(float(t[0]), float(t[-1]) if t[-1] > t[0] else float(t[0]) + 1.0)
    variables = found.joint.archive.description.variables
    name_axes(ax, "", label(name, variables[name].unit if name in variables else None))


def innovation_plots(found: Findings) -> Iterator[Plot]:
    """Innovations (measured minus predicted outputs) over time, and their autocorrelation."""
    h, accepted = found.history, found.history.accepted
    for ending, some in sheets(list(found.setup.outputs) if len(h.t) > 1 else []):
        layout = [[name, f"{name} memory"] for name in some]
        figure, axes = sheet(ROW * len(some) + 0.5, layout, width_ratios=[2.4, 1])
        places = [found.setup.outputs.index(name) for name in some]
        for name, j in zip(some, places, strict=True):
            e, gated = accepted[:, j], h.gated[:, j]
            ax, memory = axes[name], axes[f"{name} memory"]
            seen = np.isfinite(e)
            ax.plot(*envelope(h.t[seen], e[seen]), color=AFTER, linewidth=0.5)
            edge = np.where(h.innovation[gated, j] > 0, 0.97, 0.03)
            ax.plot(h.t[gated], edge, ".", color=LAW, markersize=3, transform=ax.get_xaxis_transform())
            for level in (-BAND, BAND):
                ax.axhline(level, color=LAW, linewidth=0.8, linestyle="--")
            ax.set_xlim(float(h.t[0]), float(h.t[-1]))
            name_axes(ax, "", f"{name}\nover expected")
            white = whiteness(accepted[:, j])
            lags = np.arange(1, len(white.correlation) + 1)
            memory.bar(lags, white.correlation, color=AFTER, width=0.6)
            if len(lags):
                memory.axhspan(-white.limit, white.limit, color=NOISE, alpha=0.25, linewidth=0)
            reach = min(1.0, 1.3 * max(white.largest, 2 * white.limit)) if len(lags) else 1.0
            memory.set_ylim(-reach, reach)
            name_axes(memory, "", "correlation")
        name_axes(axes[some[-1]], "time in s", axes[some[-1]].get_ylabel())
        name_axes(axes[f"{some[-1]} memory"], "lag in samples", "correlation")
        caption = (
            "Innovations divided by their expected standard deviation, each with its autocorrelation. If "
            "model and noise are right, 95 % of the innovations lie between the dashed lines and all "
            "correlations lie within the grey band."
        )
        left_out = h.gated[:, places].any()
        out = " Dots at the edges: measurements that the gate left out." if left_out else ""
        yield Plot(f"innovations{ending}", figure, caption + out)


def correlation_plots(found: Findings) -> Iterator[Plot]:
    """Correlations of the unknowns at the end; unknowns near 1 or -1 cannot be told apart."""
    after = found.after
    if after is None or len(after.names) < 2:
        return
    n = len(after.names)
    figure, axes = sheet(1.2 + 0.45 * n, [["c"]], width=min(6.5, 2.2 + 0.62 * n))
    ax = axes["c"]
    ax.grid(False)
    ax.imshow(after.correlation, cmap="RdBu_r", vmin=-1, vmax=1)
    for i in range(n):
        for j in range(n):
            c = float(after.correlation[i, j])
            ax.text(
                j, i, f"{c:.2f}".replace("-", "−"), ha="center", va="center", fontsize=8,
                color="white" if abs(c) > 0.6 else INK,
            )  # fmt: skip
    ax.set_xticks(range(n), after.names, rotation=30, ha="right")
    ax.set_yticks(range(n), after.names)
    yield Plot("correlation", figure, "Correlation of the unknowns at the end of the record.")
