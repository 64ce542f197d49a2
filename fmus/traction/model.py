"""Torsional wheelset under traction and braking: two wheels, axle, gearbox, motor and the speed of travel.

Equations, symbols and range of validity: README.md beside this file.
"""

from functools import cached_property

import casadi as cs

from fmus.component import Component
from fmus.contact.forces.coefficients import coefficients
from fmus.contact.forces.conditions import PARAMETERS
from fmus.contact.forces.friction import CRITICAL, friction_coefficient
from fmus.contact.forces.laws.law import Creep
from fmus.contact.forces.laws.polach_no_spin import PolachNoSpin
from fmus.model import Model
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

MAL = "Mal et al. 2020, Table 1"
DRY = "Mal et al. 2020, Table 3, dry"
CHOICE = "this model"
V_MIN = 0.01  # m/s, rounds the speed of travel near standstill, where creepage has no limit
W_MIN = 1e-9  # m/s, rounds the slip speed at zero
OMEGA_MIN = 1e-3  # rad/s, within which the friction brake changes its direction
SIDES = ("left", "right")
SIGN = {"left": 1.0, "right": -1.0}  # of y there


class Traction(Model):
    """Torsional wheelset with gearbox and motor: rotation, torsion and speed under traction and braking."""

    name = "Traction"
    step_size = 1e-4
    method = "rodas4"

    # speeds between the parts are states, not differences of two large ones
    theta_left = State("rad", doc="angle of the left wheel", nominal=100.0)
    theta_s = State("rad", doc="twist of the axle, right wheel less left wheel", nominal=1e-3)
    theta_g = State("rad", doc="twist of the drive, motor over the ratio less right wheel", nominal=1e-3)
    x = State("m", doc="distance travelled", nominal=100.0)
    omega_left = State("rad/s", doc="speed of the left wheel", nominal=10.0)
    theta_s_dot = State("rad/s", doc="rate of the axle's twist", nominal=0.5)
    theta_g_dot = State("rad/s", doc="rate of the drive's twist", nominal=0.5)
    V = State("m/s", doc="speed of travel", nominal=10.0)

    T_m = Input("N.m", doc="torque of the motor, traction positive", nominal=1e3)
    T_b = Input("N.m", min=0.0, doc="torque of the friction brake of each wheel, against its rotation",
                nominal=1e3)  # fmt: skip
    y = Input("m", doc="lateral displacement of the wheelset", nominal=1e-3)
    psi = Input("rad", doc="yaw of the wheelset", nominal=1e-3)
    y_dot = Input("m/s", doc="lateral velocity of the wheelset", nominal=0.02)
    psi_dot = Input("rad/s", doc="yaw rate of the wheelset", nominal=0.02)
    y_irr = Input("m", doc="lateral alignment of the track", nominal=1e-3, on_track=OnTrack("alignment"))
    dr_left = Input("m", doc="growth of the left rolling radius beside that of the cone", nominal=1e-3)
    dr_right = Input("m", doc="growth of the right rolling radius beside that of the cone", nominal=1e-3)
    T_m_ext = Input("N.m", doc="port: torque on the motor", nominal=100.0)
    T_left_ext = Input("N.m", doc="port: torque on the left wheel", nominal=1e3)
    T_right_ext = Input("N.m", doc="port: torque on the right wheel", nominal=1e3)
    F_x_ext = Input("N", doc="port: longitudinal force on the vehicle", nominal=1e3)

    I_left = Parameter("kg.m2", 64.0, min=1e-3, doc="rolling inertia of the left wheel", source=MAL)
    I_right = Parameter("kg.m2", 64.0, min=1e-3, doc="rolling inertia of the right wheel", source=MAL)
    J_m = Parameter(
        "kg.m2", 2.8, min=1e-6, doc="inertia of the motor", source=f"{MAL}: I_R = I_right + i_g^2 J_m = 134"
    )
    i_g = Parameter("1", 5.0, min=1e-3, doc="ratio of the gearbox, motor over wheel", source=CHOICE)
    k_s = Parameter("N.m/rad", 6063260.0, min=0.0, doc="torsional stiffness of the axle", source=MAL)
    c_s = Parameter("N.m.s/rad", 0.0, min=0.0, doc="torsional damping of the axle", source=f"{MAL}: left out")
    k_g = Parameter("N.m/rad", 2e7, min=0.0, doc="torsional stiffness of the drive, at the axle",
                    source=CHOICE)  # fmt: skip
    c_g = Parameter("N.m.s/rad", 500.0, min=0.0, doc="torsional damping of the drive, at the axle",
                    source=CHOICE)  # fmt: skip
    M_v = Parameter("kg", 15000.0, min=1.0, doc="mass that the wheelset moves", source=MAL)
    F_n = Parameter("N", 79.7e3, min=1.0, doc="normal force in each contact", source=f"{MAL}: M_v and m_w")
    r0 = Parameter("m", 0.5, min=0.05, doc="rolling radius of the centred wheel", source=MAL)
    lambda_w = Parameter("1", 0.15, min=0.0, doc="conicity of the wheels, 0 for cylinders", source=MAL)
    s = Parameter("m", 0.75, min=0.05, doc="half the distance of the contacts", source=MAL)
    a = Parameter("m", 7.0e-3, min=1e-6, doc="contact semi-axis along rolling", source="Hertz, see README")
    b = Parameter("m", 5.0e-3, min=1e-6, doc="contact semi-axis across rolling", source="Hertz, see README")
    mu0 = Parameter(
        "1", 0.46, min=1e-4, max=2.0, doc="friction coefficient at no slip", source=DRY, alarm_below=CRITICAL
    )
    A = Parameter("1", 0.4, min=0.0, max=1.0, doc="limit over maximum friction", source=DRY)
    B = Parameter("s/m", 0.6, min=0.0, doc="decrease of friction with slip speed", source=DRY)
    k_A = Parameter("1", 1.0, min=0.0, doc="Polach factor in the area of adhesion", source=DRY)
    k_S = Parameter("1", 1.0, min=0.0, doc="Polach factor in the area of slip", source=DRY)
    G = Parameter("Pa", 80e9, min=1e6, doc="shear modulus of steel", source="Kalker 1990")
    nu = Parameter("1", 0.28, min=0.0, max=0.5, doc="Poisson's ratio of steel", source="Kalker 1990")

    omega_left_dot = rate(omega_left, "rad/s2", "angular acceleration of the left wheel")
    theta_s_ddot = rate(theta_s_dot, "rad/s2", "acceleration of the axle's twist")
    theta_g_ddot = rate(theta_g_dot, "rad/s2", "acceleration of the drive's twist")
    V_dot = rate(V, "m/s2", "acceleration of the vehicle")
    omega_right = Output("rad/s", doc="speed of the right wheel", nominal=10.0)
    omega_m = Output("rad/s", doc="speed of the motor", nominal=50.0)
    T_s = Output("N.m", doc="torsional torque of the axle, from the right to the left wheel", nominal=1e3)
    T_g = Output("N.m", doc="torque of the drive on the right wheel", nominal=1e3)
    # vars() of a class body is its namespace: what both wheels have is written once
    vars().update(
        {
            f"{name}_{side}": Output(unit, doc=f"{what} of the {side} wheel", nominal=nominal)
            for side in SIDES
            for name, unit, what, nominal in (
                ("F_x", "N", "longitudinal creep force", 1e3),
                ("F_y", "N", "lateral creep force", 1e3),
                ("xi_x", "1", "longitudinal creepage", 1e-3),
                ("xi_y", "1", "lateral creepage", 1e-3),
                ("r", "m", "rolling radius", 1.0),
            )
        }
    )
    F_x = Output("N", doc="tractive force, creep forces of both wheels along the track", nominal=1e3)
    F_y = Output("N", doc="lateral creep force on the wheelset", nominal=1e3)
    M_z = Output("N.m", doc="yaw moment of the creep forces on the wheelset", nominal=1e3)
    f_adhesion = Output("1", doc="adhesion F_x/(2 F_n)")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives (Mal et al. 2020, eq. 14 to 17, the motor on a gearbox)."""
        T_s, T_g = m._torques()
        F_x_left, F_x_right = (m._contacts[side][0] for side in SIDES)
        torque_left = T_s + m._outside("left")
        torque_right = T_g - T_s + m._outside("right")
        torque_m = m.T_m - T_g / m.i_g + m.T_m_ext
        left, right = torque_left / m.I_left, torque_right / m.I_right
        return {
            "theta_left": m.omega_left,
            "theta_s": m.theta_s_dot,
            "theta_g": m.theta_g_dot,
            "x": m.V,
            "omega_left": left,
            "theta_s_dot": right - left,
            "theta_g_dot": torque_m / m.J_m / m.i_g - right,
            "V": (F_x_left + F_x_right + m.F_x_ext) / m.M_v,
        }

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        T_s, T_g = m._torques()
        found: dict[str, Expr] = {"T_s": T_s, "T_g": T_g}
        found |= {"omega_right": m._omega("right"), "omega_m": m._omega_m}
        for side in SIDES:
            F_x, F_y = m._contacts[side]
            xi_x, xi_y = m._creepages(side)
            found |= {f"F_x_{side}": F_x, f"F_y_{side}": F_y, f"r_{side}": m._radius(side)}
            found |= {f"xi_x_{side}": xi_x, f"xi_y_{side}": xi_y}
        (left_x, left_y), (right_x, right_y) = m._contacts["left"], m._contacts["right"]
        found["F_x"] = left_x + right_x
        found["F_y"] = left_y + right_y + (left_x + right_x) * m.psi
        found["M_z"] = m.s * (right_x - left_x)
        return found | {"f_adhesion": (left_x + right_x) / (2 * m.F_n)}

    def ports(m) -> dict[str, Port]:
        """Motor, wheels, vehicle; axle and drive between them; the contacts (slip of wheel over rail)."""
        right = m.theta_left + m.theta_s
        turned = {"left": (m.theta_left, m.omega_left), "right": (right, m._omega("right"))}
        wheels: dict[str, Port] = {}
        contacts: dict[str, Port] = {}
        for side, (angle, speed) in turned.items():
            own = f"T_{side}_ext"
            wheels[f"wheel_{side}"] = Port(angle, speed, {own: 1.0}, "rotation", "turns")
            contacts[f"contact_{side}"] = Port(
                m.r0 * angle - m.x, m.r0 * speed - m.V, {own: m.r0, "F_x_ext": -1.0}, place="slips"
            )
        motor = m.i_g * (right + m.theta_g)
        return {
            **wheels,
            "motor": Port(motor, m._omega_m, {"T_m_ext": 1.0}, "rotation", "turns"),
            "vehicle": Port(m.x, m.V, {"F_x_ext": 1.0}, place="slips"),
            "axle": Port(m.theta_s, m.theta_s_dot, {"T_right_ext": 1.0, "T_left_ext": -1.0}, "rotation"),
            "drive": Port(m.theta_g, m.theta_g_dot, {"T_m_ext": 1 / m.i_g, "T_right_ext": -1.0}, "rotation"),
            **contacts,
        }

    def components(m) -> dict[str, Component]:
        """Torsional springs and dampers of axle and drive."""
        return {"axle": Component(("k_s",), ("c_s",)), "drive": Component(("k_g",), ("c_g",))}

    def groups(m) -> dict[str, tuple[str, ...]]:
        """What a change of the rail's surface changes together."""
        return {"friction_condition": PARAMETERS}

    def _omega(m, side: str) -> Expr:
        """Speed of a wheel."""
        return m.omega_left if side == "left" else m.omega_left + m.theta_s_dot

    @property
    def _omega_m(m) -> Expr:
        """Speed of the motor."""
        return m.i_g * (m._omega("right") + m.theta_g_dot)

    def _torques(m) -> tuple[Expr, Expr]:
        """Torques of the axle and of the drive."""
        return m.k_s * m.theta_s + m.c_s * m.theta_s_dot, m.k_g * m.theta_g + m.c_g * m.theta_g_dot

    def _outside(m, side: str) -> Expr:
        """Torque on a wheel by its contact, its brake and its port."""
        brake = m.T_b * cs.tanh(m._omega(side) / OMEGA_MIN)
        port = m.T_left_ext if side == "left" else m.T_right_ext
        return port - brake - m._radius(side) * m._contacts[side][0]

    def _radius(m, side: str) -> Expr:
        return m.r0 + SIGN[side] * m.lambda_w * (m.y - m.y_irr) + (m.dr_left, m.dr_right)[SIDES.index(side)]

    def _creepages(m, side: str) -> tuple[Expr, Expr]:
        """Longitudinal and lateral creepage (Mal et al. 2020, eq. 1, 2 and 5, before they are simplified)."""
        V = cs.hypot(m.V, V_MIN)
        along = m.V - m._radius(side) * m._omega(side) - SIGN[side] * m.s * m.psi_dot
        return along / V, (m.y_dot - m.V * m.psi) / V

    @cached_property
    def _contacts(m) -> dict[str, tuple[Expr, Expr]]:
        """Longitudinal and lateral creep force of each wheel."""
        kalker = coefficients(m.a / m.b, m.nu)
        found = {}
        for side in SIDES:
            xi_x, xi_y = m._creepages(side)
            w = cs.sqrt((xi_x**2 + xi_y**2) * (m.V**2 + V_MIN**2) + W_MIN**2)
            mu = friction_coefficient(w, m.mu0, m.A, m.B)
            creep = Creep(m.a, m.b, m.F_n, mu, m.G, kalker, xi_x, xi_y, 0.0, m.k_A, m.k_S)
            F_x, F_y, _ = PolachNoSpin().forces(creep)
            found[side] = (F_x, F_y)
        return found
