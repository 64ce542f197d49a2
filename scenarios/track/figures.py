"""Figures of a track: its rails over distance, and its spectra against the requested ones."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import welch

from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    INK,
    LAW,
    SHADE,
    envelope,
    legend,
    name_axes,
    sheet,
)
from scenarios.track.rails import Array, Quantity
from scenarios.track.spectra import Spectrum
from scenarios.track.track import Track

SIDES: Mapping[str, tuple[tuple[str, Quantity, str], ...]] = {
    "lateral in mm": (("left rail", "y_left", AFTER), ("right rail", "y_right", BEFORE)),
    "vertical in mm": (("left rail", "z_left", AFTER), ("right rail", "z_right", BEFORE)),
}
TITLES: Mapping[Quantity, str] = {
    "alignment": "Alignment",
    "gauge": "Gauge",
    "level": "Level",
    "cross_level": "Cross level",
}
SEGMENTS = 8  # segments of the record, without overlap, in the estimate of a spectrum
DECADES = 4.5  # shown below the greatest density


def profile_figure(track: Track, window: tuple[float, float] | None = None) -> Figure:
    """Lateral and vertical deviations of both rails over distance, or over a window [m] of it."""
    low, high = window or (track.start, track.end)
    s = track.distance[(track.distance >= low) & (track.distance <= high)]
    s = np.unique(np.concatenate(([low, high], s)))
    rails = track.at(s)
    figure, axes = sheet(4.2, [[name] for name in SIDES], sharex=True)
    for name, lines in SIDES.items():
        for label, quantity, colour in lines:
            axes[name].plot(
                *envelope(s, 1e3 * getattr(rails, quantity)), color=colour, lw=0.8, alpha=0.8, label=label
            )
        axes[name].set_xlim(low, high)
        name_axes(axes[name], "", name)
    name_axes(axes["vertical in mm"], "distance in m", "vertical in mm")
    legend(figure, axes["lateral in mm"])
    made: Figure = figure
    return made


def estimated_spectrum(track: Track, quantity: Quantity, step: float, segment: float) -> tuple[Array, Array]:
    """One-sided density [m2/(rad/m)] of a quantity by Welch's method, over [rad/m].

    step: spacing [m] at which the track is sampled; segment: length [m] of the pieces, half overlapping.
    """
    s = np.arange(track.start, track.end, step)
    pieces = min(round(segment / step), s.size)
    n, S = welch(getattr(track.at(s), quantity), fs=1 / step, nperseg=pieces, window="hann")
    return 2 * np.pi * n[1:], S[1:] / (2 * np.pi)


def spectrum_figure(
    track: Track,
    requested: Mapping[Quantity, Spectrum] | None = None,
    wavelengths: Sequence[float] | None = None,
) -> Figure:
    """Spectra of the track by Welch's method, with the requested spectra in their band [m]."""
    shown = [q for q in TITLES if np.ptp(getattr(track.rails, q)) > 0] or ["level"]
    columns = 2 if len(shown) > 1 else 1
    rows = [shown[i : i + columns] for i in range(0, len(shown), columns)]
    layout = [row + ["."] * (columns - len(row)) for row in rows]
    figure, axes = sheet(2.6 * len(rows) + 0.3, layout)
    for quantity in shown:
        _spectrum_panel(axes[quantity], track, quantity, (requested or {}).get(quantity), wavelengths)
        name_axes(axes[quantity], "Ω in rad/m", "S in m²/(rad/m)", TITLES[quantity])
    legend(figure, max((axes[q] for q in shown), key=lambda ax: len(ax.lines)))
    made: Figure = figure
    return made


def _spectrum_panel(
    ax: Axes,
    track: Track,
    quantity: Quantity,
    requested: Spectrum | None,
    wavelengths: Sequence[float] | None,
) -> None:
    """The estimated spectrum and, within the band, the requested one."""
    step = float(np.median(np.diff(track.distance)))
    Omega, S = estimated_spectrum(track, quantity, step, (track.end - track.start) / SEGMENTS)
    ax.loglog(Omega, S, color=AFTER, lw=0.8, label="of the track (Welch)")
    low, high = (
        (2 * np.pi / w for w in sorted(wavelengths, reverse=True)) if wavelengths else (Omega[0], Omega[-1])
    )
    if wavelengths:
        ax.axvspan(low, high, color=SHADE, lw=0, zorder=0, label="band")
    if requested is not None:
        w = np.geomspace(low, high, 200)
        ax.loglog(w, requested.density(w), color=LAW, lw=1.4, label="requested")
    ax.set_ylim(S.max() * 10**-DECADES, 3 * S.max())
    ax.set_xlim(Omega[0], min(Omega[-1], 4 * high) if wavelengths else Omega[-1])
    ax.tick_params(which="minor", colors=INK, length=0)
