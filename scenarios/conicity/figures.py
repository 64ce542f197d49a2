"""Figures of a pair: where wheels and rails touch, the radius difference, the conicity over the amplitude."""

import numpy as np
from matplotlib.axes import Axes

from estimator.record import Array
from fmus.contact.geometry.pair import Pair
from scenarios.conicity.evaluating import Evaluation
from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    INK,
    LAW,
    NOISE,
    SHADE,
    Plot,
    legend,
    name_axes,
    sheet,
)

WIDTH = 4.9  # in; read on a telephone, too
MILLI = 1e3
PLACES = 4000  # over the width of a profile
APART = 8e-3  # m, by which a wheel is drawn above its rail
LINKED = np.arange(-7, 8) * 1e-3  # m, shifts at which contacts are joined
DEEP, HIGH = -24, 16  # mm, what is drawn of the heights
SHOWN = 0.003  # m, the amplitude of the motion that is drawn: the one EN 14363 asks for
TOLERANCE, SHARE = 0.05, 0.5  # of the norm, absolute and of the conicity


def all_plots(found: Evaluation) -> list[Plot]:
    """Every figure of the page, in its order."""
    return [contact_plot(found), difference_plot(found), conicity_plot(found)]


def contact_plot(found: Evaluation) -> Plot:
    """Both wheels above their rails, seen from behind, with lines between the places that touch."""
    figure, axes = sheet(3.5, [["left"], ["right"]], width=WIDTH)
    for side, (pair, sign) in found.sides.named.items():
        ax = axes[side]
        eta = np.linspace(pair.wheel.begin, pair.wheel.end, PLACES)
        rail_y = np.linspace(pair.left_rail.begin, pair.left_rail.end, PLACES)
        line = {"linewidth": 1.3, "solid_joinstyle": "round"}
        ax.plot(sign * eta * MILLI, (pair.wheel.height(eta) + APART) * MILLI, color=AFTER, **line)
        over = sign * (rail_y - pair.tape) * MILLI
        ax.plot(over, pair.left_rail.height(rail_y) * MILLI, color=INK, **line)
        _links(ax, found, side, pair, sign)
        ax.set_ylim(DEEP, HIGH)
        ax.set_aspect("equal")
        ax.invert_xaxis()  # y points to the left
        name_axes(ax, "", "height [mm]", f"{side}: {pair.wheel.name} on {pair.left_rail.profile.name}")
    axes["right"].set_xlabel("from the tape circle, to the left [mm]", fontsize=9)
    return Plot(
        "contact", figure,
        "Wheels, drawn 8 mm above their rails, seen from behind. Lines join the places that touch, for "
        "shifts from 7 mm to the right (pale) to 7 mm to the left (dark).",
    )  # fmt: skip


def _links(ax: Axes, found: Evaluation, side: str, pair: Pair, sign: int) -> None:
    """Lines between the places that touch at LINKED shifts, within the table."""
    y = found.table.index.to_numpy(dtype=float)
    for i, shift in enumerate(LINKED):
        if not y[0] <= shift <= y[-1]:
            continue
        row = found.table.iloc[int(np.argmin(np.abs(y - shift)))]
        eta, phi, at = float(row[f"eta_{side}"]), sign * float(row["phi"]), sign * float(row.name)  # type: ignore[arg-type]
        z = float(pair.wheel.height(eta))
        rail_y = at + (pair.tape + eta) * np.cos(phi) - (z - pair.r0) * np.sin(phi)
        rail_z = float(pair.left_rail.height(rail_y))
        places = np.array([[eta, z + APART], [rail_y - pair.tape, rail_z]]) * MILLI
        shade = 0.25 + 0.75 * i / (len(LINKED) - 1)
        ax.plot(sign * places[:, 0], places[:, 1], color=LAW, alpha=shade, linewidth=0.8)


def difference_plot(found: Evaluation) -> Plot:
    """Radius difference over the shift with the turning points of one motion, and the contacts."""
    figure, axes = sheet(4.6, [["dr"], ["eta"]], width=WIDTH, sharex=True)
    y = found.table.index.to_numpy(dtype=float) * MILLI
    difference = found.difference * MILLI
    axes["dr"].plot(y, difference, color=AFTER, linewidth=1.3)
    _turning_points(axes["dr"], found, difference, y)
    for side, colour, style in (("left", AFTER, "-"), ("right", BEFORE, "--")):
        eta = found.table[f"eta_{side}"].to_numpy() * MILLI
        axes["eta"].plot(y, eta, color=colour, linestyle=style, linewidth=1.2, label=f"{side} wheel")
    name_axes(axes["dr"], "", "r left − r right [mm]")
    name_axes(axes["eta"], "shift to the left [mm]", "contact from the tape\ncircle, to the field side [mm]")
    axes["eta"].legend(frameon=False, fontsize=8)
    how = "upright, each on its own rail" if not found.table.attrs["roll"] else "rolling until both touch"
    return Plot(
        "difference", figure,
        f"Difference of the rolling radii, with the wheels {how}, and where they touch. Dots: turning points "
        f"of the motion with {SHOWN * MILLI:g} mm of amplitude.",
    )  # fmt: skip


def _turning_points(ax: Axes, found: Evaluation, difference: Array, y: Array) -> None:
    """The range of the motion of SHOWN amplitude, and the difference within seven mm of it."""
    ax.axhline(0, color=NOISE, linewidth=0.7)
    shown = found.rows[found.rows.index == SHOWN].dropna(subset=["low", "high"])
    if len(shown):
        ends = shown[["low", "high"]].to_numpy(dtype=float)[0] * MILLI
        ax.axvspan(*ends, color=SHADE, linewidth=0, zorder=0)
        ax.plot(ends, np.interp(ends, y, difference), "o", color=LAW, markersize=4)


def conicity_plot(found: Evaluation) -> Plot:
    """Equivalent conicity over the amplitude with the norm's tolerance, and both linearised forms."""
    figure, axes = sheet(3.3, [["conicity"]], width=WIDTH)
    ax, rows = axes["conicity"], found.rows
    a = rows.index.to_numpy(dtype=float) * MILLI
    value = rows["conicity"].to_numpy(dtype=float)
    off = np.minimum(TOLERANCE, SHARE * np.abs(value))
    ax.fill_between(a, value - off, value + off, color=CLOUD, alpha=0.45, linewidth=0, label="tolerance")
    marker = "o" if len(a) < 8 else None
    ax.plot(a, value, color=AFTER, linewidth=1.6, marker=marker, markersize=3, label="equivalent")
    for name, colour, style in (("linear", BEFORE, "--"), ("harmonic", LAW, ":")):
        form = rows[name].to_numpy(dtype=float)
        ax.plot(
            a, form, color=colour, linestyle=style, linewidth=1.2, marker=marker, markersize=3, label=name
        )
    if (rows[["conicity", "linear", "harmonic"]].min().min()) >= 0:
        ax.set_ylim(bottom=0)
    name_axes(ax, "amplitude [mm]", "conicity [1]")
    legend(figure, ax)
    return Plot(
        "conicity", figure,
        "Equivalent conicity by the integral of the motion, the norm's tolerance about it, the slope of the "
        "line fitted to the difference (linear) and its first harmonic (harmonic). Where there is no motion "
        "of an amplitude, the line of the integral is broken.",
    )  # fmt: skip
