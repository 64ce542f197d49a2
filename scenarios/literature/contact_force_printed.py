"""The filter of Mal et al. 2020 with creep, friction and force as states, beside one of the motion."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.ekf import Ekf
from estimator.filters.estimator import Estimate
from estimator.record import Array
from scenarios.literature.case import TRUE, Case, Record
from scenarios.literature.cone_model import CONICITY, MOTION, OUTPUTS, Cone, Surface, wheels
from scenarios.literature.contact_force_ekf import CONDITIONS, COURSE, HELD, V
from scenarios.literature.contact_force_judged import JUDGED, QUANTITIES, gathered
from scenarios.literature.five_states import STEP, Q, R, five_states
from scenarios.literature.following import Followed, follow, rmse
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import ALIGNMENT

NOISE = dict(zip(OUTPUTS, np.sqrt(np.diag(R)).tolist(), strict=True))  # the sensors of its R
EVERY = 20  # samples of the record, of which ours takes one: 1 ms
START_UP = 0.5  # s
NEAR = 0.1  # of its rms: what an error of ours may be
PRINTED, BLIND, OURS = WAYS = (
    "as printed, track known", "as printed, track unknown", "motion as states",
)  # fmt: skip
FRICTION = (0.3, 0.15, 0.1)  # start, deviation and walk of mu0
STD = (1e-3, 1e-3, 1e-2, 1e-2)  # start deviations of the motion
PROCESS = (1e-9, 1e-9, 1e-4, 1e-4)  # per second^1/2
KILO = 1e-3

Seen = Mapping[str, Array]  # quantity -> (N,); of the wheels (N, 2)


def _case(name: str, course: Sequence[str], duration: float) -> Case:
    jumps = tuple((HELD * (i + 1), CONDITIONS[then]) for i, then in enumerate(course[1:]))
    when, later = jumps[0] if jumps else (np.inf, {})
    true = MappingProxyType({"lambda_w": CONICITY, **CONDITIONS[course[0]]})
    return Case(
        name, "wheelset", duration, STEP, V, ALIGNMENT, NOISE, true, later, when, jumps[1:], judged=JUDGED
    )


CASES = (
    *(_case(name, (name,), 2.0) for name in CONDITIONS),
    _case("transition", COURSE, HELD * len(COURSE)),
)


def surface(case: Case) -> Surface:
    """What the filters know: the friction law of the case's first condition."""
    return {name: value for name, value in case.true.items() if name != "lambda_w"}


def as_printed(case: Case, record: Record, track: bool) -> tuple[Seen, str]:
    """Velocity, yaw rate, creep and force (N,) by the source's filter, and why it ended, if it did.

    track: whether it knows the alignment; else it takes it as zero.
    """
    y_t, y_t_dot = (record.columns[n] * float(track) for n in ALIGNMENT)
    noise = Q[next(name for name, on in CONDITIONS.items() if dict(on) == dict(surface(case)))]
    found = five_states(V, surface(case), noise, y_t, y_t_dot, record.table(OUTPUTS))
    reason = "" if found.lost is None else f"lost at t = {record.t[found.lost]:g} s"
    return {n: found.of(n) if n.endswith("_dot") else np.abs(found.of(n)) for n in QUANTITIES}, reason


def ours(case: Case, record: Record) -> tuple[Seen, Followed]:
    """The same quantities of both wheels by a filter of motion and friction, at every EVERY-th sample."""
    start, std, walk = FRICTION
    transform = bounded((0.01, 0.8))
    cone, z, dt = Cone(V, surface(case), transform), transform.z(start), EVERY * STEP
    per_z = 1 / transform.slope(z)
    first = Estimate(0.0, np.array([0.0, 0.0, 0.0, 0.0, z]), np.diag(np.square([*STD, std * per_z])))
    noise = np.diag(np.square([*PROCESS, walk * per_z])) * dt
    told, seen = record.table(ALIGNMENT)[::EVERY], record.table(OUTPUTS)[::EVERY]
    found = follow(Ekf(cone, first, noise, R, dt), cone, record.t[::EVERY], told, seen)
    X = np.column_stack([found.value[n] for n in MOTION])
    both = wheels(V, X, told[:, 0], found.value["mu0"], surface(case))
    return gathered({**found.value, **both}), found


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    for case, record in measured:
        true = gathered({name: record.columns[name + TRUE] for name in JUDGED})
        lines = {}
        for way in (PRINTED, BLIND):
            tell(f"{case.name}: {way}")
            seen, reason = as_printed(case, record, way == PRINTED)
            findings += judged(case, way, record.t, seen, true, reason)
            lines[way] = Line(record.t, KILO * seen["force"], np.zeros_like(record.t))
        tell(f"{case.name}: {OURS}")
        seen, found = ours(case, record)
        thin = {name: values[::EVERY] for name, values in true.items()}
        findings += judged(case, OURS, found.t, seen, thin, found.reason)
        late, mu0 = found.t >= START_UP, case.truth("mu0", found.t)
        off = rmse(found.value["mu0"][late], mu0[late])
        findings.append(Finding(case.name, f"{OURS}: RMSE of mu0", "1", off))
        lines = {OURS: Line(found.t, KILO * seen["force"][:, 0], np.zeros_like(found.t)), **lines}
        truth = KILO * thin["force"][:, 0]
        panels.append(
            Panel(case.name, [truth], lines, "creep force, left [kN]", (0.0, 1.5 * float(truth.max())))
        )
    return Outcome(ROW.name, findings, [parameter_figure(ROW.name, panels)], NOTES)


def judged(case: Case, way: str, t: Array, seen: Seen, true: Seen, reason: str) -> list[Finding]:
    """Errors from START_UP on, rms over the quantity's rms; one creep and one force count for both wheels."""
    late, made = t >= START_UP, []
    for name, words in QUANTITIES.items():
        value, right = seen[name], true[name]
        if right.ndim > value.ndim:
            value = value[:, None]
        size = float(np.sqrt(np.mean(np.square(right[late]))))
        error = rmse(value[late], right[late]) / size
        target = NEAR if way == OURS else None
        what = f"{way}: error of {words}, rms over rms"
        made.append(Finding(case.name, what, "1", error, target=target, note=reason))
    return made


NOTES = (
    "The source's equations are pictures that were not at hand. The five states, the Euler steps of 50 us, R "
    "and Q are as printed; the rates of creep, friction and force are its eq. 6, 9 and 8 by the chain rule.",
    "It prints no speed, no patch, no start covariance, and not whether its filter is told the alignment.",
    "All know A, B, k_A and k_S of the first condition; the printed one knows mu0 too, ours estimates it.",
)

ROW = Row(
    "contact_force_printed",
    "Contact force with creep, friction and force as states, as printed, on the cone",
    "Mal et al. 2020, eq. 18 to 40, Table 1",
    "wheelset",
    CASES,
    rebuilt,
)
