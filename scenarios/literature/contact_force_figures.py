"""Figures of the contact force's row: a second of each condition, and the run through the transitions."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from estimator.record import Array
from scenarios.drawing.sheet import (
    AFTER,
    CLOUD,
    LAW,
    Plot,
    envelope,
    legend,
    name_axes,
    sheet,
)
from scenarios.literature.contact_force_judged import Judged

SHOWN = 1.5  # s of a static run, at its end
ABOUT = (-0.3, 0.7)  # s about a transition
UNITS = {  # quantity: label, factor on SI
    "y_dot": ("lateral velocity [mm/s]", 1e3),
    "psi_dot": ("yaw rate [mrad/s]", 1e3),
    "creep": ("creep, left [1e-3]", 1e3),
    "force": ("creep force, left [kN]", 1e-3),
}
BELOW = "Estimates of the extended Kalman filter from one accelerometer and one gyro."


def figures(judged: Sequence[Judged]) -> list[Plot]:
    """Static conditions side by side, and each run with transitions."""
    static = [one for one in judged if not one.case.jumps]
    plots = [_conditions(static)] if static else []
    return plots + [_transition(one) for one in judged if one.case.jumps]


def _conditions(judged: Sequence[Judged]) -> Plot:
    layout = [[f"{quantity} {one.case.name}" for one in judged] for quantity in UNITS]
    figure, axes = sheet(1.35 * len(UNITS) + 0.4, layout, sharex=True)
    for quantity, (label, factor) in UNITS.items():
        row = [axes[f"{quantity} {one.case.name}"] for one in judged]
        for ax, one in zip(row, judged, strict=True):
            part = one.found.t >= one.found.t[-1] - SHOWN
            _pair(ax, one.found.t[part], *(factor * _left(x[quantity])[part] for x in (one.true, one.seen)))
            ax.plot(one.found.t[part], factor * _left(one.seen[quantity] - one.true[quantity])[part],
                    color=LAW, linewidth=0.8, label="error")  # fmt: skip
            ax.sharey(row[0])
            top, bottom = quantity == next(iter(UNITS)), quantity == list(UNITS)[-1]
            y = label.replace(" [", "\n[") if ax is row[0] else ""
            name_axes(ax, "time [s]" if bottom else "", y, one.case.name if top else "")
            ax.tick_params(labelleft=ax is row[0])
    legend(figure, axes[layout[0][0]])
    return Plot("contact_force_conditions", figure, BELOW)


def _transition(one: Judged) -> Plot:
    when = [w for w, _ in one.case.jumps]
    worst = max(one.spikes(), key=one.spikes().__getitem__)
    figure, axes = sheet(6.2, [["mu0", "mu0"], ["error", "error"], ["force", "creep"]])
    t, thin = one.found.t, slice(None, None, 20)
    mean, off = one.found.value["mu0"], 2 * one.found.std["mu0"]
    axes["mu0"].fill_between(
        t[thin], (mean - off)[thin], (mean + off)[thin], color=AFTER, alpha=0.18, linewidth=0
    )
    _pair(axes["mu0"], t, one.mu0, mean)
    axes["mu0"].set_ylim(0.0, 0.8)
    name_axes(axes["mu0"], "", "mu0", "friction coefficient and its band of two deviations")
    error = (one.seen["force"] - one.true["force"])[:, 0] / 1e3
    axes["error"].plot(*envelope(t, error), color=AFTER, linewidth=0.8)
    name_axes(axes["error"], "time [s]", "error [kN]", f"creep force, left: error; spike at {worst:g} s")
    for ax in (axes["mu0"], axes["error"]):
        for w in when:
            ax.axvline(w, color=LAW, linewidth=0.8, linestyle=":")
        ax.set_xlim(t[0], t[-1])
    part = (t >= worst + ABOUT[0]) & (t <= worst + ABOUT[1])
    for quantity in ("force", "creep"):
        label, factor = UNITS[quantity]
        _pair(axes[quantity], t[part], *(factor * _left(x[quantity])[part] for x in (one.true, one.seen)))
        axes[quantity].axvline(worst, color=LAW, linewidth=0.8, linestyle=":")
        name_axes(axes[quantity], "time [s]", label, f"about {worst:g} s")
    legend(figure, axes["mu0"])
    return Plot(f"contact_force_{one.case.name}", figure, BELOW)


def _pair(ax: Axes, t: Array, true: Array, found: Array) -> None:
    ax.plot(t, true, color=CLOUD, linewidth=2.6, label="true")
    ax.plot(t, found, color=AFTER, linewidth=0.9, label="estimated")


def _left(x: Array) -> Array:
    """The values of the left wheel from (N, 2); (N,) is returned unchanged."""
    return x[:, 0] if np.ndim(x) == 2 else x
