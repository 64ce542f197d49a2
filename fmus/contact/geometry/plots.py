"""Figures of profiles and of contact tables, as matplotlib figures; lengths in mm, angles in mrad.

Those of one wheel show the right one, as the thesis does (Figs 4.1 to 4.10); the left one mirrors it.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fmus.contact.arguments import Array
from fmus.contact.geometry.pair import Pair
from fmus.contact.geometry.profile import Profile

Column: TypeAlias = Callable[[pd.DataFrame], pd.Series]

MILLI = 1e3
INK, COLOURS, LINES = "#1d2733", ("#123f6b", "#d98f3e", "#a3122a"), ("-", "--", ":")
WIDTH, PANEL = 6.5, 2.1  # in
STEEPEST = 4.0  # slope up to which profiles are drawn, 76 degrees; beyond are flange back and rail sides
PLACES = 4000  # over the width of a profile
LINKS = 41  # lines that join wheel and rail
SHIFT = "lateral shift of the wheelset [mm]"


def profile_figure(*profiles: Profile) -> Figure:
    """Height, inclination and curvature of profiles over their lateral coordinate."""
    figure, axes = _sheet(3, sharex=True)
    for profile, colour, line in zip(profiles, COLOURS, LINES, strict=False):
        y = np.linspace(profile.begin, profile.end, PLACES)
        slope = profile.slope(y)
        drawn = np.abs(slope) < STEEPEST
        style: dict[str, Any] = {"color": colour, "linestyle": line, "linewidth": 1.2, "label": profile.name}
        axes[0].plot(y * MILLI, profile.height(y) * MILLI, **style)
        axes[1].plot(y * MILLI, _broken(np.arctan(slope) * MILLI, drawn), **style)
        axes[2].plot(y * MILLI, _broken(profile.curvature(y), drawn), **style)
    _name(axes[0], "", "height z [mm]")
    _name(axes[1], "", "inclination [mrad]")
    _name(axes[2], "lateral coordinate y, to the field side [mm]", "curvature [1/m]")
    axes[0].legend(frameon=False, fontsize=8)
    return figure


def rolling_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Rolling radius difference and roll of named tables over the shift (thesis Fig. 4.4)."""
    figure, axes = _sheet(2, sharex=True)
    _draw(axes[0], tables, lambda t: (t["r_left"] - t["r_right"]) * MILLI)
    _draw(axes[1], tables, lambda t: t["phi"] * MILLI)
    _name(axes[0], "", "r left - r right [mm]")
    _name(axes[1], SHIFT, "roll [mrad]")
    axes[0].legend(frameon=False, fontsize=8)
    return figure


def connection_figure(pair: Pair, tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Lines that join each contact on the right wheel with that on its rail, a panel a table (Fig. 4.5)."""
    figure, axes = _sheet(len(tables), height=2.0, sharex=True)
    apart = 12e-3  # m, by which the wheel is drawn above its rail
    rail, wheel = pair.left_rail, pair.wheel
    over = pair.tape - rail.axis_y  # of the centred tape circle over the rail's axis
    eta = np.linspace(wheel.begin, wheel.end, PLACES)
    rail_y = np.linspace(rail.begin, rail.end, PLACES)
    for ax, (name, table) in zip(axes, tables.items(), strict=True):
        ax.plot((eta + over) * MILLI, (wheel.height(eta) + apart) * MILLI, color=COLOURS[0], linewidth=1.2)
        ax.plot((rail_y - rail.axis_y) * MILLI, rail.height(rail_y) * MILLI, color=INK, linewidth=1.2)
        some = table.iloc[np.unique(np.linspace(0, len(table) - 1, LINKS).astype(int))]
        on_wheel, on_rail = some["eta_right"].to_numpy(), right_rail_place(pair, some)
        y = np.column_stack([on_wheel + over, on_rail - rail.axis_y]) * MILLI
        z = np.column_stack([wheel.height(on_wheel) + apart, rail.height(on_rail)]) * MILLI
        ax.plot(y.T, z.T, color=COLOURS[1], linewidth=0.6)
        ax.set_ylim(-22, 18)
        ax.set_aspect("equal")
        ax.set_title(_words(name), loc="left", fontsize=9)
        _name(ax, "", "z [mm]")
    _name(axes[-1], "from the axis of the right rail, to the field side [mm]", "z [mm]")
    return figure


def right_rail_place(pair: Pair, table: pd.DataFrame) -> Array:
    """Lateral place (n,), m, of the right wheel's contacts in the track frame, mirrored to the left."""
    eta, phi, y = table["eta_right"].to_numpy(), table["phi"].to_numpy(), table.index.to_numpy()
    z = pair.wheel.height(eta) - pair.r0
    return np.asarray(-y + (pair.tape + eta) * np.cos(phi) + z * np.sin(phi))


def position_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Lateral place of the contact on the right wheel over the shift (Fig. 4.6)."""
    figure, axes = _sheet(1, height=3.0)
    _draw(axes[0], tables, lambda t: t["eta_right"] * MILLI)
    _name(axes[0], SHIFT, "contact on the right wheel, from\nthe tape circle to the field side [mm]")
    axes[0].legend(frameon=False, fontsize=8)
    return figure


def patch_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Semi-axes of the right wheel's patch along and across rolling and their ratio (Figs 4.8 to 4.10)."""
    figure, axes = _sheet(3, sharex=True)
    _draw(axes[0], tables, lambda t: t["a_right"] * MILLI)
    _draw(axes[1], tables, lambda t: t["b_right"] * MILLI)
    _draw(axes[2], tables, lambda t: t["a_right"] / t["b_right"])
    loads = sorted({table.attrs["N"] for table in tables.values() if "N" in table.attrs})
    if loads:
        load = ", ".join(f"{N / 1e3:g}" for N in loads)
        axes[0].set_title(f"right wheel, N = {load} kN", loc="left", fontsize=9)
    _name(axes[0], "", "a along rolling [mm]")
    _name(axes[1], "", "b across rolling [mm]")
    _name(axes[2], SHIFT, "a/b [1]")
    axes[0].legend(frameon=False, fontsize=8)
    return figure


def _sheet(panels: int, height: float = PANEL, **more: Any) -> tuple[Figure, list[Axes]]:
    """A figure with panels above one another, each of a height in inches."""
    figure = Figure(figsize=(WIDTH, 0.4 + height * panels), layout="constrained", facecolor="white")
    axes: list[Axes] = list(np.atleast_1d(figure.subplots(panels, 1, **more)))
    for ax in axes:
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=8, colors=INK)
        ax.grid(True, color="#dde3e9", linewidth=0.5)
        ax.set_axisbelow(True)
    return figure, axes


def _draw(ax: Axes, tables: Mapping[str, pd.DataFrame], values: Column) -> None:
    """One line a table over the shift."""
    for (name, table), colour, line in zip(tables.items(), COLOURS, LINES, strict=False):
        ax.plot(
            table.index.to_numpy() * MILLI, values(table).to_numpy(),
            color=colour, linestyle=line, linewidth=1.2, label=_words(name),
        )  # fmt: skip


def _broken(values: Array, drawn: NDArray[np.bool_]) -> Array:
    return np.where(drawn, values, np.nan)


def _name(ax: Axes, x: str, y: str) -> None:
    if x:
        ax.set_xlabel(x, fontsize=9, color=INK)
    ax.set_ylabel(y, fontsize=9, color=INK)


def _words(name: str) -> str:
    return name.replace("quasi_elastic", "quasi-elastic").replace("_", " ")
