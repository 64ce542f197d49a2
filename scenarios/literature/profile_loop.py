"""Irregularity and contact geometry in a loop, neither of them known (Ward et al. 2010, section 6, Fig. 8).

An assumed geometry turns the measured roll into the shift, and so gives the irregularity at every sample.
Least squares in bins of that shift then find the geometry. The next assumption follows from it: while the
wheelset moves sideways, the contact angles make it roll. The sum of the angles, which acts in the equation of
yaw, therefore says how far the wheelset has moved for the roll that is measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.record import Array
from fmus.contact import contact_table
from scenarios.drawing.sheet import AFTER, BEFORE, CLOUD, INK, Plot, legend, name_axes, sheet
from scenarios.literature.case import Case, Record
from scenarios.literature.following import rmse
from scenarios.literature.linear_creep import by_fmu
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.profile_rls import (
    CASES,
    COMBINATIONS,
    HALF,
    I_W,
    M_W,
    NOISE,
    R0,
    geometry,
    regression,
)
from scenarios.literature.row import Measured, Row, Tell

ROUNDS = 5
WIDER, CONE = 3e-3, 0.1  # m, 1: what is assumed at first
WIDTH = 12e-3  # m of shift to either side, over which a roll is assumed
COUNT = 200  # bins
LEAST = 1e-9  # m, of a bin's width
# start deviations of the combinations, m, m, rad, rad, and of slopes and bends of both differences in a bin
KNOWN_TO = np.array([5e-3, 5e-3, 0.5, 0.5, 5e-3, 0.5, 5e-3, 0.5])
SUMS = 5  # knots of the sum of the angles over the roll
SMALLEST, LARGEST = 0.01, 1.0  # rad, of that sum
NOISY = (1e-7, 1e-6)  # rad, noise of the roll, tried beside the source's ideal sensors
NEAR = 0.2  # of the shift's deviation: what its error may be after the rounds
RADII, ANGLES = 1, 3  # places of both differences among the combinations


@dataclass(frozen=True)
class Rolling:
    """Roll [rad] over the shift [m], (n,) each and both increasing."""

    shift: Array
    roll: Array

    def shift_at(self, roll: Array) -> Array:
        """Shifts (k,), m, at which the wheelset has these rolls (k,); the outermost beyond."""
        return np.interp(roll, self.roll, self.shift)


@dataclass(frozen=True)
class Bins:
    """Middles of bins (n,), m; combinations there (n, 4) and their standard errors; roll (n,), rad."""

    shift: Array
    value: Array
    std: Array
    roll: Array


@dataclass(frozen=True)
class Looped:
    """A round: the shift (N,) by the assumption, and the bins that it leads to."""

    shift: Array
    bins: Bins


def assumptions() -> Mapping[str, Rolling]:
    """What is assumed at first, by name: the profiles on a wider track, and a cone."""
    table = contact_table(r0=R0, gauge=1.435 + WIDER)
    shift = np.array([-WIDTH, WIDTH])
    return {
        "track 3 mm wider": Rolling(table.index.to_numpy(dtype=np.float64), table["phi"].to_numpy()),
        "cone of 0.1": Rolling(shift, CONE / HALF * shift),
    }


def looped(record: Record, assumed: Rolling) -> list[Looped]:
    """Irregularity and geometry in turns, from an assumption; each round goes over the whole record."""
    roll, made = record.columns["phi"], list[Looped]()
    fine = np.linspace(roll.min(), roll.max(), 1001)
    for _ in range(ROUNDS):
        shift = assumed.shift_at(roll)
        bins = in_bins(record, shift)
        made.append(Looped(shift, bins))
        centred = float(np.interp(0.0, bins.value[:, RADII], bins.roll))  # both radii are equal there
        assumed = rolled(sum_of_angles(bins, fine), fine, centred)
    return made


def in_bins(record: Record, shift: Array) -> Bins:
    """Least squares of a whole record (its eq. 9) in bins of a shift (N,), m.

    All bins have the same number of samples: an assumption that compresses the shift would else put nearly
    all of them into one. In each bin both differences have slopes and bend.
    """
    X, rest = regression(Record({**record.columns, "y_irr": record.columns["y"] - shift}))
    per = 1 / np.array([M_W * NOISE["y_ddot"], I_W * NOISE["psi_ddot"]])
    X, rest, roll = per[:, None] * X[:, :, : len(COMBINATIONS)], per * rest, record.columns["phi"]
    rows = []
    for here in np.array_split(np.argsort(shift, kind="stable"), COUNT):
        middle = float(shift[here].mean())
        inside = (shift[here] - middle) / max(float(np.ptp(shift[here])), LEAST)
        changing = X[here][:, :, [RADII, ANGLES]]
        A = np.concatenate([X[here], *(changing * inside[:, None, None] ** n for n in (1, 2))], axis=2)
        A = A.reshape(-1, A.shape[2]) * KNOWN_TO
        left = A.T @ A + np.eye(len(KNOWN_TO))
        theta = np.linalg.solve(left, A.T @ rest[here].ravel())
        # a bin that is too wide for its form misses by more than the sensors' noise
        missed = max(1.0, float(np.std(rest[here].ravel() - A @ theta)))
        theta, std = KNOWN_TO * theta, missed * KNOWN_TO * np.sqrt(np.diag(np.linalg.inv(left)))
        rows.append([middle, *theta[:4], *std[:4], np.polyfit(inside, roll[here], 2)[-1]])
    table = np.array(rows)
    value = table[:, 1:5] + np.array([2 * R0, 0.0, 0.0, 0.0])
    return Bins(table[:, 0], value, table[:, 5:9], table[:, 9])


def sum_of_angles(bins: Bins, fine: Array) -> Array:
    """The sum of both contact angles over the roll, at `fine` (n,), rad: straight lines through the bins."""
    knots = np.linspace(bins.roll.min(), bins.roll.max(), SUMS)
    hats = np.column_stack([np.interp(bins.roll, knots, hat) for hat in np.eye(SUMS)])
    total, std = bins.value[:, 2], bins.std[:, 2]
    found = np.linalg.lstsq(hats / std[:, None], total / std, rcond=None)[0]
    sums: Array = np.clip(np.interp(fine, knots, found), SMALLEST, LARGEST)
    return sums


def rolled(total: Array, fine: Array, centred: float) -> Rolling:
    """The roll over the shift that sums of the angles (n,) at rolls `fine` (n,) lead to.

    No contact moves along its normal, so that 2 l d phi = (d shift + r0 d phi) (sum of the angles).
    centred: roll [rad] at which both wheels roll on one radius.
    """
    per_roll = (2 * HALF - R0 * total) / total
    shift = np.concatenate([[0.0], np.cumsum(np.diff(fine) * (per_roll[1:] + per_roll[:-1]) / 2)])
    return Rolling(shift - np.interp(centred, fine, shift), fine)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row; no FMU is needed but for records, the equations are the source's."""
    findings: list[Finding] = []
    plots: list[Plot] = []
    for case, record in measured:
        drawn = {}
        for name, assumed in assumptions().items():
            tell(f"{case.name}: from {name}")
            drawn[name] = looped(record, assumed)
            aim = None if record.columns["gauge_irr"].any() else NEAR
            findings += _judged(case, record, name, drawn[name], aim)
            tell(f"{case.name}: from {name}, with a noisy roll")
            for std in NOISY:
                blurred = looped(noisy(record, std, case.seed), assumed)
                findings.append(_judged(case, record, f"{name}, noise of {1e6 * std:g} urad", blurred)[1])
        plots.append(_figure(case, record, drawn))
    return Outcome(ROW.name, findings, plots, NOTES)


def noisy(record: Record, std: float, seed: int) -> Record:
    """The record with white noise on the roll, rad."""
    noise = np.random.default_rng(seed).normal(0.0, std, len(record.t))
    return Record({**record.columns, "phi": record.columns["phi"] + noise})


def _judged(
    case: Case, record: Record, name: str, rounds: list[Looped], aim: float | None = None
) -> list[Finding]:
    d, true, last = record.columns["y_irr"], geometry(), rounds[-1]
    shift = record.columns["y"] - d
    off = [rmse(one.shift, shift) / float(np.std(shift)) for one in rounds]
    made = [
        Finding(case.name, f"{name}: error of the shift over its deviation, as assumed", "1", off[0]),
        Finding(case.name, f"{name}: the same after {len(rounds)} rounds", "1", off[-1], target=aim),
        Finding(
            case.name, f"{name}: error of the irregularity, rms over rms", "1",
            rmse(record.columns["y"] - last.shift, d) / float(np.sqrt(np.mean(d**2))),
        ),
    ]  # fmt: skip
    for i, what in ((RADII, "r_L - r_R"), (ANGLES, "delta_L - delta_R")):
        for when, bins in (("as assumed", rounds[0].bins), ("after the rounds", last.bins)):
            wanted = np.interp(bins.shift, true.shift, true.value[:, i])
            span = float(np.ptp(wanted))
            error = rmse(bins.value[:, i], wanted) / span if span > 0 else np.inf
            made.append(Finding(case.name, f"{name}: {what}, RMSE over its range, {when}", "1", error))
    return made


def _figure(case: Case, record: Record, drawn: Mapping[str, list[Looped]]) -> Plot:
    figure, axes = sheet(4.6, [["radii", "sum"], ["track", "track"]])
    true, reach = geometry(), 1e3 * float(np.abs(record.columns["y"] - record.columns["y_irr"]).max())
    for key, i, scale, label in (
        ("radii", RADII, 1e3, "r_L - r_R [mm]"),
        ("sum", 2, 1.0, "δ_L + δ_R [rad]"),
    ):
        part = np.abs(1e3 * true.shift) <= reach
        axes[key].plot(
            1e3 * true.shift[part], scale * true.value[part, i], color=INK, linewidth=1.0, label="true"
        )
        for (name, rounds), colour in zip(drawn.items(), (AFTER, BEFORE), strict=True):
            bins = rounds[-1].bins
            axes[key].plot(
                1e3 * bins.shift,
                scale * bins.value[:, i],
                ".",
                color=colour,
                markersize=4,
                label=f"from {name}",
            )
        name_axes(axes[key], "y - d [mm]", label)
    shown = (record.t >= record.t[-1] / 2) & (record.t < record.t[-1] / 2 + 3.0)
    t, y, d = record.t[shown], record.columns["y"][shown], record.columns["y_irr"][shown]
    axes["track"].plot(t, 1e3 * d, color=CLOUD, linewidth=2.4)
    for (_, rounds), colour in zip(drawn.items(), (AFTER, BEFORE), strict=True):
        axes["track"].plot(t, 1e3 * (y - rounds[-1].shift[shown]), color=colour, linewidth=0.9)
    name_axes(axes["track"], "time [s]", "irregularity [mm]")
    legend(figure, axes["radii"])
    name = f"profile_loop_{case.name.replace(' ', '_')}"
    return Plot(name, figure, "Geometry and irregularity that the loop finds.")


NOTES = (
    "The source names the loop as a possible approach and prints neither equations nor a result of it.",
    "Its sensors are ideal. The loop needs this of the roll: noise of 1 urad spoils the sum of the angles.",
    "Profiles are S1002 on 60E1 1:40; at first the track is assumed 3 mm wider, or the wheel a cone.",
)

ROW = Row(
    "profile_loop",
    "Irregularity and contact geometry in a loop, neither known",
    "Ward et al. 2010, section 6, Fig. 8",
    "wheelset",
    CASES,
    rebuilt,
    by_fmu,
)
