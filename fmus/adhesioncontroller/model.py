"""A controller that keeps the creep of a driven wheelset at the peak of adhesion, wherever this lies.

Equations and symbols: README.md beside this file.
"""

import casadi as cs

from fmus.model import Model
from fmus.variables import (
    Expr,
    Input,
    Output,
    Parameter,
    State,
)

CHOICE = "this model"
MAL = "Mal et al. 2020, Table 1"
TORQUE_MIN = 100.0  # N.m, rounds the load torque by which its swing is divided, and where the limit begins
SQUARE_MIN = 1e-12  # of the creep, keeps the slope's rate finite without a swing


class AdhesionController(Model):
    """Keeps the creep of a driven wheelset at the peak of adhesion by swinging it: extremum seeking."""

    name = "AdhesionController"
    step_size = 1e-3
    method = "rodas4"

    omega_f = State("rad/s", doc="motor speed, filtered", nominal=50.0)
    T_f = State("N.m", doc="motor torque, filtered", nominal=1e3)
    xi_f = State("1", doc="creep, filtered like the load torque", nominal=1e-3)
    T_0 = State("N.m", doc="mean of the load torque", nominal=1e3)
    xi_0 = State("1", doc="mean of the creep", nominal=1e-3)
    load_slope = State("1", doc="relative slope of the load torque over the creep", nominal=100.0)
    xi_set = State("1", 0.005, doc="creep at which the torque is limited", nominal=1e-3)
    phi = State("rad", doc="phase of the swing", nominal=10.0)

    omega_m = Input("rad/s", doc="speed of the motor", nominal=50.0)
    V = Input("m/s", doc="speed of travel", nominal=10.0)
    T_demand = Input("N.m", min=0.0, doc="torque that the driver demands", nominal=1e3)

    r0 = Parameter("m", 0.5, min=0.05, doc="rolling radius", source=MAL)
    i_g = Parameter("1", 5.0, min=1e-3, doc="ratio of the gearbox, motor over wheel", source=CHOICE)
    J = Parameter("kg.m2", 7.92, min=1e-6, doc="inertia of motor, axle and wheels at the motor",
                  source=f"{MAL}: (I_R + I_L)/i_g^2")  # fmt: skip
    k_p = Parameter(
        "N.m.s/rad", 200.0, min=0.0, doc="gain of the speed that limits the torque", source=CHOICE
    )
    omega_o = Parameter("rad/s", 100.0, min=0.1, doc="corner of the filters of load torque and creep",
                        source=CHOICE)  # fmt: skip
    omega_h = Parameter("rad/s", 5.0, min=0.01, doc="corner above which the swing counts", source=CHOICE)
    omega_c = Parameter("rad/s", 7.0, min=0.01, doc="rate at which the slope is learnt", source=CHOICE)
    f_d = Parameter("Hz", 2.0, min=0.01, doc="frequency of the swing", source=CHOICE)
    xi_d = Parameter("1", 0.001, min=0.0, doc="amplitude of the swing", source=CHOICE)
    xi_s = Parameter("1", 0.2, min=1e-6, doc="creep over which the relative slope counts as steep",
                     source=CHOICE)  # fmt: skip
    k_e = Parameter("1/s", 0.01, min=0.0, doc="fastest change of the creep at which torque is limited",
                    source=CHOICE)  # fmt: skip
    xi_min = Parameter("1", 0.001, min=1e-6, doc="least creep at which torque is limited", source=CHOICE)
    xi_max = Parameter("1", 0.1, min=1e-6, doc="largest creep at which torque is limited", source=CHOICE)
    V_min = Parameter("m/s", 1.0, min=1e-3, doc="speed below which creep is slip over this speed",
                      source=CHOICE)  # fmt: skip

    T = Output("N.m", doc="torque request of the motor, traction positive", nominal=1e3)
    T_limit = Output("N.m", doc="torque that holds the creep at its limit", nominal=1e3)
    T_load = Output("N.m", doc="load torque at the motor, observed", nominal=1e3)
    xi = Output("1", doc="creep of the wheels by the motor's speed, traction positive", nominal=1e-3)
    limiting = Output("1", doc="1 where the controller limits the torque that is demanded")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        swing_T, swing_xi = m._load() - m.T_0, m.xi_f - m.xi_0
        missed = swing_T / cs.hypot(m.T_0, TORQUE_MIN) - m.load_slope * swing_xi
        steep = m.load_slope * m.xi_s
        uphill = m.k_e * steep / cs.hypot(1, steep) * m._room()
        return {
            "omega_f": m.omega_o * (m.omega_m - m.omega_f),
            "T_f": m.omega_o * (m._torque() - m.T_f),
            "xi_f": m.omega_o * (m._creep() - m.xi_f),
            "T_0": m.omega_h * swing_T,
            "xi_0": m.omega_h * swing_xi,
            "load_slope": m.omega_c * swing_xi * missed / (swing_xi**2 + m.xi_d**2 / 2 + SQUARE_MIN),
            # what the driver does to the torque says nothing of the peak
            "xi_set": uphill * m._limited(),
            "phi": 2 * cs.pi * m.f_d,
        }

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        return {
            "T": m._torque(),
            "T_limit": m._limit(),
            "T_load": m._load(),
            "xi": m._creep(),
            "limiting": m._limiting(),
        }

    def _speed(m) -> Expr:
        return cs.fmax(m.V, m.V_min)

    def _creep(m) -> Expr:
        return (m.omega_m * m.r0 / m.i_g - m.V) / m._speed()

    def _load(m) -> Expr:
        """Load torque: what the motor's torque did not turn into acceleration."""
        return m.T_f - m.J * m.omega_o * (m.omega_m - m.omega_f)

    def _room(m) -> Expr:
        """Share of its fastest change that the creep's limit has left between its bounds."""
        above = (m.xi_max - m.xi_set) / (m.xi_max + cs.fabs(m.xi_set))
        below = (m.xi_set - m.xi_min) / (m.xi_min + cs.fabs(m.xi_set))
        return above * below

    def _limit(m) -> Expr:
        """Torque that holds the creep at its limit, which swings."""
        xi = m.xi_set + m.xi_d * cs.sin(m.phi)
        omega = (m.V + xi * m._speed()) * m.i_g / m.r0
        return m._load() + m.k_p * (omega - m.omega_m)

    def _limited(m) -> Expr:
        """How far the torque is limited, 0 to 1: half where the limit is what the driver demands."""
        over = (m.T_demand - m._limit()) / TORQUE_MIN
        return (1 + over / cs.hypot(1, over)) / 2

    def _limiting(m) -> Expr:
        return m._limit() < m.T_demand

    def _torque(m) -> Expr:
        return cs.fmin(cs.fmax(m._limit(), 0), m.T_demand)
