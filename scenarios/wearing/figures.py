"""Figures of wear: profiles, depth over them, sizes and conicity over mileage, what estimators find."""

from matplotlib import colormaps

from scenarios.drawing.sheet import AFTER, BEFORE, INK, LAW, Plot, legend, name_axes, sheet
from scenarios.wearing.result import MILLI, Wear
from scenarios.wearing.service import SIDES

WIDTH = 4.9  # in; read on a telephone, too
SHADES = colormaps["viridis_r"]
DRAWN = 8  # states in a figure of curves, at most about this many
THOUSANDS = 1e-3  # of km


def all_plots(found: Wear) -> list[Plot]:
    """Every figure of the page, in its order; followed estimates only if there are some."""
    plots = [profile_plot(found), depth_plot(found), mileage_plot(found)]
    return [*plots, followed_plot(found)] if found.followed else plots


def _some(count: int) -> list[int]:
    """Numbers of the states that are drawn, the first and the last among them."""
    return sorted({*range(0, count, max(1, round(count / DRAWN))), count - 1})


def _shade(i: int, count: int) -> tuple[float, float, float, float]:
    return SHADES(0.1 + 0.9 * i / max(count - 1, 1))


def profile_plot(found: Wear) -> Plot:
    """New and worn profiles of both wheels."""
    figure, axes = sheet(3.6, [["left"], ["right"]], width=WIDTH)
    first, last = found.evolution.states[0], found.last
    for side in SIDES:
        ax = axes[side]
        for state, colour, what in ((first, INK, "new"), (last, LAW, f"{last.km:.0f} km")):
            wheel = state.wheels[side]
            ax.plot(MILLI * wheel.y, MILLI * wheel.z, color=colour, linewidth=1.1, label=what)
        ax.set_aspect("equal")
        ax.set_ylim(-30, 8)
        name_axes(ax, "", "height [mm]", f"{side} wheel")
    axes["right"].set_xlabel("from the tape circle, to the field side [mm]", fontsize=9)
    legend(figure, axes["left"])
    return Plot("profiles", figure, "New and worn profiles of both wheels.")


def depth_plot(found: Wear) -> Plot:
    """Depth that is worn off over the profile, a line a state."""
    figure, axes = sheet(4.2, [["left"], ["right"]], width=WIDTH, sharex=True)
    states = found.evolution.states
    for side in SIDES:
        ax = axes[side]
        for i in _some(len(states)):
            wheel, label = states[i].wheels[side], f"{states[i].km:.0f} km"
            colour = _shade(i, len(states))
            ax.plot(MILLI * wheel.y, MILLI * wheel.worn, color=colour, linewidth=1.1, label=label)
        name_axes(ax, "", "worn off [mm]", f"{side} wheel")
    axes["right"].set_xlabel("from the tape circle, to the field side [mm]", fontsize=9)
    axes["left"].legend(frameon=False, fontsize=7, ncols=2)
    return Plot(
        "depth",
        figure,
        "Depth that is worn off, normal to the profile; the flange is on the left, new is pale.",
    )


def mileage_plot(found: Wear) -> Plot:
    """Sizes of the flange, conicity and dissipation over mileage."""
    rows = (("conicity",), ("Sh",), ("Sd",), ("qR",), ("T_gamma",))
    figure, axes = sheet(6.6, rows, width=WIDTH, sharex=True)
    table = found.table()
    km = THOUSANDS * table["km"].to_numpy(dtype=float)
    axes["conicity"].plot(km, table["conicity"], "o-", color=INK, markersize=3, linewidth=1.2)
    for side, colour, style in (("left", AFTER, "o-"), ("right", BEFORE, "s--")):
        look = {"color": colour, "markersize": 3, "linewidth": 1.2, "label": f"{side} wheel"}
        for name in ("Sh", "Sd", "qR"):
            values = MILLI * table[f"{name}_{side}"].to_numpy(dtype=float)
            axes[name].plot(km, values - values[0], style, **look)
        axes["T_gamma"].plot(km, table[f"T_gamma_{side}"], style, **look)
    name_axes(axes["conicity"], "", "conicity\nat 3 mm")
    for name, what in (("Sh", "height"), ("Sd", "thickness"), ("qR", "slope")):
        name_axes(axes[name], "", f"flange {what}\n{name}, change\n[mm]")
    name_axes(axes["T_gamma"], "way [1000 km]", "T gamma,\nmean [N]")
    axes["T_gamma"].set_ylim(0, 1.15 * max(axes["T_gamma"].get_ylim()[1], 0.0) or 1.0)
    legend(figure, axes["Sh"])
    return Plot(
        "mileage", figure,
        "Conicity, change of the flange's height, thickness and slope, and mean dissipation of a wheel over "
        "mileage.",
    )  # fmt: skip


def followed_plot(found: Wear) -> Plot:
    """Radius differences found by least squares beside the true ones."""
    figure, axes = sheet(3.2, [["difference"]], width=WIDTH)
    ax, count = axes["difference"], len(found.followed)
    for i in _some(count):
        f, colour = found.followed[i], _shade(i, count)
        ax.plot(MILLI * f.shift, MILLI * f.true, color=colour, linewidth=1.2, label=f"{f.km:.0f} km")
        ax.plot(MILLI * f.shift, MILLI * f.found, ".", color=colour, markersize=3.5)
    ax.axhline(0, color=INK, linewidth=0.5)
    name_axes(ax, "shift to the left [mm]", "r left − r right [mm]")
    ax.legend(frameon=False, fontsize=7, ncols=2)
    return Plot(
        "followed", figure, "Radius difference of each state (lines), and what least squares find (dots)."
    )
