"""Friction coefficient from lateral and yaw response by a joint UKF (thesis 4.6.1 and its paper)."""

from pathlib import Path

import numpy as np

from estimator.filters.bounds import Transform, bounded
from estimator.filters.estimator import Adaptation, Estimate
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Spread, Ukf
from estimator.filters.unknown_input import Shaped
from estimator.record import Array
from fmus.contact.forces.conditions import CONDITIONS
from fmus.contact.forces.friction import CRITICAL
from scenarios.literature.case import Case, Record
from scenarios.literature.following import (
    BAND,
    Followed,
    covered,
    first_below,
    follow,
    rmse,
)
from scenarios.literature.friction_figures import alignment_figure, friction_figure
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import (
    ALIGNMENT,
    DT,
    MEASURED,
    NOISE,
    Task,
    V,
)

START = {"dry": 0.40, "wet": 0.15, "low": 0.15, "very_low": 0.10}
SOURCE_RMSE = {"dry": 0.0781, "wet": 0.0457, "low": 0.0367, "very_low": 0.0654}  # Table 4.2
SOURCE_CROSSING = 25.0  # s after a step from dry rails, thesis 4.6.1; it gives none from wet ones
LOWEST, HIGHEST = 0.01, 0.6  # eq. 4.8
STD, WALK = 0.1, 0.005  # of mu0: start deviation, and process noise per second^1/2
WHEN = 20.0  # s
START_UP = 2.0  # s, in which an estimate leaves its start

# eq. 4.7: diagonals for y, psi, y_dot, psi_dot, mu0, Q that of one step
SOURCE_P0 = (1e-3, 1e-3, 1e-3, 1e-3, 0.5)
SOURCE_Q = (1e-3, 1e-3, 8e-4, 8e-4, 1.6e-1)
SOURCE_R = (1e-8, 1e-8, 1e-8, 1e-8)
WAYS = ("a", "a'", "b", "c", "d")
SOURCE_SPREAD = Spread(alpha=0.5, beta=2.0, kappa=0.0)


def _case(first: str, then: str = "") -> Case:
    name = f"{first}-{then}" if then else first
    more = {"later": CONDITIONS[then], "when": WHEN} if then else {}
    return Case(name, "wheelset", 75.0, DT, V, ALIGNMENT, NOISE, CONDITIONS[first], **more)  # type: ignore[arg-type]


CASES = (
    *map(_case, CONDITIONS),
    *(_case(first, then) for first in ("dry", "wet") for then in ("low", "very_low")),
)


def task(case: Case, fmu: Path) -> Task:
    """Our filter: mu0 is unknown, the other parameters are those of the condition at the beginning."""
    first = case.name.split("-")[0]
    declared = {name: value for name, value in CONDITIONS[first].items() if name != "mu0"}
    unknown = UnknownParameter("mu0", START[first], STD, bounded((LOWEST, HIGHEST)), WALK)
    return Task(fmu, unknown, declared)


def as_published(
    case: Case, record: Record, fmu: Path, per: float = DT, adapt: Adaptation | None = None
) -> Followed:
    """(a): outputs only, no alignment in the filter, the source's P0, Q, R, spread and clipping.

    per: s, in which Q comes in; the source does not say whether its Q is that of a step or of a second.
    adapt: of Q and R to the innovations, which the source names as its next step.
    """
    ours = task(case, fmu)
    start, q = np.sqrt(SOURCE_P0), np.sqrt(np.array(SOURCE_Q) / per)
    states = [UnknownState(n, 0.0, start[i], q[i]) for i, n in enumerate(MEASURED)]
    clipped = Transform("clip", LOWEST, HIGHEST)
    unknown = UnknownParameter("mu0", ours.parameter.start, start[4], clipped, q[4])
    with Joint(fmu, MEASURED, states, [unknown], constants={"V": V, **ours.declared}, dt=DT) as joint:
        begun: Estimate = joint.start()
        filter = Ukf(joint, begun, joint.noise, np.diag(SOURCE_R), DT, adapt=adapt, spread=SOURCE_SPREAD)
        return follow(filter, joint, record.t, record.table(()), record.table(MEASURED))


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    followed: dict[str, dict[str, Followed]] = {}
    for case, record in measured:
        tell(f"{case.name}: the alignment's shaping")
        shape = task(case, fmu).shaped(record)
        followed[case.name] = {}
        for way in WAYS:
            tell(f"{case.name}: ({way})")
            found = _followed(way, case, record, fmu, shape)
            followed[case.name][way] = found
            findings += _judged(case, record, way, found)
        findings.append(Finding(case.name, "(b) shaping frequency", "Hz", shape.frequency))
        findings.append(Finding(case.name, "(b) shaping damping", "1", shape.damping))
    plots = [friction_figure(measured, followed)]
    plots += [alignment_figure(measured, followed)]
    return Outcome(ROW.name, findings, plots, NOTES)


def _followed(way: str, case: Case, record: Record, fmu: Path, shape: Shaped) -> Followed:
    if way.startswith("a"):
        return as_published(case, record, fmu, DT if way == "a" else 1.0)
    ours = task(case, fmu)
    if way == "b":
        return ours.along(record, shape)
    return ours.with_form(record) if way == "d" else ours.known(record)


def _judged(case: Case, record: Record, way: str, found: Followed) -> list[Finding]:
    true = case.truth("mu0", record.t)
    static = not case.later
    source = SOURCE_RMSE[case.name] if static else None
    share = {"b": 0.5, "c": 0.3}.get(way)
    target = source * share if source and share else None
    error = rmse(found.value["mu0"], true)
    made = [Finding(case.name, f"({way}) RMSE of mu0", "1", error, source, target, note=found.reason)]
    if not static:
        after = first_below(record.t, found.value["mu0"], CRITICAL, case.when)
        aim = None if way.startswith("a") else 3.0
        crossing = f"({way}) below {CRITICAL} after the step"
        printed = SOURCE_CROSSING if case.name.startswith("dry") else None
        made.append(Finding(case.name, crossing, "s", after, printed, aim))
        waiting = (record.t > START_UP) & (record.t < case.when)
        early = float(np.mean(found.value["mu0"][waiting] < CRITICAL))
        none = None if way.startswith("a") else 0.0
        made.append(Finding(case.name, f"({way}) share below {CRITICAL} before it", "1", early, target=none))
    if way == "b" and static:
        made.append(Finding(case.name, "(b) error of the alignment, rms over rms", "1",
                            alignment_error(found, record), target=0.1))  # fmt: skip
    if not way.startswith("a"):
        made.append(Finding(case.name, f"({way}) mean NIS of 4", "1", found.nis))
        held = covered(found, "mu0", true, START_UP)
        made.append(Finding(case.name, f"({way}) {BAND}", "1", held))
        made.append(Finding(case.name, f"({way}) times faster than real time", "1", found.times_real))
    return made


def alignment_error(found: Followed, record: Record) -> float:
    """Rms of the alignment's error over its own rms."""
    true: Array = record.columns["y_irr"]
    return rmse(found.value["y_irr"], true) / float(np.sqrt(np.mean(true**2)))


NOTES = (
    "(a) does not know the alignment, so it attributes the effect of the track to noise and friction.",
    "(a) uses the source's Q per step, (a') per second; the source does not say which is meant.",
    "(b) learns frequency and damping of the alignment's shaping from the first 15 s, by likelihood.",
    "(d) is (c) with the scales of the contact's form unknown too.",
    "At a step all Polach parameters change, which no filter knows: the estimated mu0 explains the motion "
    "with the old values of the others.",
)

ROW = Row(
    "friction_ukf",
    "Friction coefficient from lateral and yaw response",
    "thesis 4.6.1, Table 4.2, Fig. 4.26 and 4.27",
    "wheelset",
    CASES,
    rebuilt,
)
