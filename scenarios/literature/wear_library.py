"""Wear of the wheels from the frequency content of raw signals on one section (Ward et al. 2010, section 6).

A library holds the frequency content of a bogie's signals in known states of wear. A record is given the
state whose content is nearest. No disturbance is estimated: on the same section of track it is the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import welch

from estimator.record import Array
from fmus.host.fmu import Fmu
from scenarios.drawing.sheet import AFTER, BEFORE, CLOUD, INK, LAW, Plot, legend, name_axes, sheet
from scenarios.literature.case import Case
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.row import Measured, Row, Tell

V, DURATION, DT = 50.0, 40.0, 2e-3  # m/s, s, s
ALIGNMENT = ("y_irr_1", "y_irr_1_dot", "y_irr_2", "y_irr_2_dot")
NOISE = {"y_1_dot": 1e-3, "y_b_dot": 1e-3, "psi_b_dot": 2e-4}  # m/s, m/s, rad/s, of this project
FRICTION = {"mu0": 0.4, "k_A": 0.9}  # of the records, where the library has dry rails
STATES = {"new": 0.0, "a third": 1 / 3, "two thirds": 2 / 3, "worn": 1.0}  # share of the worn profile
GRID = np.linspace(0.0, 1.0, 9)  # states of the library
SEGMENT = 8.0  # s, whose spectra are averaged
EDGES = 0.5 * 2 ** (np.arange(17) / 3)  # Hz, of third-octave bands, up to 20 Hz
SAME, FASTER, ANOTHER = "same section", "same section, 5 % faster", "another section"
FAST = 1.05
NEAR = 0.1  # what an error of the wear may be on the same section

Library = Mapping[str, Array]  # by the section: contents (states, signals, bands)


@dataclass(frozen=True)
class Compared:
    """The wear that is found, and the distance (k,) of a record to each state, in decibels rms."""

    wear: float
    off: Array


CASES = tuple(
    Case(name, "bogie", DURATION, DT, V, ALIGNMENT, NOISE, {"wear": wear, **FRICTION})
    for name, wear in STATES.items()
)


def content(signals: Array, dt: float) -> Array:
    """Mean power density of signals (N, m) in third-octave bands (m, 16), in decibels."""
    f, power = welch(signals, 1 / dt, nperseg=round(SEGMENT / dt), axis=0)
    band = np.digitize(f, EDGES) - 1
    mean = [power[band == i].mean(axis=0) for i in range(len(EDGES) - 1)]
    found: Array = 10 * np.log10(np.array(mean).T)
    return found


def library(fmu: Path, track: Array, speed: float) -> Array:
    """Contents (9, m, 16) in every state of GRID, over ALIGNMENT (N, 4), with the noise of the sensors."""
    t = DT * np.arange(len(track), dtype=np.float64)
    inputs = dict(zip(ALIGNMENT, track.T, strict=True))
    floor = 2 * DT * np.square([*NOISE.values()])[:, None]  # power density of white noise
    found = []
    with Fmu(fmu) as plant:
        for wear in GRID:
            y = plant.simulate(t, inputs, [*NOISE], {"V": speed, "wear": float(wear)})
            found.append(10 * np.log10(10 ** (content(y, DT) / 10) + floor))
    return np.array(found)


def sections(track: Array) -> Mapping[str, tuple[Array, float]]:
    """Tracks (N, 4) and speeds, m/s: as given; run through faster; and one with the same spectrum.

    The other section is the first one backwards.
    """
    t = np.arange(len(track), dtype=np.float64)
    fast = np.column_stack([np.interp(FAST * t, t, column) for column in track.T])
    back = track[::-1] * (1.0, -1.0, 1.0, -1.0)  # the rates turn round
    back = back[:, [2, 3, 0, 1]]  # and what was behind is ahead
    return {SAME: (track, V), FASTER: (fast * (1.0, FAST, 1.0, FAST), FAST * V), ANOTHER: (back, V)}


def compared(known: Array, seen: Array) -> Compared:
    """The state of a library (k, m, b) nearest to a content (m, b), between its states by a parabola."""
    off = np.sqrt(np.mean((known - seen) ** 2, axis=(1, 2)))
    i = int(np.clip(np.argmin(off), 1, len(GRID) - 2))
    bend, slope, _ = np.polyfit(GRID[i - 1 : i + 2], off[i - 1 : i + 2] ** 2, 2)
    least = float(-slope / (2 * bend)) if bend > 0 else float(GRID[int(np.argmin(off))])
    return Compared(float(np.clip(least, GRID[max(i - 1, 0)], GRID[i + 1])), off)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    drawn: list[tuple[Case, Mapping[str, Compared]]] = []
    made: dict[bytes, Library] = {}  # by track: the cases have one and the same
    for case, record in measured:
        track = record.table(ALIGNMENT)
        if track.tobytes() not in made:
            tell(f"{case.name}: the library")
            made[track.tobytes()] = {
                name: library(fmu, over, speed) for name, (over, speed) in sections(track).items()
            }
        seen = content(record.table([*NOISE]), DT)
        found = {name: compared(known, seen) for name, known in made[track.tobytes()].items()}
        findings += [finding for name, one in found.items() for finding in _judged(case, name, one)]
        drawn.append((case, found))
    last = next(reversed(made.values()))
    return Outcome(ROW.name, findings, [_figure(last[SAME], drawn, measured)], NOTES)


def _judged(case: Case, name: str, one: Compared) -> list[Finding]:
    wear = case.true["wear"]
    aim = NEAR if name == SAME else None
    return [
        Finding(case.name, f"{name}: wear found, of the worn profile", "1", one.wear),
        Finding(case.name, f"{name}: its error", "1", abs(one.wear - wear), target=aim),
        Finding(case.name, f"{name}: distance to the nearest state", "dB", float(one.off.min())),
    ]


def _figure(known: Array, drawn: list[tuple[Case, Mapping[str, Compared]]], measured: Measured) -> Plot:
    signals = [*NOISE]
    figure, axes = sheet(4.8, [signals, ["off"] * len(signals)])
    middle = np.sqrt(EDGES[1:] * EDGES[:-1])
    seen = content(measured[-1][1].table(signals), DT)
    for j, name in enumerate(signals):
        ax = axes[name]
        ax.plot(middle, known[0, j], color=CLOUD, linewidth=1.6, label="library, new")
        ax.plot(middle, known[-1, j], color=INK, linewidth=1.2, label="library, worn")
        ax.plot(middle, seen[j], ".", color=AFTER, markersize=4, label=f"record, {measured[-1][0].name}")
        ax.set_xscale("log")
        name_axes(ax, "frequency [Hz]", "dB" if j == 0 else "", name)
    for (case, found), colour in zip(drawn, (CLOUD, BEFORE, AFTER, LAW), strict=False):
        axes["off"].plot(GRID, found[SAME].off, color=colour, linewidth=1.0)
        axes["off"].axvline(case.true["wear"], color=colour, linewidth=0.8, linestyle=":")
    name_axes(axes["off"], "wear of the library's state", "distance [dB]", "same section, true wear dotted")
    legend(figure, axes[signals[0]])
    return Plot(ROW.name, figure, "Frequency content by wear, and the distance of records to each state.")


NOTES = (
    "The source says that its signals showed some difference between states of wear, and prints none of it.",
    "Wear is the share of S1002_Hollow; the records have less friction than the library.",
)

ROW = Row(
    "wear_library",
    "Wear of a bogie's wheels from a library of frequency content",
    "Ward et al. 2010, section 6",
    "bogie",
    CASES,
    rebuilt,
)
