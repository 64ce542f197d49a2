"""Contact forces and friction from an accelerometer and a gyro by an EKF (Mal et al. 2020)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from estimator.filters.bounds import Transform, bounded
from estimator.filters.derivatives import differentiated
from estimator.filters.ekf import Ekf
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.unknown_input import Shaped
from scenarios.literature.case import TRUE, Case, Record
from scenarios.literature.contact_force_figures import figures
from scenarios.literature.contact_force_judged import (
    JUDGED,
    Judged,
    Seen,
    gathered,
)
from scenarios.literature.following import Followed, follow
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import ALIGNMENT, variances

V = 30.0  # m/s; ours, the source gives none
DT = 1e-3  # s; the source's 50 us are those of its Euler steps
TABLE_1 = MappingProxyType({"m_w": 1250.0, "I_wz": 700.0, "s": 0.75})  # kg, kg.m2, m
YAW_STIFFNESS, BODY = 5e6, 15000.0  # N.m/rad, kg; there
GRAVITY = 9.81  # m/s2
PLANT: Mapping[str, float] = MappingProxyType({  # it has a yaw spring and nothing lateral
    **TABLE_1, "k_x": YAW_STIFFNESS / 2, "d": 1.0, "k_y": 0.0, "b_x": 0.0, "b_y": 0.0,
    "F_n": (BODY + TABLE_1["m_w"]) * GRAVITY / 2,
})  # fmt: skip
CONDITIONS: Mapping[str, Mapping[str, float]] = {  # Table 3
    "dry": {"mu0": 0.46, "A": 0.4, "B": 0.6, "k_A": 1.0, "k_S": 1.0},
    "wet": {"mu0": 0.3, "A": 0.4, "B": 0.2, "k_A": 1.0, "k_S": 1.0},
    "poor": {"mu0": 0.2, "A": 0.1, "B": 0.2, "k_A": 1.0, "k_S": 1.0},
    "worst": {"mu0": 0.1, "A": 0.1, "B": 0.2, "k_A": 1.0, "k_S": 1.0},
}
COURSE = ("dry", "wet", "poor", "worst", "wet")  # of the transition, its 4.5
HELD = 2.0  # s of each
NOISE = {"y_ddot": 1e-2, "psi_dot": 1e-4}  # m/s2, rad/s: sensors as they are sold

# start deviations, and process noise for a linearised contact per second^1/2
STATES = (
    UnknownState("y", 0.0, std=1e-3, noise=1e-9),
    UnknownState("psi", 0.0, std=1e-3, noise=1e-9),
    UnknownState("y_dot", 0.0, std=1e-2, noise=1e-3),
    UnknownState("psi_dot", 0.0, std=1e-2, noise=1e-3),
)
FRICTION = UnknownParameter("mu0", 0.3, 0.15, bounded((0.01, 0.8)), walk=0.1)
DEVIATION = 2e-3  # m, of the alignment
SHAPES = tuple((f, d) for f in (0.7, 1.0, 1.5) for d in (0.7, 1.0))  # Hz and damping to choose from
LEARNT = 4.0  # s of a record from which the shaping is learnt
OUTPUTS = "outputs only"
WAYS = (OUTPUTS, "alignment known")


def _case(name: str, course: Sequence[str], duration: float) -> Case:
    jumps = tuple((HELD * (i + 1), CONDITIONS[then]) for i, then in enumerate(course[1:]))
    true = {**PLANT, **CONDITIONS[course[0]]}
    later = {"when": jumps[0][0], "later": jumps[0][1], "further": jumps[1:]} if jumps else {}
    return Case(
        name, "wheelset", duration, DT, V, ALIGNMENT, NOISE, true,
        judged=JUDGED, **later,  # type: ignore[arg-type]
    )  # fmt: skip


CASES = (
    *(_case(name, (name,), 10.0) for name in CONDITIONS),
    _case("transition", COURSE, HELD * len(COURSE)),
)


def declared(case: Case) -> dict[str, float]:
    """The problem of the filter: all parameters except friction are known, as they are at the beginning."""
    return {"V": V, **{name: value for name, value in case.true.items() if name != "mu0"}}


def followed(case: Case, record: Record, fmu: Path, shape: Shaped | None) -> Followed:
    """Run the filter on a record: with the alignment estimated by a shaping filter, or else known."""
    unknown, inputs = ((shape,), ()) if shape else ((), ALIGNMENT)
    u = record.table(inputs)
    with Joint(fmu, [*NOISE], STATES, [FRICTION], unknown, inputs, declared(case), DT) as joint:
        system = differentiated(joint, u[0], 0.0, DT) or joint
        filter = Ekf(system, joint.start(), joint.noise, variances(NOISE), DT)
        return follow(filter, joint, record.t, u, record.table([*NOISE]))


def shaped(case: Case, record: Record, fmu: Path) -> Shaped:
    """The shaping filter for which the first seconds of a record are likeliest."""
    part = record.t < record.t[0] + LEARNT
    first = Record({name: samples[part] for name, samples in record.columns.items()})
    shapes = [Shaped("y_irr", DEVIATION, f, "y_irr_dot", d) for f, d in SHAPES]
    return max(shapes, key=lambda shape: followed(case, first, fmu, shape).log_likelihood)


def seen(case: Case, record: Record, found: Followed, fmu: Path) -> Seen:
    """Motion and wheel quantities that the FMU computes from the estimates."""
    free = UnknownParameter("mu0", FRICTION.start, FRICTION.std, Transform("free"))
    X = np.column_stack([found.value[n] for n in (*(s.name for s in STATES), "mu0")])
    rails = found.value if "y_irr" in found.value else record.columns
    u = np.column_stack([rails[n] for n in ALIGNMENT])
    with Joint(fmu, JUDGED, STATES, [free], (), ALIGNMENT, declared(case), DT) as joint:
        carried = joint.start().carried
        rows = [joint.h(x[None], held, 0.0, carried)[0] for x, held in zip(X, u, strict=True)]
    return gathered(dict(zip(JUDGED, np.array(rows).T, strict=True)))


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    sheets: list[Judged] = []
    for case, record in measured:
        tell(f"{case.name}: the alignment's shaping")
        shape = shaped(case, record, fmu)
        true = gathered({name: record.columns[name + TRUE] for name in JUDGED})
        for way in WAYS:
            tell(f"{case.name}: {way}")
            found = followed(case, record, fmu, shape if way == OUTPUTS else None)
            one = Judged(case, way, found, true, seen(case, record, found, fmu))
            findings += one.findings()
            sheets.append(one)
        findings.append(Finding(case.name, f"{OUTPUTS}: shaping frequency", "Hz", shape.frequency))
    ours = [one for one in sheets if one.way == OUTPUTS]
    return Outcome(ROW.name, findings, figures(ours), NOTES)


NOTES = (
    "The source's covariances say sensors of 0.3 mm/s2 and 0.3 urad/s; here 10 mm/s2 and 0.1 mrad/s.",
    "Contact geometry is S1002 on 60E1, equivalent conicity about 0.16; the source has a cone of 0.15.",
    "The filter knows k_A, k_S, A and B of the first condition and has no information on the transitions.",
    "The source prints no numbers of its errors, only curves.",
)

ROW = Row(
    "contact_force_ekf",
    "Contact forces and friction from an accelerometer and a gyro",
    "Mal et al. 2020, Fig. 4 to 23",
    "wheelset",
    CASES,
    rebuilt,
)
