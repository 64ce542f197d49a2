"""A carriage on a line moved by a motor: the example of a model from outside, used through its FMU alone.

Made for the public benchmark EMPS (Janot, Gautier, Brunot 2019) without the effects that its record
shows: a drive as a supplier would send it, mass and viscous friction only.
"""

from fmus.model import Model
from fmus.port import Port
from fmus.variables import (
    Expr,
    Input,
    Parameter,
    State,
    rate,
)


class Drive(Model):
    """M q_ddot = F - F_v q_dot + F_ext."""

    name = "Drive"
    step_size = 1e-3

    q = State("m", doc="position of the carriage", nominal=0.1)
    q_dot = State("m/s", doc="velocity of the carriage", nominal=0.1)
    F = Input("N", doc="motor force", nominal=100.0)
    F_ext = Input("N", doc="port: force on the carriage", nominal=10.0)
    M = Parameter("kg", 95.0, min=1e-3, doc="mass, with the motor's inertia reflected")
    F_v = Parameter("N.s/m", 200.0, min=0.0, doc="viscous friction")
    q_ddot = rate(q_dot, "m/s2", "acceleration of the carriage")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        return {"q": m.q_dot, "q_dot": (m.F - m.F_v * m.q_dot + m.F_ext) / m.M}

    def ports(m) -> dict[str, Port]:
        """The carriage on its line."""
        return {"carriage": Port(m.q, m.q_dot, {"F_ext": 1.0})}
