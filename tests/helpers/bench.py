"""A bench for effects: a mass on a spring and a damper over a moving base, with something of every sort."""

from fmus.component import Component
from fmus.model import Model
from fmus.port import Port
from fmus.variables import Input, Parameter, State

MASS, STIFFNESS, DAMPING = 100.0, 4e4, 400.0


class Bench(Model):
    """m z_ddot = -k (z - u) - b (z_dot - u_dot) + F + F_ext."""

    name = "Bench"
    step_size = 1e-3
    z = State("m", doc="height", nominal=0.01)
    z_dot = State("m/s", doc="velocity", nominal=0.1)
    x = State("m", doc="place on the line", nominal=10.0)
    u = Input("m", doc="height of the base", nominal=0.01)
    u_dot = Input("m/s", doc="velocity of the base", nominal=0.1)
    V = Input("m/s", 20.0, min=0.0, doc="speed", nominal=10.0)
    F = Input("N", doc="force", nominal=100.0)
    F_ext = Input("N", doc="port: force on the mass", nominal=100.0)
    m = Parameter("kg", MASS, min=1.0, doc="mass")
    k = Parameter("N/m", STIFFNESS, min=0.0, doc="stiffness")
    b = Parameter("N.s/m", DAMPING, min=0.0, doc="damping")
    f0 = Parameter("N", 0.0, doc="0 = not given")
    law = Parameter("1", 1.0, doc="a choice", fixed=True)

    def derivatives(self):
        spring = self.k * (self.z - self.u) + self.b * (self.z_dot - self.u_dot)
        return {"z": self.z_dot, "z_dot": (self.F - spring + self.f0 + self.F_ext) / self.m, "x": self.V}

    def ports(self):
        return {
            "mass": Port(self.z, self.z_dot, {"F_ext": 1.0}),
            "base": Port(self.z - self.u, self.z_dot - self.u_dot, {"F_ext": 1.0}, place="turns"),
        }

    def components(self):
        return {"mount": Component(("k",), ("b",)), "spring": Component(("k",))}

    def groups(self):
        return {"mounting": ("k", "b")}
