"""Speeds and creep force of the test rig with FASTSIM in place of Polach, and with spin (thesis 4.5)."""

from pathlib import Path

import casadi as cs
import numpy as np
from scipy.integrate import solve_ivp

from estimator.record import Array
from fmus.contact.forces.coefficients import coefficients
from fmus.contact.forces.friction import friction_coefficient
from fmus.contact.forces.laws.fastsim import Fastsim
from fmus.model import Model, equations
from fmus.testrig.model import W_MIN, Testrig
from fmus.variables import Expr, Input, Output, Parameter, State
from scenarios.literature.case import TRUE, Case, Record
from scenarios.literature.following import rmse
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.rolling_radius import FIRST, NOISE, SPEEDS
from scenarios.literature.rolling_radius import TRUE as RADIUS
from scenarios.literature.row import Measured, Row, Tell

DT = 0.01  # s
INPUTS = ("T_P", "f_sync")
STATES = ("omega_w", "omega_r", "theta_w", "theta_r")
GRID = (40, 40)  # cells along and across
TOLERANCE = 1e-7  # of the integration, rad/s
LAWS = ("FASTSIM", "Polach")
ANGLES = (0.05, 0.2)  # rad, contact angles: about the tread, and towards the flange
NEAR = {
    "omega_w": 5e-3,
    "omega_r": 5e-3,
    "F_x": 5.0,
}  # rad/s, rad/s, N: what FASTSIM may differ from the record
UNITS = {"omega_w": "rad/s", "omega_r": "rad/s", "F_x": "N"}


class RigByFastsim(Testrig):
    """The rig with creep forces by FASTSIM; the contact angle makes the spin (eq. 4.2 and 4.3)."""

    name = "TestrigByFastsim"
    delta_w = Parameter("rad", 0.0, doc="contact angle of the wheel", source="thesis 4.5")

    def _creep_force(m) -> Expr:
        w = cs.hypot(m.r_r * m.omega_r - m.r_w * m.omega_w, W_MIN)
        mu = friction_coefficient(w, m.mu0, m.A, m.B)
        k = coefficients(m.a / m.b, m.nu)
        xi_s = cs.sin(m.delta_w) * (1 / m.r_w + 1 / m.r_r)  # both roll, as with one equivalent radius
        given = (m.a, m.b, m.N, mu, m.G, k.c11, k.c22, k.c23, k.c33, m._creepage(), 0.0, xi_s, m.k_A, m.k_S)
        return Fastsim(GRID).function()(*given)[0]


CASES = tuple(
    Case(name, "testrig", 40.0, DT, f, INPUTS, NOISE, {"r_w": RADIUS}, judged=("F_x",))
    for name, f in SPEEDS.items()
)


def simulated(model: Model, case: Case, record: Record, **parameters: float) -> dict[str, Array]:
    """Speeds and creep force (N,) from the inputs of a record alone, from the source's first speeds."""
    made, at = equations(model), [v.name for v in model.of(State)]
    values = {v.name: v.start for v in model.of(Parameter)} | {"r_w": RADIUS} | parameters
    p = np.array([values[v.name] for v in model.of(Parameter)])
    first = {**dict.fromkeys(STATES, 0.0), **dict(zip(NOISE, FIRST[case.speed], strict=True))}
    t, u = record.t, record.table(INPUTS)

    def inputs(now: float) -> list[float]:
        told = {name: float(np.interp(now, t, u[:, j])) for j, name in enumerate(INPUTS)}
        return [told.get(v.name, 0.0) for v in model.of(Input)]

    found = solve_ivp(
        lambda now, x: np.array(made.f(x, inputs(now), p)).ravel(), (t[0], t[-1]), [first[n] for n in at],
        method="BDF", t_eval=t, rtol=TOLERANCE, atol=TOLERANCE,
    )  # fmt: skip
    rows = [np.array(made.h(x, inputs(now), p)).ravel() for now, x in zip(t, found.y.T, strict=True)]
    outputs = dict(zip((v.name for v in model.of(Output)), np.array(rows).T, strict=True))
    return {**{n: found.y[at.index(n)] for n in NOISE}, **{n: outputs[n] for n in ("F_x", "xi_x")}}


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    by_fastsim = RigByFastsim()
    for case, record in measured:
        true = {**{n: record.columns[n] for n in NOISE}, "F_x": record.columns["F_x" + TRUE]}
        found = {}
        for law, model in zip(LAWS, (by_fastsim, Testrig()), strict=True):
            tell(f"{case.name}: {law}")
            found[law] = simulated(model, case, record)
            findings += judged(case, law, found[law], true)
        for angle in ANGLES:
            tell(f"{case.name}: contact angle {angle:g} rad")
            leaning = simulated(by_fastsim, case, record, delta_w=angle)
            findings.append(_slipping(case, f"FASTSIM, contact angle {angle:g} rad", leaning))
        none = np.zeros_like(record.t)
        lines = {law: Line(record.t, seen["F_x"] / 1e3, none) for law, seen in found.items()}
        panels.append(Panel(case.name, [true["F_x"] / 1e3], lines, "creep force [kN]"))
    return Outcome(ROW.name, findings, [parameter_figure(ROW.name, panels)], NOTES)


def judged(case: Case, law: str, found: dict[str, Array], true: dict[str, Array]) -> list[Finding]:
    """Differences of speeds and creep force from the record, and the creep at the largest force."""
    made = [
        Finding(
            case.name, f"{law}: rms difference of {name}", UNITS[name], rmse(found[name], values),
            target=NEAR[name] if law == "FASTSIM" else None,
        )
        for name, values in true.items()
    ]  # fmt: skip
    return [*made, _slipping(case, law, found)]


def _slipping(case: Case, what: str, found: dict[str, Array]) -> Finding:
    return Finding(case.name, f"{what}: largest creep", "1", float(np.abs(found["xi_x"]).max()))


NOTES = (
    "The source's measured speeds and creep force are not public; these are a truth model's with FASTSIM.",
    "The rig's own profiles are not public; the contact angle is given, not found from a lateral shift.",
)

ROW = Row(
    "rig_creep_force",
    "Speeds and creep force of the test rig by FASTSIM, with spin",
    "thesis 4.5, eq. 4.2, 4.3, Fig. 4.22 to 4.24",
    "testrig",
    CASES,
    rebuilt,
)
