"""Friction coefficient from the torsional response of a driven wheelset by a joint UKF (Mal et al. 2020)."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from scenarios.literature.case import Case, Record
from scenarios.literature.contact_force_ekf import CONDITIONS
from scenarios.literature.following import BAND, NORMAL_95, Followed, covered, follow, rmse
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import variances

V = 10.0  # m/s at the start; ours, the source gives none
DT = 1e-3  # s
COURSE = ("dry", "wet", "poor", "worst", "wet")  # of the transition, its 4.5
HELD = 2.0  # s of each
NOISE = {"omega_left": 1e-2, "omega_right": 1e-2, "omega_m": 5e-2, "V": 2e-2}  # rad/s, m/s: encoders, radar
TORQUE = ("T_m",)
OTHER_FORM = "_fastsim"  # ending of a case whose record has FASTSIM's creep forces
R0 = 0.5  # m, Table 1

# start deviations, and process noise for another contact per second^1/2
STATES = (
    UnknownState("theta_s", 0.0, std=1e-5, noise=1e-6),
    UnknownState("theta_g", 0.0, std=1e-5, noise=1e-6),
    UnknownState("omega_left", V / R0, std=0.1, noise=0.02),
    UnknownState("theta_s_dot", 0.0, std=0.05, noise=0.02),
    UnknownState("theta_g_dot", 0.0, std=0.05, noise=0.02),
    UnknownState("V", V, std=0.05, noise=0.01),
)
START, STD, WALK = 0.3, 0.15, 0.1  # of mu0: start, its deviation, and process noise per second^1/2
BOUNDS = (0.01, 0.8)
FOUND = 0.03  # what the error of mu0 may be
SETTLED = 1.2  # s after the start and after a transition: the next pulse of torque has come


def _case(name: str, course: Sequence[str], duration: float) -> Case:
    jumps = tuple((HELD * (i + 1), CONDITIONS[then]) for i, then in enumerate(course[1:]))
    when, later = jumps[0] if jumps else (inf, {})
    return Case(
        name, "traction", duration, DT, V, TORQUE, NOISE, CONDITIONS[course[0]], later, when, jumps[1:]
    )


STATIC = tuple(_case(name, (name,), 4.0) for name in CONDITIONS)
COURSES = (_case("transition", COURSE, HELD * len(COURSE)),)
CASES = tuple(
    replace(case, name=case.name + form) for form in ("", OTHER_FORM) for case in (*STATIC, *COURSES)
)


def followed(case: Case, record: Record, fmu: Path) -> Followed:
    """The estimate of mu0; the other parameters are known, as they are at the beginning."""
    known = {name: value for name, value in case.true.items() if name != "mu0"}
    unknown = UnknownParameter("mu0", START, STD, bounded(BOUNDS), WALK)
    with Joint(fmu, [*NOISE], STATES, [unknown], (), TORQUE, known, DT) as joint:
        filter = Ukf(joint, joint.start(), joint.noise, variances(NOISE), DT)
        return follow(filter, joint, record.t, record.table(TORQUE), record.table([*NOISE]))


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: dict[str, list[Panel]] = {}
    for case, record in measured:
        tell(case.name)
        found = followed(case, record, fmu)
        findings += judged(case, found)
        true, line = case.truth("mu0", record.t), Line.of(found, "mu0")
        form = OTHER_FORM if case.name.endswith(OTHER_FORM) else ""
        panels.setdefault(form, []).append(Panel(case.name, [true], {"estimate": line}, "mu0", (0.0, 0.6)))
    plots = [parameter_figure(f"friction_torsion{form}", drawn) for form, drawn in panels.items()]
    return Outcome(ROW.name, findings, plots, NOTES)


def judged(case: Case, found: Followed) -> list[Finding]:
    """Error of mu0 once a pulse of torque has come, its bias, the filter's band there and what it holds."""
    true, t, mu0 = case.truth("mu0", found.t), found.t, found.value["mu0"]
    begun = np.zeros_like(t)
    for when, _ in case.jumps:
        begun[t >= when] = when
    settled = t >= begun + SETTLED
    what = f"RMSE of mu0 from {SETTLED:g} s after the start and each transition"
    error = rmse(mu0[settled], true[settled])
    bias = float(np.mean((mu0 - true)[settled]))
    band = float(np.sqrt(np.mean(found.std["mu0"][settled] ** 2)))
    held = float(np.mean(np.abs(mu0 - true)[settled] <= NORMAL_95 * found.std["mu0"][settled]))
    return [
        Finding(case.name, what, "1", error, target=FOUND, note=found.reason),
        Finding(case.name, "mean error of mu0 there", "1", bias),
        Finding(case.name, "standard deviation that the filter states there", "1", band),
        Finding(case.name, f"{BAND}, there", "1", held),
        Finding(case.name, f"{BAND}, from {SETTLED:g} s on", "1", covered(found, "mu0", true, SETTLED)),
        Finding(case.name, "times faster than real time", "1", found.times_real),
    ]


NOTES = (
    "Equations 14 to 17 and Tables 1 and 3 are the source's; it drives with no torque and draws no torsion.",
    "A motor pulls once a second to the limit of adhesion: below it no torsional response tells of friction.",
    "Cases that end in _fastsim have FASTSIM's creep forces in the record and Polach's in the filter.",
    "The filter knows k_A, k_S, A and B of the first condition and has no information on the transitions.",
)

ROW = Row(
    "friction_torsion",
    "Friction coefficient from the torsional response of a driven wheelset",
    "Mal et al. 2020, eq. 14 to 17; thesis 4.6.4, outlook",
    "traction",
    CASES,
    rebuilt,
)
