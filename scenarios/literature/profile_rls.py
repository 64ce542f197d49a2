"""Wheel and rail profile by grey-box recursive least squares in bins of the shift (Ward et al. 2010)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.filters.estimator import Estimate
from estimator.filters.rls import Rls
from estimator.record import Array
from fmus.contact import contact_table
from scenarios.drawing.sheet import (
    AFTER,
    BEFORE,
    CLOUD,
    INK,
    Plot,
    legend,
    name_axes,
    sheet,
)
from scenarios.literature.case import Case, Record
from scenarios.literature.linear_creep import by_fmu
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.row import Measured, Row, Tell

F11, F22, F23, F33 = 7.44e6, 6.79e6, 13.7e3, 0.0  # N, N, N.m, N.m2; this and what follows: its Table A.1
F_Y, K_Y, K_PSI = 50e3, 0.23e6, 2.5e6  # N.s/m, N/m, N.m
M_W, M_M, I_W, I_WY = 1250.0, 8000.0, 700.0, 200.0  # kg, kg, kg.m2, kg.m2
HALF, W, R0, V = 0.7452, 12263.0, 0.45, 20.0  # m, N, m, m/s
DEVIATION = 2e-3  # m, of alignment and of gauge, its section 5
BIN = 0.25e-3  # m of shift
ENOUGH = 100  # samples in a bin before it counts
FLANGE = 5.5e-3  # m of shift, beyond which the flange comes into it
COMBINATIONS = ("r_L + r_R", "r_L - r_R", "delta_L + delta_R", "delta_L - delta_R")
SLOPES = ("r_L - r_R, slope", "delta_L - delta_R, slope")  # within a bin, where both change fastest
# powers of the gauge and of the place in the bin, by which both differences change if the gauge is known
GAUGED = ((1, 0), (2, 0), (3, 0), (1, 1), (2, 1), (0, 2))
IN_REGION = 0.9  # share of bins, with the gauge known; the source draws its points all within
KNOWN_TO = np.array([5e-3, 5e-3, 0.5, 0.5, 1.0, 100.0])  # m, m, rad, rad, 1, rad/m: start deviations
NOISE = {  # ideal sensors, as the source has them; the accelerometers' noise is ours
    **dict.fromkeys(("y", "psi", "phi", "y_dot", "psi_dot", "phi_dot", "y_m", "y_m_dot"), 0.0),
    "y_ddot": 1e-3, "psi_ddot": 1e-3,
}  # fmt: skip
CHANGES_BY = (5e-3, 0.5)  # m, rad: start deviations of what the gauge or the place does to both differences
DT = 2e-3  # s
SLACK = 0.02  # of a range, by which a bin may be off the region
KNOWN, PRINTED = "gauge known, ", "regressors as printed, "

ALONE = Case(
    "alignment", "wheelset", 120.0, DT, V, ("y_irr", "y_irr_dot", "gauge_irr"), NOISE,
    {"alignment_sd": DEVIATION, "gauge_sd": 0.0},
)  # fmt: skip
CASES = (ALONE, replace(ALONE, name="gauge too", true={"alignment_sd": DEVIATION, "gauge_sd": DEVIATION}))


IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Curves:
    """The four combinations (n, 4) at shifts (n,), m, their standard errors, and samples in each bin (n,)."""

    shift: Array
    value: Array
    std: Array
    samples: Array


def geometry() -> Curves:
    """The true ones, by the contact table, which is not what made the records."""
    table = contact_table(r0=R0)
    shift = table.index.to_numpy(dtype=np.float64)
    left, right = table["r_left"].to_numpy(), table["r_right"].to_numpy()
    on_left, on_right = table["delta_left"].to_numpy(), table["delta_right"].to_numpy()
    value = np.column_stack([left + right, left - right, on_left + on_right, on_left - on_right])
    return Curves(shift, value, np.zeros_like(value), np.zeros(len(shift)))


def regression(record: Record, gauge_known: bool = False) -> tuple[Array, Array]:
    """Regressors (N, 2, n) of combinations and slopes, and what they must explain in both equations (N, 2).

    Its eq. 1 and 2, linear in the combinations; r_L + r_R stands for what it has beyond 2 r0.
    gauge_known: whether the differences change with the gauge too, in powers of GAUGED.
    """
    c = record.columns
    zero = np.zeros_like(record.t)
    slip = 2 * (c["y_dot"] + R0 * c["phi_dot"] - V * c["psi"]) / V
    lateral = M_W * c["y_ddot"] + F22 * slip + 2 * F23 * c["psi_dot"] / V + W * c["phi"]
    lateral += K_Y * (c["y"] - c["y_m"]) + F_Y * (c["y_dot"] - c["y_m_dot"])
    yaw = I_W * c["psi_ddot"] + I_WY * V / R0 * c["phi_dot"] - F23 * slip
    yaw += 2 * (HALF**2 * F11 + F33) * c["psi_dot"] / V + K_PSI * c["psi"]
    sum_lateral = F11 * c["psi"] / R0 - F22 * c["phi_dot"] / V
    one = np.ones_like(zero)
    inside = _shift(record) - BIN * _place(record)
    first = [sum_lateral, zero, zero, (F23 / R0 - W / 2) * one, zero, (F23 / R0 - W / 2) * inside]
    second = [
        F23 * c["phi_dot"] / V,
        -HALF * F11 / R0 * one,
        HALF * W / 2 * c["psi"],
        F33 / R0 * one,
        -HALF * F11 / R0 * inside,
        F33 / R0 * inside,
    ]
    if gauge_known:
        by_angles, by_radii = (F23 / R0 - W / 2) * one, -HALF * F11 / R0 * one
        for in_gauge, in_bin in GAUGED:
            change = (c["gauge_irr"] / DEVIATION) ** in_gauge * (inside / BIN) ** in_bin
            first += [zero, by_angles * change]
            second += [by_radii * change, zero]
    X = np.stack([np.column_stack(first), np.column_stack(second)], axis=1)
    return X, np.column_stack([lateral, yaw])


def _shift(record: Record) -> Array:
    """Of the wheelset over the track, (N,), m."""
    shift: Array = record.columns["y"] - record.columns["y_irr"]
    return shift


def _place(record: Record) -> IntArray:
    """Number of the bin (N,)."""
    return np.round(_shift(record) / BIN).astype(np.int64)


def identified(record: Record, gauge_known: bool = False) -> Curves:
    """Recursive least squares in each bin of the shift, sample by sample; at nominal gauge if it is known."""
    X, rest = regression(record, gauge_known)
    names: tuple[str, ...] = (*COMBINATIONS, *SLOPES)
    known_to = KNOWN_TO
    if gauge_known:
        names += tuple(f"{name} by {powers}" for powers in GAUGED for name in COMBINATIONS[1::2])
        known_to = np.concatenate([KNOWN_TO, np.tile(CHANGES_BY, len(GAUGED))])
    place = _place(record)
    noise = np.diag(np.square([M_W * NOISE["y_ddot"], I_W * NOISE["psi_ddot"]]))
    start = Estimate(0.0, np.zeros(len(names)), np.diag(known_to**2))
    bins: dict[int, Rls] = {}
    for i, at in enumerate(place.tolist()):
        if at not in bins:
            bins[at] = Rls(names, start, noise)
        bins[at].step(X[i], rest[i])
    counts = {at: int(np.sum(place == at)) for at in bins}
    order = [at for at in sorted(bins) if counts[at] >= ENOUGH]
    offset = np.array([2 * R0, 0.0, 0.0, 0.0])
    middle = BIN * np.array(order)
    value = np.array([bins[at].now.x[:4] + offset for at in order])
    std = np.array([np.sqrt(np.diag(bins[at].now.P)[:4]) for at in order])
    return Curves(middle, value, std, np.array([counts[at] for at in order], dtype=np.float64))


def as_printed(record: Record) -> Curves:
    """The source's own regression: yaw, roll rate and 1 in each equation apart (eq. 15 to 18), in each bin.

    All samples of a bin at once (eq. 9), where eq. 10 to 14 end for W = 1; no standard errors. The sum of the
    radii is that of the coefficient of yaw in the lateral equation. Where eq. 15 and 17 differ from its eq. 1
    and 2 (weight by the rate of the roll, sign of f23 y'), the latter hold.
    """
    c, place = record.columns, _place(record)
    lateral = M_W * c["y_ddot"] + 2 * (F22 * c["y_dot"] + F23 * c["psi_dot"]) / V + W * c["phi"]
    lateral += K_Y * (c["y"] - c["y_m"]) + F_Y * (c["y_dot"] - c["y_m_dot"])
    yaw = I_W * c["psi_ddot"] + 2 * ((HALF**2 * F11 + F33) * c["psi_dot"] - F23 * c["y_dot"]) / V
    X = np.column_stack([c["psi"], c["phi_dot"], np.ones_like(record.t)])
    rows = []
    for at in np.unique(place).tolist():
        here = place == at
        if here.sum() < ENOUGH:
            continue
        across, about = (np.linalg.lstsq(X[here], one[here], rcond=None)[0] for one in (lateral, yaw))
        radii = 2 * R0 * (1 + (across[0] - 2 * F22) / (2 * F11))
        angles = across[2] / (F23 / R0 - W / 2)
        radii_less = (F33 * angles - R0 * about[2]) / (HALF * F11)
        rows.append(
            [radii, radii_less, (about[0] + 2 * F23 + K_PSI) * 2 / (HALF * W), angles, BIN * at, here.sum()]
        )
    table = np.array(rows)
    return Curves(table[:, 4], table[:, :4], np.full((len(table), 4), np.nan), table[:, 5])


def region(true: Curves, gauge: float) -> tuple[Array, Array]:
    """Least and greatest combinations (n, 4) for gauge errors up to `gauge` [m] to either side.

    The left wheel is at its shift less half of the error, the right one mirrored.
    """
    r, delta = (true.value[:, i] + true.value[:, i + 1] for i in (0, 2))
    r, delta = r / 2, delta / 2
    every = []
    for g in np.linspace(-gauge, gauge, 41):
        left, right = true.shift - g / 2, -true.shift - g / 2
        a, b = (np.interp(x, true.shift, r) for x in (left, right))
        d, e = (np.interp(x, true.shift, delta) for x in (left, right))
        every.append(np.column_stack([a + b, a - b, d + e, d - e]))
    return np.min(every, axis=0), np.max(every, axis=0)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row; no FMU is needed but for records, the equations are the source's."""
    true = geometry()
    findings: list[Finding] = []
    plots: list[Plot] = []
    for case, record in measured:
        tell(f"{case.name}: least squares in bins")
        found = {"": identified(record)}
        gauge = float(np.abs(record.columns["gauge_irr"]).max())
        if gauge > 0:
            tell(f"{case.name}: least squares in bins, gauge known")
            found[KNOWN] = identified(record, gauge_known=True)
        bounds = region(true, gauge)
        findings += [
            f
            for way, one in {**found, PRINTED: as_printed(record)}.items()
            for i in range(4)
            for f in _judged(case, way, true, one, bounds, i)
        ]
        plots.append(_figure(case, true, found, bounds))
    return Outcome(ROW.name, findings, plots, NOTES)


def _judged(
    case: Case, way: str, true: Curves, found: Curves, bounds: tuple[Array, Array], i: int
) -> list[Finding]:
    """Of one combination: how far off nominal gauge, and how many bins lie in the region."""
    used = np.abs(found.shift) <= FLANGE
    span = float(np.ptp(true.value[np.abs(true.shift) <= FLANGE, i]))
    at, seen = found.shift[used], found.value[used, i]
    wanted, lower, upper = (np.interp(at, true.shift, x[:, i]) for x in (true.value, *bounds))
    error = float(np.sqrt(np.mean((seen - wanted) ** 2))) / span
    slack = SLACK * span
    inside = float(np.mean((seen >= lower - slack) & (seen <= upper + slack)))
    aim = IN_REGION if way == KNOWN and i == 0 else None  # of the one combination that the source draws
    name = f"{way}{COMBINATIONS[i]}"
    return [
        Finding(case.name, f"{name}: RMSE over its range", "1", error),
        Finding(case.name, f"{name}: share of bins in the region", "1", inside, target=aim, bound=">="),
    ]


def _figure(case: Case, true: Curves, found: Mapping[str, Curves], bounds: tuple[Array, Array]) -> Plot:
    low, high = bounds
    layout = [["0", "1"], ["2", "3"]]
    figure, axes = sheet(4.6, layout)
    part = np.abs(true.shift) <= FLANGE
    for i, name in enumerate(COMBINATIONS):
        ax = axes[f"{i}"]
        scale, unit = (1e3, "mm") if i < 2 else (1.0, "rad")
        x, ends = 1e3 * true.shift[part], (scale * low[part, i], scale * high[part, i])
        ax.fill_between(x, *ends, color=CLOUD, alpha=0.5, label="region of the gauge")
        ax.plot(x, scale * true.value[part, i], color=INK, linewidth=1.0, label="nominal gauge")
        for (way, one), colour in zip(found.items(), (AFTER, BEFORE), strict=False):
            seen, label = np.abs(one.shift) <= FLANGE, f"{way}found in a bin"
            dots = scale * one.value[seen, i]
            ax.plot(1e3 * one.shift[seen], dots, ".", color=colour, markersize=4, label=label)
        around = scale * np.array([low[part, i].min(), high[part, i].max()])
        ax.set_ylim(*(around + 0.5 * np.ptp(around) * np.array([-1.0, 1.0])))
        name_axes(ax, "y - d [mm]", f"{name} [{unit}]".replace("delta", "δ"))
    legend(figure, axes["0"])
    return Plot(f"profile_{case.name.replace(' ', '_')}", figure, "Contact geometry over the shift.")


NOTES = (
    "Profiles are S1002 on 60E1 1:40; the source has a worn P8 on a 113A rail, which are not public.",
    "Alignment is known, as in the source. Gauge is unknown, and then known, as the source assumes in its "
    "section 3 without saying where it enters; here the differences change with it.",
    "The source's Fig. 7 has the sum of the radii within that region; it draws no other combination.",
)

ROW = Row(
    "profile_rls",
    "Wheel and rail profile by recursive least squares in bins",
    "Ward et al. 2010, Fig. 6 and 7",
    "wheelset",
    CASES,
    rebuilt,
    by_fmu,
)
