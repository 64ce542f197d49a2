"""Plan-view wheelset with a laterally suspended mass, on straight track (thesis 3.5.1).

Equations, symbols and range of validity: README.md beside this file.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, replace
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import casadi as cs

from fmus.component import Component
from fmus.contact.forces.coefficients import looked_up
from fmus.contact.forces.conditions import CONDITIONS, PARAMETERS
from fmus.contact.forces.friction import CRITICAL, friction_coefficient
from fmus.contact.forces.laws import LAWS, law_codes, selected_law
from fmus.contact.forces.laws.polach import Polach
from fmus.effects.effect import Effect
from fmus.model import Model
from fmus.option import Choice
from fmus.port import Port
from fmus.variables import (
    Expr,
    Input,
    OnTrack,
    Output,
    Parameter,
    State,
    rate,
)
from fmus.wheelset.curves import (
    FIELDS,
    LOAD,
    NU,
    PATCH,
    G,
    both_contacts,
    usual_patch,
)
from fmus.wheelset.track import OPTIONS, Track

TABLE = "thesis Table 3.4"
DRY = CONDITIONS["dry"]
SURFACE = "thesis Table 4.1, dry"
CHOICE = "this model"
FORM = "this model: what methods for the patch differ in"
V_MIN = 0.1  # m/s, below which creepages are those at this speed
S_MIN = 1e-12  # rounds the size of the creepage at zero
SIDES = ("left", "right")
SIGN = cs.DM([1.0, -1.0])  # of y there


class Wheels(NamedTuple):
    """What acts on both wheels, and their motion over the rails; creep forces in the contacts' own axes.

    Columns of two, left and right: so a compiler works them out at once.
    """

    F_x: Expr
    F_y: Expr
    M_z: Expr
    xi_x: Expr
    xi_y: Expr
    xi_s: Expr
    r: Expr
    delta: Expr
    a: Expr
    b: Expr


def patch_scale(load: Expr, shear: Expr, nu: Expr) -> Expr:
    """Size of a patch over the tabulated one, by load, N, shear modulus, Pa, and Poisson's ratio.

    It grows with the cube root of load over stiffness E / (1 - nu²) = 2 G / (1 - nu).
    """
    return (load / LOAD * (G / (1 - NU)) / (shear / (1 - nu))) ** (1 / 3)


def powers_of(n: int) -> cs.Function:
    """Function (n numbers > 0, exponent) -> their powers; in one call, for one test of exponent 1."""
    base, exponent = cs.MX.sym("base", n), cs.MX.sym("exponent")
    return cs.Function("powers", [base, exponent], [base**exponent])


class Wheelset(Model):
    """Plan-view wheelset with a laterally suspended mass: lateral and yaw motion on straight track."""

    name = "Wheelset"
    step_size = 1e-3
    form = MappingProxyType({"k_a": (0.5, 1.6), "k_b": (0.6, 2.6), "k_c": (0.0, 1.5), "k_spin": (0.2, 1.2)})
    form_choices = MappingProxyType({"patch": (0.0, 1.0)})
    form_alike = ("G", "nu")
    form_error = 0.02
    method = "rk4_within_stability"
    build_options = OPTIONS

    y = State("m", doc="lateral displacement of the wheelset", nominal=1e-3)
    psi = State("rad", doc="yaw of the wheelset", nominal=1e-3)
    y_dot = State("m/s", doc="lateral velocity of the wheelset", nominal=0.02)
    psi_dot = State("rad/s", doc="yaw rate of the wheelset", nominal=0.02)
    y_m = State("m", doc="lateral displacement of the suspended mass", nominal=1e-3)
    y_m_dot = State("m/s", doc="lateral velocity of the suspended mass", nominal=0.02)

    y_irr = Input(
        "m", doc="lateral alignment of the track, mean of both rails", nominal=1e-3,
        on_track=OnTrack("alignment"),
    )  # fmt: skip
    y_irr_dot = Input(
        "m/s", doc="rate of the alignment along the run", nominal=0.02,
        on_track=OnTrack("alignment", rate=True),
    )  # fmt: skip
    gauge_irr = Input("m", doc="gauge widening", nominal=1e-3, on_track=OnTrack("gauge"))
    V = Input("m/s", 40.0, min=0.0, doc="speed of travel", nominal=1.0, on_track=OnTrack("speed"))
    F_y_ext = Input("N", doc="port: lateral force on the wheelset", nominal=1e3)
    M_z_ext = Input("N.m", doc="port: yaw moment on the wheelset", nominal=1e3)
    F_ym_ext = Input("N", doc="port: lateral force on the suspended mass", nominal=1e3)

    r0 = Parameter("m", 0.46, min=0.05, doc="nominal rolling radius", source=TABLE)
    s = Parameter("m", 0.75, min=0.05, doc="half the distance of the tape circles", source=TABLE)
    F_n = Parameter("N", 55e3, min=1.0, doc="wheel load", source=TABLE)
    d = Parameter("m", 1.0, min=0.0, doc="half the distance of the suspension's centres", source=TABLE)
    m_w = Parameter("kg", 1813.0, min=1.0, doc="mass of the wheelset", source=TABLE)
    m_m = Parameter("kg", 6241.0, min=1.0, doc="suspended mass", source=TABLE)
    I_wy = Parameter("kg.m2", 112.0, min=0.0, doc="rolling inertia of the wheelset", source=TABLE)
    I_wz = Parameter("kg.m2", 1120.0, min=1.0, doc="yaw inertia of the wheelset", source=TABLE)
    G = Parameter("Pa", G, min=1e6, doc="shear modulus of wheel and rail", source=TABLE)
    nu = Parameter("1", NU, min=0.0, max=0.5, doc="Poisson's ratio of wheel and rail", source="Kalker 1990")
    k_y = Parameter("N/m", 2e6, min=0.0, doc="lateral stiffness of the primary suspension", source=TABLE)
    k_x = Parameter("N/m", 4e6, min=0.0, doc="longitudinal stiffness of the suspension", source=TABLE)
    b_y = Parameter("N.s/m", 1e3, min=0.0, doc="lateral damping of the suspension", source=TABLE)
    b_x = Parameter("N.s/m", 1e3, min=0.0, doc="longitudinal damping of the suspension", source=TABLE)
    mu0 = Parameter(
        "1", DRY["mu0"], min=1e-4, max=2.0, doc="friction coefficient at no slip", source=SURFACE,
        alarm_below=CRITICAL,
    )  # fmt: skip
    A = Parameter("1", DRY["A"], min=0.0, max=1.0, doc="limit over maximum friction", source=SURFACE)
    B = Parameter("s/m", DRY["B"], min=0.0, doc="decrease of friction with slip velocity", source=SURFACE)
    k_A = Parameter("1", DRY["k_A"], min=0.0, doc="Polach factor in the area of adhesion", source=SURFACE)
    k_S = Parameter("1", DRY["k_S"], min=0.0, doc="Polach factor in the area of slip", source=SURFACE)
    k_a = Parameter(
        "1", 1.0, min=0.1, max=10.0, doc="semi-axes a of the contacts over the table's", source=FORM
    )
    k_b = Parameter(
        "1", 1.0, min=0.1, max=10.0, doc="semi-axes b of the contacts over the table's", source=FORM
    )
    k_c = Parameter(
        "1", 1.0, min=0.0, max=2.0, source=FORM,
        doc="how far the contacts' semi-axes follow the shift: 1 as the table's, 0 their means",
    )  # fmt: skip
    k_spin = Parameter("1", 1.0, min=0.0, max=10.0, doc="spin coefficients over Kalker's", source=FORM)
    f11 = Parameter("N", min=0.0, doc="longitudinal creep coefficient, 0: Kalker's", source=CHOICE)
    f22 = Parameter("N", min=0.0, doc="lateral creep coefficient, 0: Kalker's", source=CHOICE)
    f23 = Parameter("N.m", min=0.0, doc="lateral creep coefficient of spin, 0: Kalker's", source=CHOICE)
    f33 = Parameter("N.m2", min=0.0, doc="moment creep coefficient of spin, 0: Kalker's", source=CHOICE)
    creep_law = Parameter(
        "1", float(Polach.code), min=0.0, max=len(LAWS) - 1.0, doc=law_codes(), source=CHOICE, fixed=True
    )
    contact_search = Parameter(
        "1", 1.0, min=0.0, max=1.0, doc="0 rigid, 1 quasi-elastic", source=CHOICE, fixed=True
    )
    patch = Parameter(
        "1", 0.0, min=0.0, max=1.0, doc="0 Hertz, 1 virtual penetration", source=CHOICE, fixed=True
    )

    y_ddot = rate(y_dot, "m/s2", "lateral acceleration of the wheelset")
    psi_ddot = rate(psi_dot, "rad/s2", "yaw acceleration of the wheelset")
    y_m_ddot = rate(y_m_dot, "m/s2", "lateral acceleration of the suspended mass")
    # vars() of a class body is its namespace: what both wheels have is written once
    vars().update(
        {
            f"{name}_{side}": Output(unit, doc=f"{what} of the {side} wheel", nominal=nominal)
            for side in SIDES
            for name, unit, what, nominal in (
                ("F_x", "N", "longitudinal creep force", 1e3),
                ("F_y", "N", "lateral creep force", 1e3),
                ("M_z", "N.m", "spin moment", 10.0),
                ("xi_x", "1", "longitudinal creepage", 1e-3),
                ("xi_y", "1", "lateral creepage", 1e-3),
                ("xi_s", "1/m", "spin creepage", 0.1),
                ("r", "m", "rolling radius", 1.0),
                ("delta", "rad", "contact angle", 0.1),
                ("a", "m", "semi-axis of the contact along rolling", 1e-2),
                ("b", "m", "semi-axis of the contact across rolling", 1e-2),
            )
        }
    )
    phi = Output("rad", doc="roll of the wheelset", nominal=1e-4)
    flange_contact = Output("1", doc="1 where a flange touches: beyond it the model is not valid")

    def __init__(
        self,
        effects: Iterable[tuple[type[Effect], str]] = (),
        probes: bool = False,
        track: Track = Track(),  # noqa: B008  frozen
        **options: Choice,
    ) -> None:
        """effects, probes: see Model; track: the profiles and how they stand, or by options."""
        if options:
            track = Track.parse(**{**asdict(track), **options})
        self.track = track
        super().__init__(effects, probes, **asdict(track))
        for name, start in (("r0", track.nominal_radius), ("s", track.half_distance)):
            self.variables[name] = replace(self.variables[name], start=start)
        search = self.variables["contact_search"]
        self.variables["contact_search"] = replace(search, doc=f"{search.doc}; {track}")

    @property
    def about(self) -> str:
        """What is built in, in one line."""
        return f"Plan-view wheelset with a laterally suspended mass on straight track; {self.track}."

    def notes(self) -> list[str]:
        """See Model.notes."""
        return self.track.notes

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        F_y, M_z = m._contact_forces()
        F_Sy = -2 * m.k_y * (m.y - m.y_m) - 2 * m.b_y * (m.y_dot - m.y_m_dot)
        M_Sz = -2 * m.d**2 * (m.k_x * m.psi + m.b_x * m.psi_dot)
        Omega = m.V / m.r0
        return {
            "y": m.y_dot,
            "psi": m.psi_dot,
            "y_dot": (F_y + F_Sy + m.F_y_ext) / m.m_w,
            "psi_dot": (M_z + M_Sz - m.I_wy * Omega * m._roll[1] + m.M_z_ext) / m.I_wz,
            "y_m": m.y_m_dot,
            "y_m_dot": (-F_Sy + m.F_ym_ext) / m.m_m,
        }

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        from fmus.contact.geometry.search import FLANGE_ANGLE  # loads SciPy, which other models do without

        found = {
            f"{name}_{side}": both[i]
            for name, both in m._wheels._asdict().items()
            for i, side in enumerate(SIDES)
        }
        steepest = cs.mmax(m._wheels.delta)
        return {**found, "phi": m._roll[0], "flange_contact": steepest > FLANGE_ANGLE}

    def ports(m) -> dict[str, Port]:
        """Wheelset and suspended mass on their coordinates, the suspension between them, the contact."""
        return {
            "wheelset_lateral": Port(m.y, m.y_dot, {"F_y_ext": 1.0}),
            "wheelset_yaw": Port(m.psi, m.psi_dot, {"M_z_ext": 1.0}, "rotation"),
            "primary_lateral": Port(m.y - m.y_m, m.y_dot - m.y_m_dot, {"F_y_ext": 1.0, "F_ym_ext": -1.0}),
            "primary_yaw": Port(m.psi, m.psi_dot, {"M_z_ext": 1.0}, "rotation"),
            "suspended_mass": Port(m.y_m, m.y_m_dot, {"F_ym_ext": 1.0}),
            "contact": Port(m.y - m.y_irr, m.y_dot - m.y_irr_dot, {"F_y_ext": 1.0}),
        }

    def components(m) -> dict[str, Component]:
        """Primary suspension, lateral and longitudinal."""
        return {
            "primary_lateral": Component(("k_y",), ("b_y",)),
            "primary_yaw": Component(("k_x",), ("b_x",)),
        }

    def groups(m) -> dict[str, tuple[str, ...]]:
        """What a change of the rail's surface changes together.

        The scales of the model's form are means over the forces and creepages that occur, so that they change
        with the friction.
        """
        return {"friction_condition": (*PARAMETERS, *m.form)}

    @cached_property
    def _curves(m) -> dict[str, Expr]:
        """Contact of both wheels at their shifts towards their flanges, by the fields of the curves."""
        shifts = SIGN * (m.y - m.y_irr) - m.gauge_irr / 2
        (contacts,) = m.call(both_contacts(m.track), m.contact_search, shifts)
        return dict(zip(FIELDS, cs.horzsplit(contacts), strict=True))

    @cached_property
    def _roll(m) -> tuple[Expr, Expr]:
        """Roll of the wheelset and its rate: both wheels carry their sides over the tape distance."""
        per_base = 1 / (2 * m.track.half_distance)
        lift, slope = m._curves["lift"], m._curves["lift_slope"]
        rate_of_shift = m.y_dot - m.y_irr_dot
        return (lift[0] - lift[1]) * per_base, (slope[0] + slope[1]) * rate_of_shift * per_base

    @cached_property
    def _usual(m) -> dict[str, list[Expr]]:
        """Semi-axes a and b, m, of the usual shifts at the tabulated load, each with its reciprocal."""
        found = [
            dict(zip(PATCH, cs.horzsplit(columns), strict=True))
            for columns in m.call(usual_patch(m.track), m.contact_search)
        ]
        return {which: [m._by_patch(one, which) for one in found] for which in ("a", "b")}

    def _by_patch(m, at: dict[str, Expr], which: str) -> Expr:
        """Semi-axis a or b of the patch that is chosen."""
        return cs.if_else(m.patch > 0.5, at[f"{which}_virtual"], at[f"{which}_hertz"])

    @cached_property
    def _wheels(m) -> Wheels:
        """Creepages (eq. 3.100, 3.101, with spin over V once) and creep forces of both wheels."""
        growth, delta = m._curves["growth"], m._curves["delta"]
        r = m.r0 + growth
        V = cs.fmax(m.V, V_MIN)
        # a choice, as CasADi makes quotients of products with a plain reciprocal, which cost more
        per_V = cs.if_else(m.V > V_MIN, 1 / V, 1 / V_MIN)
        rolls = m.V * per_V  # 1, but towards standstill
        xi_x = -(rolls / m.r0) * growth - SIGN * (m.s * per_V) * m.psi_dot
        xi_y = m.y_dot * per_V + r * (m._roll[1] * per_V) - rolls * m.psi
        xi_s = m.psi_dot * per_V - SIGN * (rolls / m.r0) * delta
        a, b = m._semi_axes
        mu = friction_coefficient(V * cs.sqrt(xi_x**2 + xi_y**2 + S_MIN**2), m.mu0, m.A, m.B)
        c11, c22, c23, c33 = m.call(looked_up(), a, b, m.nu)
        F_x, F_y, M_z = m.call(
            selected_law(),
            m.creep_law, a, b, m.F_n, mu, m.G, c11, c22, m.k_spin * c23, m.k_spin * c33, xi_x, xi_y, xi_s,
            m.k_A, m.k_S, m.f11, m.f22, m.f23, m.f33,
        )  # fmt: skip
        return Wheels(F_x, F_y, M_z, xi_x, xi_y, xi_s, r, delta, a, b)

    @cached_property
    def _semi_axes(m) -> list[Expr]:
        """a and b as tabulated for the load, or between that and their means over the usual shifts."""
        usual = m._usual
        scale = patch_scale(m.F_n, m.G, m.nu)
        factors = (m.k_a * scale * usual["a"][0], m.k_b * scale * usual["b"][0])
        ratios = cs.vertcat(
            *(m._by_patch(m._curves, which) * per_mean for which, (_, per_mean) in usual.items())
        )
        (powers,) = m.call(powers_of(ratios.numel()), ratios, m.k_c)
        return [k * power for k, power in zip(factors, cs.vertsplit(powers, len(SIDES)), strict=True)]

    def _contact_forces(m) -> tuple[Expr, Expr]:
        """Lateral force and yaw moment of both contacts (eq. 3.93 to 3.96, 3.102, 3.103)."""
        phi, w = m._roll[0], m._wheels
        slope = w.delta + SIGN * phi  # of the contact planes over the track
        across = w.F_y * cs.cos(slope)
        F_x = w.F_x - across * m.psi
        F_y = w.F_x * m.psi + across - SIGN * m.F_n * cs.sin(slope)
        R_y = SIGN * m.s + w.r * phi
        R_x = -R_y * m.psi
        M = R_x * F_y - R_y * F_x + w.M_z * cs.cos(slope)
        return cs.sum1(F_y), cs.sum1(M)
