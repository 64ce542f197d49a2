"""A controller that holds a speed by a limited braking torque: the partner of the test rig in a closed loop.

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


class SpeedController(Model):
    """Holds a wheel's speed by a torque request: proportional and integral, limited, without windup."""

    name = "SpeedController"
    step_size = 1e-3

    e_i = State("rad", doc="integral of the error", nominal=0.1)

    omega = Input("rad/s", doc="speed of the wheel", nominal=10.0)
    omega_set = Input("rad/s", doc="speed to hold", nominal=10.0)

    k_p = Parameter("N.m.s/rad", 500.0, min=1e-3, doc="proportional gain", source=CHOICE)
    k_i = Parameter("N.m/rad", 1000.0, min=0.0, doc="integral gain", source=CHOICE)
    T_max = Parameter("N.m", 852.0, min=0.0, doc="limit of the torque either way", source="thesis 4.5")

    T = Output("N.m", doc="torque request, braking positive", nominal=500.0)

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        asked = m._asked()
        # at the limit the integral gives way until what is asked for is just the limit
        return {"e_i": m.omega - m.omega_set + (m._limited(asked) - asked) / m.k_p}

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        return {"T": m._limited(m._asked())}

    def _asked(m) -> Expr:
        return m.k_p * (m.omega - m.omega_set) + m.k_i * m.e_i

    def _limited(m, torque: Expr) -> Expr:
        return cs.fmin(cs.fmax(torque, -m.T_max), m.T_max)
