"""Secondary vertical stiffness: Kalman filter with weighted least squares (thesis 4.6.3), and joint UKF.

Beside them runs the rule of the source as it is printed, on the record and on the same record with all signs
turned, as of the track upside down: in a linear vehicle both say the same of its stiffness.
"""

from collections.abc import Mapping
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
from scenarios.literature.prediction_error import Weighted, identified
from scenarios.literature.printed_rule import Printed, by_the_rule
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import variances

CORNERS = ("fl", "fr", "rl", "rr")
INPUTS = tuple(f"u_{c}{end}" for c in CORNERS for end in ("", "_dot"))
COORDINATES = ("z1", "phi_y1", "phi_x1", "z2", "phi_x2", "z3", "phi_x3")
DT = 0.01  # s, thesis 4.6.3
V = 20.0  # m/s
NOISE = {  # m/s2 and rad/s: accelerometers for the bounces, gyros for the turns, eq. 4.12
    "z1_ddot": 3e-3, "phi_y1_dot": 2e-4, "phi_x1_dot": 2e-4, "z2_ddot": 3e-2, "phi_x2_dot": 1e-3,
    "z3_ddot": 3e-2, "phi_x3_dot": 1e-3,
}  # fmt: skip
MEASURED = tuple(NOISE)
TRUE, START = 430e3, 330e3  # N/m
STD, WALK = 1e5, 1e4  # N/m, and in a second^1/2
BOUNDS = (2e4, 2e6)
MEMORY = 1.5  # s, of the least squares
HEALTH_STD, HEALTH_WALK = 0.2, 0.03
KILO = 1e-3
RULE, TURNED = "rule as printed", "rule as printed, signs turned"
WHEN, NEAR, SETTLED = 20.0, 0.1, 5.0
WEIGHTS = np.array([0.35, 0.06, 0.35, 0.06, 0.06, 0.06, 0.06])  # 70 % on coach bounce and roll, thesis 4.6.3
STATES = tuple(
    UnknownState(f"{q}{end}", 0.0, std=1e-2, noise=1e-5) for end in ("", "_dot") for q in COORDINATES
)

STATIC = Case("static", "vehicle7dof", 60.0, DT, V, INPUTS, NOISE, {"k1": TRUE})
CASES = (
    STATIC,
    replace(STATIC, name="drop", later={"k1": TRUE / 2}, when=WHEN),
    replace(
        STATIC, name="one corner", true={"k1": TRUE, "h_k1_rl": 1.0}, later={"h_k1_rl": 0.5}, when=WHEN
    ),
)  # fmt: skip


def joint_ukf(record: Record, fmu: Path, unknown: Mapping[str, UnknownParameter]) -> Followed:
    """States and parameters in one unscented filter."""
    with Joint(fmu, MEASURED, STATES, [*unknown.values()], (), INPUTS, {}, DT) as joint:
        filter = Ukf(joint, joint.start(), joint.noise, variances(NOISE), DT)
        return follow(filter, joint, record.t, record.table(INPUTS), record.table(MEASURED))


def stiffness() -> UnknownParameter:
    """k1 of all four, from the source's guess."""
    return UnknownParameter("k1", START, STD, bounded(BOUNDS), WALK)


def healths() -> dict[str, UnknownParameter]:
    """The problem of localisation: the health of each secondary spring, which starts as sound."""
    names = [f"h_k1_{c}" for c in CORNERS]
    return {n: UnknownParameter(n, 1.0, HEALTH_STD, bounded((0.05, 3.0)), HEALTH_WALK) for n in names}


def least_squares(record: Record, fmu: Path) -> Followed:
    """The linear filter of the states, with weighted least squares of its residuals for k1."""
    unknown = stiffness()
    with Joint(fmu, MEASURED, STATES, [unknown], (), INPUTS, {}, DT) as joint:
        how = Weighted(WEIGHTS * len(WEIGHTS), MEMORY)
        return identified(
            joint, how, variances(NOISE), record.t, record.table(INPUTS), record.table(MEASURED)
        )


def printed_rule(record: Record, fmu: Path, sign: float = 1.0) -> Followed:
    """The rule of the source as printed; sign: -1 turns the signs of all inputs and outputs."""
    unknown = UnknownParameter("k1", START, STD, bounded(None))
    with Joint(fmu, MEASURED, STATES, [unknown], (), INPUTS, {}, DT) as joint:
        u, y = (sign * record.table(names) for names in (INPUTS, MEASURED))
        return by_the_rule(joint, Printed(WEIGHTS), record.t, u, y)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    for case, record in measured:
        weak = next((name for name in case.later if name != "k1"), "")
        if weak:
            tell(f"{case.name}: localisation")
            found = joint_ukf(record, fmu, healths())
            findings += _localised(case, found)
            lines = {n: Line.of(found, n) for n in sorted(healths(), key=lambda n: n != weak)}
            truths = [case.truth(weak, record.t), np.ones_like(record.t)]
            panels.append(Panel(f"{case.name}: health of the springs", truths, lines))
            continue
        lines = {}
        for label in ("joint UKF", "KF and weighted least squares"):
            tell(f"{case.name}: {label}")
            ours = label == "joint UKF"
            found = joint_ukf(record, fmu, {"k1": stiffness()}) if ours else least_squares(record, fmu)
            lines[label] = Line.of(found, "k1", KILO)
            findings += _judged(case, label, found)
        for label, sign in ((RULE, 1.0), (TURNED, -1.0)):
            tell(f"{case.name}: {label}")
            found = printed_rule(record, fmu, sign)
            lines[label] = Line.of(found, "k1", KILO)
            findings += _as_printed(case, label, found)
        panels.append(Panel(case.name, [KILO * case.truth("k1", record.t)], lines, "k1 [kN/m]"))
    return Outcome(ROW.name, findings, [parameter_figure("secondary_stiffness", panels)], NOTES)


def _judged(case: Case, way: str, found: Followed) -> list[Finding]:
    true, t = case.truth("k1", found.t), found.t
    settled = t >= np.where(t >= case.when, case.when, 0.0) + SETTLED
    error = rmse(found.value["k1"][settled], true[settled]) / TRUE
    what = f"{way}: relative RMSE of k1, {SETTLED:g} s after start and step"
    return [
        Finding(case.name, what, "1", error, target=NEAR, note=found.reason),
        Finding(
            case.name, f"{way}: k1 at the end", "kN/m", KILO * float(found.value["k1"][-1]), KILO * true[-1]
        ),
        Finding(case.name, f"{way}: {BAND}", "1", covered(found, "k1", true, SETTLED)),
    ]


def _as_printed(case: Case, way: str, found: Followed) -> list[Finding]:
    """How far the printed rule comes, and where it wanders on the way, which has no target."""
    k1 = KILO * found.value["k1"]
    known = np.isfinite(k1)
    if not known.any():
        return [Finding(case.name, f"{way}: time until it ends", "s", 0.0, note=found.reason)]
    until, true = float(found.t[known][-1]), KILO * case.truth("k1", found.t)[known]
    off = rmse(k1[known], true) / (KILO * TRUE)
    made = [
        Finding(case.name, f"{way}: relative RMSE of k1 until it ends", "1", off, note=found.reason),
        Finding(case.name, f"{way}: time until it ends", "s", until),
    ]
    ends = zip(("smallest", "largest"), (k1[known].min(), k1[known].max()), strict=True)
    return [*made, *(Finding(case.name, f"{way}: {end} k1", "kN/m", float(value)) for end, value in ends)]


def _localised(case: Case, found: Followed) -> list[Finding]:
    made = []
    for c in CORNERS:
        name = f"h_k1_{c}"
        true = case.later.get(name, 1.0)
        value = float(found.value[name][-1])
        made.append(
            Finding(case.name, f"{name} at the end less {true:g}", "1", abs(value - true), target=NEAR)
        )
        over = np.where(found.t >= case.when, true, 1.0)
        made.append(Finding(case.name, f"{name}: {BAND}", "1", covered(found, name, over, SETTLED)))
    return made


NOTES = (
    "The source's rule (eq. 4.13, 4.14) adds the weighted sum of residuals to k1, whether or not a positive "
    "one means a larger k1. Least squares weight each residual by its sensitivity to k1 too.",
    "The printed rule has no bounds. A stiffness below zero cannot be simulated, and there it ends.",
    "The source gives only curves; their end values are in the column of the source.",
)

ROW = Row(
    "secondary_stiffness",
    "Secondary vertical stiffness from inertial sensors",
    "thesis 4.6.3, Fig. 4.29",
    "vehicle7dof",
    CASES,
    rebuilt,
)
