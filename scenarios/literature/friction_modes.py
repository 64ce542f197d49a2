"""Friction condition by filters of several models, beside one unscented filter (thesis Table 4.1).

The conditions of the rail's surface are the modes: friction and creep law change together between them. The
filters run on the test rig, whose wheel is braked once a second up to the limit of adhesion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.estimator import Estimate
from estimator.filters.imm import Imm
from estimator.filters.modes import Mode, entries
from estimator.filters.named import Request
from estimator.filters.rbpf import Rbpf
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import USUAL, Ukf
from estimator.record import Array
from fmus.contact.forces.conditions import CONDITIONS, PARAMETERS
from scenarios.literature.case import Case, Record
from scenarios.literature.following import BAND, NORMAL_95, Followed, follow, rmse
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import variances

DT = 5e-3  # s
SUPPLY = 7.5  # Hz, 15 km/h
ROLLER = 2 * pi * SUPPLY / 5  # rad/s, synchronous with five pole pairs
NOISE = {"omega_w": 2e-3, "omega_r": 2e-3}  # rad/s
INPUTS = ("T_P", "f_sync")
WHEN = 3.3  # s, between two pulses of torque
SETTLED = 1.2  # s after the start and after a change: a pulse has come
STATES = tuple(
    UnknownState(name, speed, std=0.05, noise=0.02)
    for name, speed in (("omega_w", ROLLER * 0.45215 / 0.3482), ("omega_r", ROLLER))
)
BETWEEN = {"mu0": 0.13, "A": 0.4, "B": 0.2, "k_A": 0.8, "k_S": 0.3}  # in the middle of wet and low
BOUNDS: Mapping[str, tuple[float, float]] = {
    "mu0": (0.01, 0.8), "A": (0.05, 0.99), "B": (0.01, 2.0), "k_A": (0.05, 2.0), "k_S": (0.02, 1.0),
}  # fmt: skip
SPREAD = 0.1  # deviation of a parameter within its condition, over its value
KEEP = 0.01  # walk of a parameter within a condition, over its value and per second^1/2
ALONE = (0.3, 0.15, 0.1)  # start, deviation and walk of mu0 where nothing else is unknown
STAY = 5.0  # s, mean time in a condition
PARTICLES = 100
ONE, FIVE, IMM, PARTICLE = WAYS = (
    "UKF, mu0 alone", "UKF, five unknowns", "interacting models", "particles",
)  # fmt: skip
NEAR = 0.03  # what the error of mu0 may be by the interacting models, on the conditions that they know


def _case(name: str, first: Mapping[str, float], later: Mapping[str, float] | None = None) -> Case:
    case = Case(name, "testrig", 4.0, DT, SUPPLY, INPUTS, NOISE, first)
    return replace(case, duration=6.6, later=later, when=WHEN) if later else case


CASES = (
    _case("dry", CONDITIONS["dry"]),
    _case("dry-low", CONDITIONS["dry"], CONDITIONS["low"]),
    _case("wet-very_low", CONDITIONS["wet"], CONDITIONS["very_low"]),
    _case("between wet and low", BETWEEN),
)


@dataclass
class Remembering:
    """A filter whose probabilities of the modes are kept beside its estimates."""

    filter: Imm | Rbpf
    seen: list[Array] = field(default_factory=list)

    def step(self, u: Array, y: Array) -> Estimate:
        """See Filter.step."""
        found = self.filter.step(u, y)
        self.seen.append(self.filter.probabilities)
        return found


def unknowns(walk: bool) -> list[UnknownParameter]:
    """The five parameters, with mean and deviation over the conditions.

    walk: whether they roam among the conditions, or keep to one.
    """
    made = []
    for name in PARAMETERS:
        values = [condition[name] for condition in CONDITIONS.values()]
        mean, std = float(np.mean(values)), max(float(np.std(values)), SPREAD * float(np.mean(values)))
        roams = std / np.sqrt(STAY) if walk else KEEP * mean
        made.append(UnknownParameter(name, mean, std, bounded(BOUNDS[name]), float(roams)))
    return made


def several(kind: type[Imm] | type[Rbpf], joint: Joint, R: Array) -> Remembering:
    """The filter whose modes are the conditions."""
    spread = ({n: (v, SPREAD * v) for n, v in condition.items()} for condition in CONDITIONS.values())
    modes, start = entries(joint, [Mode(at) for at in spread]), joint.start()
    if kind is Imm:
        asked = Request(R, DT, np.zeros(len(INPUTS)), None, None, USUAL)
        return Remembering(Imm.among(modes, STAY, joint, start, asked))
    drawn = Rbpf.drawn_of(joint)
    return Remembering(Rbpf(joint, drawn, start, joint.noise, R, DT, modes, STAY, PARTICLES, seed=1))


def followed(way: str, case: Case, record: Record, fmu: Path) -> tuple[Followed, Array]:
    """Estimates by one of WAYS, and the probabilities of the conditions, (N, 4); (N, 0) by one filter."""
    told: Sequence[UnknownParameter] = unknowns(way == FIVE)
    known: dict[str, float] = {}
    if way == ONE:
        start, std, walk = ALONE
        told = [UnknownParameter("mu0", start, std, bounded(BOUNDS["mu0"]), walk)]
        known = {n: v for n, v in case.true.items() if n != "mu0"}
    R = variances(NOISE)
    with Joint(fmu, [*NOISE], STATES, told, (), INPUTS, known, DT) as joint:
        filter: Remembering | Ukf
        if way in (IMM, PARTICLE):
            filter = several(Imm if way == IMM else Rbpf, joint, R)
        else:
            filter = Ukf(joint, joint.start(), joint.noise, R, DT)
        found = follow(filter, joint, record.t, record.table(INPUTS), record.table([*NOISE]))
    seen = filter.seen if isinstance(filter, Remembering) else []
    probabilities = np.full((len(record.t), len(CONDITIONS) if seen else 0), np.nan)
    if seen:
        probabilities[: len(seen)] = seen
    return found, probabilities


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    for case, record in measured:
        lines = {}
        for way in WAYS:
            tell(f"{case.name}: {way}")
            found, probabilities = followed(way, case, record, fmu)
            findings += judged(case, way, found, probabilities)
            lines[way] = Line.of(found, "mu0")
        shown = {way: lines[way] for way in (IMM, ONE, PARTICLE, FIVE)}
        panels.append(Panel(case.name, [case.truth("mu0", record.t)], shown, "mu0", (0.0, 0.8)))
    return Outcome(ROW.name, findings, [parameter_figure(ROW.name, panels)], NOTES)


def judged(case: Case, way: str, found: Followed, probabilities: Array) -> list[Finding]:
    """Error and band of mu0 once a pulse has come after start and change, and the condition that is named."""
    t, true, mu0 = found.t, case.truth("mu0", found.t), found.value["mu0"]
    late = t >= np.where(t >= case.when, case.when, 0.0) + SETTLED
    target = NEAR if way == IMM and case.true != BETWEEN else None

    def finding(what: str, ours: float, target: float | None = None, note: str = "") -> Finding:
        return Finding(case.name, f"{way}: {what}", "1", ours, target=target, note=note)

    held = float(np.mean(np.abs(mu0 - true)[late] <= NORMAL_95 * found.std["mu0"][late]))
    made = [
        finding(f"RMSE of mu0, {SETTLED:g} s after start and change", rmse(mu0[late], true[late]), target,
                found.reason),
        finding(f"{BAND}, there", held),
        finding("log likelihood of the record", found.log_likelihood),
        finding("times faster than real time", found.times_real),
    ]  # fmt: skip
    right = condition(case, t)
    if probabilities.shape[1] and right is not None:
        among = probabilities[np.arange(len(t)), right]
        made.append(finding("mean probability of the true condition, there", float(np.mean(among[late]))))
    return made


def condition(case: Case, t: Array) -> Array | None:
    """The number of the true condition at times t (N,); None where the truth is none of them."""
    known = [dict(values) for values in CONDITIONS.values()]
    course = [case.true, *(to for _, to in case.jumps)]
    if any(dict(at) not in known for at in course):
        return None
    found = np.full(len(t), known.index(dict(case.true)))
    for when, to in case.jumps:
        found[t >= when] = known.index(dict(to))
    return found


NOTES = (
    "Interacting models and particles know the four conditions of Table 4.1, with a tenth of each value as "
    "its deviation. The UKF with five unknowns knows their mean and deviation over the conditions.",
    "UKF, mu0 alone, knows the other four parameters of the first condition, and nothing of the change.",
    "Charles et al. 2008 name particle and multiple-model filters as their next step, and print none.",
)

ROW = Row(
    "friction_modes",
    "Friction condition by several models and by particles, on the test rig",
    "thesis Table 4.1; Charles et al. 2008, 6, outlook",
    "testrig",
    CASES,
    rebuilt,
)
