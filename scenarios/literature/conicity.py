"""Nonlinear conicity by Kalman filters and by least squares (Charles et al. 2008)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from estimator.filters.ekf import Ekf
from estimator.filters.estimator import Estimate
from estimator.record import Array
from fmus.errors import BadInput
from scenarios.literature.case import TRUE, Case, Record
from scenarios.literature.conicity_figures import figures
from scenarios.literature.conicity_fits import (
    Fit,
    one_cubic,
    piecewise,
    shift_of,
    yaw_response,
)
from scenarios.literature.conicity_model import (
    DT,
    MOTION,
    OUTPUTS,
    Along,
    Constant,
    V,
    Wheelset,
)
from scenarios.literature.conicity_run import simulated
from scenarios.literature.conicity_table import Tabled
from scenarios.literature.following import Followed, follow, rmse
from scenarios.literature.outcome import Bound, Finding, Outcome
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import variances

DEVIATION = 2.9e-3  # m, of the irregularity: the flanges' roots are reached, the flanges are not
NOISE = {  # our choice; the source names no sensors
    "y": 1e-5, "psi": 1e-6, "y_dot": 1e-4, "psi_dot": 1e-5, "y_ddot": 1e-2, "psi_ddot": 0.1,
}  # fmt: skip
GUESS, STD = 0.15, 0.1  # conicity at the start, and its deviation
STARTS = (1e-3, 1e-3, 1e-2, 1e-2, 1e-3, 1e-2)  # deviation of the motion at the start
DRIVEN = (1e-7, 1e-7, 1e-3, 1e-3, 1e-8, 1e-6)  # process noise of the equations of motion per second^1/2
SLIDES = 2e-2  # m, process noise of the irregularity per second^1/2
KEPT = (1 - SLIDES**2 * DT / DEVIATION**2) ** 0.5  # share left after a sample; keeps its deviation
TAKEN_FOR_NOISE = 0.5  # process noise of the conicity per second^1/2, if the irregularity is not estimated
FREE, LED = 0.3, 0.1  # the same if the irregularity is estimated, and if a table is used too
NODES = 1e-3 * np.arange(-6.0, 6.1, 0.75)  # m, of the table
MEMORY = 0.01  # share of an estimate's information that a sample adds to the table
START_UP = 2.0  # s
WAYS = ("constant", "irregularity too", "table")
FITS = ("one cubic", "piecewise cubics")
AIMS: Mapping[str, tuple[float, Bound]] = {  # of the error over the conicity's own deviation
    "constant": (1.0, ">="), "irregularity too": (0.5, "<="), "table": (0.5, "<="),
}  # fmt: skip
GENERIC = "generic"

DRAWN = Case(
    GENERIC, "wheelset", 60.0, DT, V, ("y_irr",), NOISE, {"alignment_sd": DEVIATION},
    judged=("y", "psi", "psi_dot", "conicity"),
)  # fmt: skip
OTHER_EQUATIONS = {"alignment_sd": DEVIATION, "gauge_sd": 0.0}
CASES = (DRAWN, replace(DRAWN, name="S1002 on 60E1", duration=20.0, true=OTHER_EQUATIONS))


@dataclass(frozen=True)
class Tried:
    """The results of one case: filters by WAYS, fits by FITS, and the table that a filter has learnt."""

    case: Case
    record: Record
    filters: Mapping[str, Followed]
    fits: Mapping[str, Fit]
    table: Tabled

    @property
    def true(self) -> Array:
        """Conicity (N,)."""
        return self.record.columns["conicity" + TRUE]

    def curve(self, shift: Array) -> Array:
        """True conicity at shifts (n,), m, that occur in the run."""
        seen = shift_of(self.record)
        order = np.argsort(seen)
        return np.interp(shift, seen[order], self.true[order])

    @property
    def grid(self) -> Array:
        """Shifts (n,), m, that occur in the run more than a few times."""
        low, high = np.percentile(shift_of(self.record), (1, 99))
        return np.linspace(low, high, 200)


class Taught(Ekf):
    """A filter that corrects its table by each of its estimates, as in the source."""

    def __init__(self, table: Tabled, start: Estimate, Q: Array, R: Array) -> None:
        super().__init__(Wheelset(table), start, Q, R, DT)
        self._table = table

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """See Filter."""
        now = super().step(u, y, dt, held)
        at = len(MOTION)
        self._table.learn(float(now.x[0] - now.x[at + 1]), float(now.x[at]), float(now.P[at, at]))
        return now


def followed(way: str, record: Record) -> tuple[Followed, Tabled]:
    """Run a filter of the outputs alone on a record; returns it with its table, used by the last way only."""
    table = Tabled(NODES, GUESS, STD, MEMORY, KEPT)
    belief: Constant = {"constant": Constant(), "irregularity too": Along(KEPT), "table": table}[way]
    alone = way == WAYS[0]
    more = {"constant": (TAKEN_FOR_NOISE,), "irregularity too": (FREE, SLIDES), "table": (LED, SLIDES)}[way]
    x = np.array([0.0] * len(MOTION) + [GUESS] + [0.0] * (not alone))
    P = np.diag(np.square([*STARTS, STD, *([1e-3] * (not alone))]))
    Q, R, start = np.diag(np.square([*DRIVEN, *more])) * DT, variances(NOISE), Estimate(0.0, x, P)
    filter = Taught(table, start, Q, R) if way == "table" else Ekf(Wheelset(belief), start, Q, R, DT)
    plain = Wheelset(belief)
    return follow(filter, plain, record.t, record.table(()), record.table(OUTPUTS)), table


def tried(case: Case, record: Record, tell: Tell) -> Tried:
    """Run all filters and fits on a case."""
    filters = {}
    for way in WAYS:
        tell(f"{case.name}: conicity by a filter, {way}")
        filters[way], table = followed(way, record)
    fits = dict(zip(FITS, (one_cubic(record), piecewise(record)), strict=True))
    return Tried(case, record, filters, fits, table)


def own_record(case: Case) -> Record:
    """The record of a case by the equations of the row; BadInput for the case of other equations."""
    if case.true == OTHER_EQUATIONS:
        raise BadInput(
            f"case '{case.name}': its record is not of this row's equations; give records, or choose case "
            f"'{GENERIC}'"
        )
    return simulated(case)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row; no FMU is needed, the equations are the source's."""
    every = [tried(case, record, tell) for case, record in measured]
    findings = [finding for one in every for finding in (*_filters(one), *_fits(one))]
    return Outcome(ROW.name, findings, [plot for one in every for plot in figures(one)], NOTES)


def _filters(one: Tried) -> list[Finding]:
    late, shift = one.record.t >= START_UP, shift_of(one.record)
    true = one.true[late]
    spread, made = float(true.std()), []
    for way, found in one.filters.items():
        aim, bound = AIMS[way] if one.case.name == GENERIC else (None, AIMS[way][1])
        error = rmse(found.value["conicity"][late], true) / spread
        what = f"filter, {way}: RMSE of conicity over its deviation"
        made.append(Finding(one.case.name, what, "1", error, target=aim, bound=bound, note=found.reason))
        if "d" in found.value:
            off = rmse((found.value["y"] - found.value["d"])[late], shift[late]) / float(shift.std())
            made.append(
                Finding(one.case.name, f"filter, {way}: error of y - d, rms over its deviation", "1", off)
            )
    off = rmse(one.table.curve(one.grid), one.curve(one.grid))
    made.append(Finding(one.case.name, "the filter's own table: RMSE of conicity over the shift", "1", off))
    return made


def _fits(one: Tried) -> list[Finding]:
    psi, made = one.record.columns["psi" + TRUE], []
    for name, fit in one.fits.items():
        off = rmse(fit(one.grid), one.curve(one.grid))
        made.append(
            Finding(one.case.name, f"least squares, {name}: RMSE of conicity over the shift", "1", off)
        )
        yaw = rmse(yaw_response(one.record, fit), psi) / float(psi.std())
        made.append(
            Finding(one.case.name, f"least squares, {name}: error of the yaw's course over its rms", "1", yaw)
        )
    return made


NOTES = (
    "The source draws a generic conicity without figures; here 0.08 on the tread, 0.4 beyond some 3 mm.",
    "The case of S1002 on 60E1 is made by the equations of Ward et al. 2010, which the filters do not know.",
    "With a constant the irregularity is taken for noise: the conicity must explain what the track does.",
    "The source's irregularity is a random walk; here it fades, so that it keeps its deviation of 2.9 mm.",
)

ROW = Row(
    "conicity",
    "Nonlinear conicity by Kalman filters and by least squares",
    "Charles et al. 2008, Fig. 5 to 9",
    "wheelset",
    CASES,
    rebuilt,
    own_record,
)
