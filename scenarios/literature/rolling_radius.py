"""Rolling radius of the tram wheel on the test rig by a joint UKF (thesis 4.6.4), the contact patch wrong."""

from pathlib import Path

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

CASES = tuple(
    Case(name, "testrig", 40.0, DT, f, ("T_P", "f_sync"), NOISE, {"r_w": TRUE}) for name, f in SPEEDS.items()
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
        filter = Ukf(joint, joint.start(), joint.noise, variances(NOISE), DT)
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
            source = SOURCE[case.name, label]
            error = MM * rmse(found.value["r_w"], true)
            what = f"{label}: RMSE of r_w"
            findings.append(Finding(case.name, what, "mm", error, source, source / 2, note=found.reason))
            late = record.t > record.t[0] + 1.0
            rest = MM * rmse(found.value["r_w"][late], true[late])
            findings.append(Finding(case.name, f"{label}: RMSE without the first second", "mm", rest))
            held = covered(found, "r_w", true, 1.0)
            findings.append(Finding(case.name, f"{label}: {BAND}", "1", held))
        around = (MM * TRUE - 5.0, MM * TRUE + 5.0)
        panels.append(Panel(case.name, [MM * case.truth("r_w", record.t)], lines, "r_w [mm]", around, True))
    plot = parameter_figure("rolling_radius", panels)
    return Outcome(ROW.name, findings, [plot], NOTES)


NOTES = (
    "The source's data, measured on its rig, are not public; these are a truth model's, every 1 ms.",
    "The filter assumes a circular patch of 2.7 mm, as the source does; the true patch is an ellipse.",
)

ROW = Row(
    "rolling_radius",
    "Rolling radius of the tram wheel on the test rig",
    "thesis 4.6.4, Fig. 4.32 to 4.35",
    "testrig",
    CASES,
    rebuilt,
)
