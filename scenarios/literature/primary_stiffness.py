"""Primary lateral stiffness from lateral and yaw response by a joint UKF (thesis 4.6.2)."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.system import UnknownParameter
from estimator.record import Array
from fmus.contact.forces.conditions import CONDITIONS
from scenarios.literature.case import Case
from scenarios.literature.following import BAND, Followed, covered, rmse
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import (
    ALIGNMENT,
    DT,
    NOISE,
    Task,
    V,
)

BOTH = 2.0  # sides: the source gives the total
TOTAL = BOTH * 1e-6  # from N/m of one side to the MN/m of the tables
TRUE, START, DROPPED = 6e6 / BOTH, 4e6 / BOTH, 4e6 / BOTH  # N/m of one side
SETTING = {**CONDITIONS["dry"], "F_n": 50e3, "patch": 1.0}  # N, virtual penetration: thesis 4.6.2
STD, WALK = 1e6, 2e5  # N/m of one side: start deviation, and process noise per second^1/2
BOUNDS = (1e5, 2e7)
WHEN = 20.0  # s
NEAR = 0.1  # of the true value, within which a step counts as found
SETTLED = 2.0  # s after the start and after a step, in which the estimate is on its way

STATIC = Case("static", "wheelset", 40.0, DT, V, ALIGNMENT, NOISE, {**SETTING, "k_y": TRUE})
CASES = (STATIC, replace(STATIC, name="drop", later={"k_y": DROPPED}, when=WHEN))


def task(fmu: Path) -> Task:
    """The problem of the filter: k_y is unknown, all other parameters are known."""
    unknown = UnknownParameter("k_y", START, STD, bounded(BOUNDS), WALK)
    return Task(fmu, unknown, SETTING)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    ours = task(fmu)
    for case, record in measured:
        tell(f"{case.name}: the alignment's shaping")
        shape = ours.shaped(record)
        lines: dict[str, Line] = {}
        for way, label in (("outputs only", "alignment estimated along"), ("known", "alignment known")):
            tell(f"{case.name}: {label}")
            found = ours.along(record, shape) if way == "outputs only" else ours.known(record)
            lines[label] = Line.of(found, "k_y", TOTAL)
            findings += _judged(case, label, found)
        true = TOTAL * case.truth("k_y", record.t)
        panels.append(Panel(case.name, [true], lines, "total lateral stiffness [MN/m]"))
    plot = parameter_figure("primary_stiffness", panels)
    return Outcome(ROW.name, findings, [plot], NOTES)


def _judged(case: Case, way: str, found: Followed) -> list[Finding]:
    true, t, k = case.truth("k_y", found.t), found.t, found.value["k_y"]
    begun = np.where(t >= case.when, case.when, 0.0)
    settled = t >= begun + SETTLED
    error = rmse(k[settled], true[settled]) / TRUE
    end = f"{way}: total at the end, true {TOTAL * true[-1]:g}"
    made = [
        Finding(case.name, f"{way}: relative RMSE of k_y, {SETTLED:g} s after start and step", "1", error,
                target=NEAR, note=found.reason),
        Finding(case.name, end, "MN/m", TOTAL * float(k[-1])),
        Finding(case.name, f"{way}: {BAND}", "1", covered(found, "k_y", true, SETTLED)),
    ]  # fmt: skip
    if case.later:
        after = _within(t - case.when, k, true)
        made.append(
            Finding(
                case.name, f"{way}: within {NEAR:.0%} for good after the drop", "s", after, target=SETTLED
            )
        )
    return made


def _within(since: Array, k: Array, true: Array) -> float:
    """Time [s] after which the estimate stays near the true value; inf if it never does."""
    far = np.flatnonzero((since >= 0) & ~(np.abs(k - true) <= NEAR * true))
    last = int(far[-1]) + 1 if len(far) else int(np.argmax(since >= 0))
    return float(since[last]) if last < len(since) else np.inf


NOTES = (
    "The source draws its estimates but prints no numbers.",
    "Truth and filter find the patch by virtual penetration, as the source does here (its 3.2.2).",
    "The truth's contact search, patch and integration are its own code.",
)

ROW = Row(
    "primary_stiffness",
    "Primary lateral stiffness from lateral and yaw response",
    "thesis 4.6.2, Fig. 4.28",
    "wheelset",
    CASES,
    rebuilt,
)
