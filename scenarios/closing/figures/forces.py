"""The missing force of each port over time, velocity and displacement, with the law found."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from estimator.closeloop.outcome import Outcome
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.record import Array
from scenarios.closing.figures.law import Law, law_at
from scenarios.closing.page.glossary import Glossary, effect_words
from scenarios.drawing.sheet import (
    AFTER,
    CLOUD,
    LAW,
    Plot,
    envelope,
    legend,
    name_axes,
    sheet,
    sheets,
)
from scenarios.drawing.typography import label

BINS = 25  # bins of velocity or displacement in which the missing force is averaged
TURNS = 16  # sign changes of a law that can be told apart on a time axis
OTHERS = 8  # largest number of ports without a law that are shown
OF_LAW = (
    "Missing force at the port “{}”, inferred from the residual without assuming a law (band: two standard "
    "deviations; dots: averages). The line is the law that was found there by fitting it inside the FMU."
)
OF_OTHERS = (
    "Missing force at each of the other ports, if the whole missing force acted at that port alone: over "
    "time (band: two standard deviations) and against the velocity of the port (dots: averages)."
)


def force_plots(found: Outcome, words: Glossary) -> Iterator[Plot]:
    """One sheet for each port at which a law was found, then the other ports."""
    laws = laws_found(found)
    for i, law in enumerate(laws):
        yield _law_plot(law, words, f"_{i + 1}" if i else "")
    with_law = [law.missing.port for law in laws]
    others = [m for m in found.forces if m.port not in with_law][:OTHERS]
    for ending, some in sheets(others):
        layout = [[f"{m.port.name} t", f"{m.port.name} v"] for m in some]
        figure, axes = sheet(0.3 + 1.7 * len(some), layout, width_ratios=[1.5, 1])
        for m in some:
            _over_time(axes[f"{m.port.name} t"], m, words, None)
            _against(axes[f"{m.port.name} v"], m.velocity, m, words, m.port.velocity)
        yield Plot(f"missing_force{'_others' if laws else ''}{ending}", figure, OF_OTHERS)


def laws_found(found: Outcome) -> list[Law]:
    """The laws of the chosen hypothesis at the ports whose missing force is known."""
    return [law for m in found.forces if (law := law_at(found.chosen, m))]


def _law_plot(law: Law, words: Glossary, ending: str) -> Plot:
    m = law.missing
    if law.of_displacement:
        figure, axes = sheet(5.0, [["t", "t"], ["v", "law"]])
        _against(axes["v"], m.velocity, m, words, m.port.velocity)
    else:
        figure, axes = sheet(2.7, [["t", "law"]], width_ratios=[1.2, 1])
    _over_time(axes["t"], m, words, law)
    draw_law(axes["law"], law, words)
    legend(figure, axes["t"])
    return Plot(f"missing_force{ending}", figure, OF_LAW.format(m.port.name))


def draw_law(ax: Axes, law: Law, words: Glossary) -> None:
    """Missing force and law against velocity, or displacement where the law depends on it."""
    m, period = law.missing, law.period
    q, v = m.displacement, m.velocity
    if not law.of_displacement:
        grid = np.linspace(v.min(), v.max(), 400)
        force = law.along(np.full_like(grid, q.mean()), grid)
        _against(ax, v, m, words, m.port.velocity)
    else:
        folded = np.mod(q, period) if period else q
        grid = np.linspace(0, period, 400) if period else np.linspace(q.min(), q.max(), 400)
        force = law.along(grid, np.full_like(grid, v.mean()))
        _against(ax, folded, m, words, m.port.motion[0], ", folded" if period else "")
    ax.plot(grid, force, color=LAW, linewidth=2.0, label=f"law found ({effect_words(law.candidate.kind)})")


def _over_time(ax: Axes, m: MissingForce, words: Glossary, law: Law | None) -> None:
    force = law.force if law else None
    part = _legible(force) if force is not None else slice(None)
    t, f, std = m.t[part], m.force[part], m.std[part]
    ax.fill_between(t, f - 2 * std, f + 2 * std, color=CLOUD, alpha=0.5, linewidth=0)
    ax.plot(*envelope(t, f), color=AFTER, linewidth=0.8, label="missing force")
    if law and force is not None:
        text = f"law found ({effect_words(law.candidate.kind)})"
        ax.plot(*envelope(t, force[part]), color=LAW, linewidth=1.4, label=text)
    ax.set_xlim(t[0], t[-1])
    name_axes(ax, "time in s", label("force", words.unit(m.port.force)), m.port.name)


def _legible(force: Array) -> slice:
    """The part of a law's force (n,) to draw: all, or the middle part with about TURNS sign changes."""
    turns = np.flatnonzero(np.diff(np.sign(force)))
    if len(turns) <= 3 * TURNS:
        return slice(None)
    middle = len(turns) // 2
    return slice(int(turns[middle - TURNS // 2]), int(turns[middle + TURNS // 2]) + 1)


def _against(ax: Axes, x: Array, m: MissingForce, words: Glossary, name: str, more: str = "") -> None:
    ax.plot(x, m.force, ".", color=CLOUD, markersize=1.5, alpha=0.5, rasterized=True)
    ax.plot(*averages(x, m.force), "o", color=AFTER, markersize=3, label="missing force")
    x_label = label(f"{name}{more}", words.unit(name))
    name_axes(ax, x_label, label("force", words.unit(m.port.force)))


def averages(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of x and y (n,) in the bins of x that contain enough samples."""
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, BINS - 1)
    held = np.bincount(place, minlength=BINS)
    full = held >= max(3, 0.1 * len(x) / BINS)
    means = [np.bincount(place, a, BINS)[full] / held[full] for a in (x, y)]
    return means[0], means[1]
