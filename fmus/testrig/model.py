"""Tram wheel on a roller, driven by a PMSM and an asynchronous motor (thesis 3.5.3).

Equations, symbols and range of validity: README.md beside this file.
"""

import casadi as cs

from fmus.contact.forces.coefficients import coefficients
from fmus.contact.forces.friction import CRITICAL, friction_coefficient
from fmus.contact.forces.laws.polach import creep_force, stress_gradient
from fmus.model import Model
from fmus.port import Port
from fmus.variables import (
    Expr,
    Input,
    Output,
    Parameter,
    State,
    rate,
)

V_MIN = 0.01  # m/s, rounds the rolling speed near standstill, where creepage has no limit
W_MIN = 1e-9  # m/s, rounds the slip speed at zero
VOLTAGE_FLOOR = 1e-9  # Ohm2 rad2/s2, keeps the motor torque finite at zero frequency


class Testrig(Model):
    """Tram wheel on a roller, two motors: rotation of wheel and roller."""

    __test__ = False  # not a test class, whatever its name begins with
    name = "Testrig"
    step_size = 5e-3
    method = "rodas3"

    omega_w = State("rad/s", doc="wheel speed", nominal=10.0)
    omega_r = State("rad/s", doc="roller speed", nominal=10.0)
    theta_w = State("rad", doc="wheel angle", nominal=100.0)
    theta_r = State("rad", doc="roller angle", nominal=100.0)

    T_P = Input("N.m", doc="torque request of the PMSM, braking positive", nominal=500.0)
    f_sync = Input("Hz", 7.5, min=0.0, doc="supply frequency of the asynchronous motor at constant V/f")
    T_w_ext = Input("N.m", doc="port: torque on the wheel", nominal=100.0)
    T_r_ext = Input("N.m", doc="port: torque on the roller", nominal=100.0)

    J_w = Parameter("kg.m2", 17.86, min=1e-6, doc="wheel side inertia", source="thesis 3.5.3.2")
    J_r = Parameter("kg.m2", 47.2, min=1e-6, doc="roller side inertia", source="thesis 3.5.3.2")
    r_w = Parameter("m", 0.3482, min=1e-3, doc="rolling radius of the wheel", source="thesis 4.6.4")
    r_r = Parameter("m", 0.45215, min=1e-3, doc="rolling radius of the roller", source="thesis 4.1")
    N = Parameter("N", 8000.0, min=1.0, doc="normal force", source="thesis 4.5")
    a = Parameter("m", 0.0027, min=1e-6, doc="contact semi-axis along rolling", source="thesis 4.5")
    b = Parameter("m", 0.0027, min=1e-6, doc="contact semi-axis across rolling", source="thesis 4.5")
    mu0 = Parameter(
        "1", 0.4, min=1e-4, max=2.0, doc="friction coefficient at no slip", source="thesis 4.5",
        alarm_below=CRITICAL,
    )  # fmt: skip
    A = Parameter("1", 0.4, min=0.0, max=1.0, doc="limit over maximum friction", source="thesis 4.5")
    B = Parameter("s/m", 0.6, min=0.0, doc="decrease of friction with slip speed", source="thesis 4.5")
    k_A = Parameter("1", 1.0, min=0.0, doc="Polach factor in the area of adhesion", source="thesis Table 4.1")
    k_S = Parameter("1", 0.4, min=0.0, doc="Polach factor in the area of slip", source="thesis Table 4.1")
    G = Parameter("Pa", 80e9, min=1e6, doc="shear modulus of steel", source="Kalker 1990")
    nu = Parameter("1", 0.28, min=0.0, max=0.5, doc="Poisson's ratio of steel", source="Kalker 1990")
    V_Th = Parameter(
        "V", 212.3438, min=0.0, doc="Thevenin voltage per phase at f_nom", source="thesis Fig. 3.17"
    )
    R_Th = Parameter("Ohm", 0.0226, min=0.0, doc="Thevenin resistance per phase", source="thesis Fig. 3.17")
    X_Th = Parameter("Ohm", 0.2007, min=0.0, doc="Thevenin reactance at f_nom", source="thesis Fig. 3.17")
    X_2 = Parameter("Ohm", 0.3010, min=0.0, doc="rotor reactance at f_nom", source="thesis Fig. 3.17")
    R_2 = Parameter("Ohm", 0.0181, min=1e-6, doc="rotor resistance, reflected", source="thesis Fig. 3.17")
    pole_pairs = Parameter("1", 5.0, min=1.0, doc="pole pairs", source="torque at 595.2 rpm", fixed=True)
    f_nom = Parameter("Hz", 50.0, min=1e-3, doc="frequency of the reactances", source="thesis Fig. 3.17")

    omega_w_dot = rate(omega_w, "rad/s2", "angular acceleration of the wheel")
    omega_r_dot = rate(omega_r, "rad/s2", "angular acceleration of the roller")
    F_x = Output("N", doc="longitudinal creep force, opposing xi_x", nominal=1000.0)
    xi_x = Output("1", doc="longitudinal creepage (V_r - V_w)/V_r")
    T_A = Output("N.m", doc="torque of the asynchronous motor", nominal=500.0)
    f_adhesion = Output("1", doc="adhesion F_x/N")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        F_x = m._creep_force()
        return {
            "omega_w": (-m.T_P - F_x * m.r_w + m.T_w_ext) / m.J_w,
            "omega_r": (m._motor_torque() + F_x * m.r_r + m.T_r_ext) / m.J_r,
            "theta_w": m.omega_w,
            "theta_r": m.omega_r,
        }

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        F_x = m._creep_force()
        return {"F_x": F_x, "xi_x": m._creepage(), "T_A": m._motor_torque(), "f_adhesion": F_x / m.N}

    def ports(m) -> dict[str, Port]:
        """Shafts of wheel and roller, and the contact (slip of the wheel's surface over the roller's)."""
        return {
            "wheel": Port(m.theta_w, m.omega_w, {"T_w_ext": 1.0}, "rotation", "turns"),
            "roller": Port(m.theta_r, m.omega_r, {"T_r_ext": 1.0}, "rotation", "turns"),
            "contact": Port(
                m.r_w * m.theta_w - m.r_r * m.theta_r,
                m.r_w * m.omega_w - m.r_r * m.omega_r,
                {"T_w_ext": m.r_w, "T_r_ext": -m.r_r},
                place="slips",
            ),
        }

    def _creepage(m) -> Expr:
        V_r, V_w = m.r_r * m.omega_r, m.r_w * m.omega_w
        return (V_r - V_w) / cs.hypot(V_r, V_MIN)

    def _creep_force(m) -> Expr:
        xi_x = m._creepage()
        w = cs.hypot(m.r_r * m.omega_r - m.r_w * m.omega_w, W_MIN)
        s = w / cs.hypot(m.r_r * m.omega_r, V_MIN)
        mu = friction_coefficient(w, m.mu0, m.A, m.B)
        c11 = coefficients(m.a / m.b, m.nu).c11
        eps = stress_gradient(s, m.a, m.b, c11, mu * m.N, m.G)
        return -creep_force(eps, mu * m.N, m.k_A, m.k_S) * xi_x / s

    def _motor_torque(m) -> Expr:
        omega_syn = 2 * cs.pi * m.f_sync / m.pole_pairs
        slip_speed = omega_syn - m.omega_r  # the slip times omega_syn, so that standstill is no special case
        flux = m.f_sync / m.f_nom  # voltage and reactances fall with the frequency
        R = m.R_Th * slip_speed + m.R_2 * omega_syn
        X = flux * (m.X_Th + m.X_2) * slip_speed
        return 3 * (flux * m.V_Th) ** 2 * m.R_2 * slip_speed / (R**2 + X**2 + VOLTAGE_FLOOR)
