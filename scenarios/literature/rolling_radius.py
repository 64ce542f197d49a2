"""Rolling radius of the tram wheel on the test rig by a joint UKF (thesis 4.6.4), the contact patch wrong."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from scenarios.literature.case import Case, Record
from scenarios.literature.following import BAND, Followed, covered, follow, rmse
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import variances

TRUE = 0.3482  # m, thesis 4.6.4
DT = 1e-3  # s
NOISE = {"omega_w": 2e-3, "omega_r": 2e-3}  # rad/s
SPEEDS = {"15 km/h": 7.5, "30 km/h": 15.0}  # Hz of the supply, thesis 4.5
FIRST = {7.5: (12.16, 9.36), 15.0: (24.33, 18.73)}  # rad/s, wheel and roller, thesis 4.5
STARTS = {"from 320 mm": 0.320, "from 400 mm": 0.400}
SOURCE = {  # mm, thesis 4.6.4
    ("15 km/h", "from 320 mm"): 0.6060,
    ("15 km/h", "from 400 mm"): 1.0631,
    ("30 km/h", "from 320 mm"): 0.8233,
    ("30 km/h", "from 400 mm"): 1.0139,
}
PATCH = 2.7e-3  # m, circular contact patch assumed by the filter
STD = 0.03  # m, start deviation
SLIP_STD = 0.3  # rad/s2 per second^1/2: process noise for the error of a wrong patch
BOUNDS = (0.2, 0.6)
MM = 1e3
# what a real rig has and the filter does not know: a roller of another radius, drag of the wheel's bearings
ROUGH = {"r_r": 0.45265, "T_w_ext": -20.0}  # m, declared 0.45215; N.m
RESOLUTION = 0.01  # rad/s, of its encoders

IDEAL = tuple(
    Case(name, "testrig", 40.0, DT, f, ("T_P", "f_sync"), NOISE, {"r_w": TRUE}) for name, f in SPEEDS.items()
)
CASES = (
    *IDEAL,
    *(replace(c, name=f"{c.name}, rough", true={**c.true, **ROUGH}, resolution=RESOLUTION) for c in IDEAL),
)


def followed(record: Record, case: Case, start: float, fmu: Path) -> Followed:
    """The estimate from a first guess of the radius [m]."""
    omega = FIRST[case.speed]
    states = [
        UnknownState(n, value, std=0.3, noise=SLIP_STD)
        for n, value in zip(NOISE, omega, strict=True)
    ]  # fmt: skip
    unknown = UnknownParameter("r_w", start, STD, bounded(BOUNDS))
    patch = {"a": PATCH, "b": PATCH}
    with Joint(fmu, [*NOISE], states, [unknown], (), case.inputs, patch, DT) as joint:
        R = variances(NOISE) + np.eye(len(NOISE)) * case.resolution**2 / 12  # of rounding, where it is white
        filter = Ukf(joint, joint.start(), joint.noise, R, DT)
        return follow(filter, joint, record.t, record.table(case.inputs), record.table([*NOISE]))


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    for case, record in measured:
        lines = {}
        for label, start in STARTS.items():
            tell(f"{case.name}: {label}")
            found = followed(record, case, start, fmu)
            lines[label] = Line.of(found, "r_w", MM)
            true = case.truth("r_w", record.t)
            source = SOURCE[case.name.removesuffix(", rough"), label]
            aim = source / 2 if case in IDEAL else None
            error = MM * rmse(found.value["r_w"], true)
            what = f"{label}: RMSE of r_w"
            findings.append(Finding(case.name, what, "mm", error, source, aim, note=found.reason))
            late = record.t > record.t[0] + 1.0
            rest = MM * rmse(found.value["r_w"][late], true[late])
            findings.append(Finding(case.name, f"{label}: RMSE without the first second", "mm", rest))
            for name in NOISE:
                off = rmse(found.value[name][late], record.columns[name][late])
                findings.append(
                    Finding(case.name, f"{label}: {name} by the filter less measured, rms", "rad/s", off)
                )
            held = covered(found, "r_w", true, 1.0)
            findings.append(Finding(case.name, f"{label}: {BAND}", "1", held))
        around = (MM * TRUE - 5.0, MM * TRUE + 5.0)
        panels.append(Panel(case.name, [MM * case.truth("r_w", record.t)], lines, "r_w [mm]", around, True))
    plot = parameter_figure("rolling_radius", panels)
    return Outcome(ROW.name, findings, [plot], NOTES)


NOTES = (
    "The source's data, measured on its rig, are not public; these are a truth model's, every 1 ms.",
    "The filter assumes a circular patch of 2.7 mm, as the source does; the true patch is an ellipse.",
    "Rough: the roller's radius is 0.5 mm more than declared, drag of 20 N.m acts on the wheel, and encoders "
    "round to 0.01 rad/s. The speeds tell the ratio of both radii, so that the roller's error comes through.",
)

ROW = Row(
    "rolling_radius",
    "Rolling radius of the tram wheel on the test rig",
    "thesis 4.6.4, Fig. 4.32 to 4.35",
    "testrig",
    CASES,
    rebuilt,
)
