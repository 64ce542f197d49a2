"""Models made to be coupled: an oscillator of two masses in two parts, with its solution as a whole."""

from dataclasses import dataclass

import numpy as np

from fmus.model import Model
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)


class Sprung(Model):
    """A mass on its own spring, and the spring and damper to its neighbour: gives the force on that."""

    name = "Sprung"
    step_size = 1e-3

    x = State("m", doc="displacement", nominal=1.0)
    v = State("m/s", doc="velocity", nominal=1.0)
    x_other = Input("m", doc="displacement of the neighbour", nominal=1.0)
    v_other = Input("m/s", doc="velocity of the neighbour", nominal=1.0)
    F_ext = Input("N", doc="force from outside", nominal=1.0)
    m = Parameter("kg", 1.0, min=1e-3, doc="mass")
    k = Parameter("N/m", 20.0, doc="own stiffness")
    k_c = Parameter("N/m", 10.0, doc="stiffness to the neighbour")
    d_c = Parameter("N.s/m", 0.5, doc="damping to the neighbour")
    F = Output("N", doc="force on the neighbour")

    def derivatives(m):
        return {"x": m.v, "v": (m.F_ext - m.k * m.x - m._force()) / m.m}

    def outputs(m):
        return {"F": m._force()}

    def _force(m):
        return m.k_c * (m.x - m.x_other) + m.d_c * (m.v - m.v_other)


class Mass(Model):
    """A mass on a spring, pushed."""

    name = "Mass"
    step_size = 1e-3

    x = State("m", doc="displacement", nominal=1.0)
    v = State("m/s", doc="velocity", nominal=1.0)
    F = Input("N", doc="force", nominal=1.0)
    m = Parameter("kg", 2.0, min=1e-3, doc="mass")
    k = Parameter("N/m", 30.0, doc="stiffness")
    fixed = Parameter("1", 1.0, fixed=True, doc="a parameter that cannot change in a run")

    def derivatives(m):
        return {"x": m.v, "v": (m.F - m.k * m.x) / m.m}


class Pair(Model):
    """Two outputs, each of which follows one of two inputs at once, above a constant."""

    name = "Pair"
    step_size = 1e-2

    x = State("1", doc="constant")
    u1 = Input("1", doc="first input")
    u2 = Input("1", doc="second input")
    y1 = Output("1", doc="first output")
    y2 = Output("1", doc="second output")

    def derivatives(m):
        return {"x": 0 * m.x}

    def outputs(m):
        return {"y1": 2 * m.u1 + m.x, "y2": 3 * m.u2 + m.x}


COUPLED = [("a.F", "b.F"), ("b.x", "a.x_other"), ("b.v", "a.v_other")]
STATES = ["a.x", "a.v", "b.x", "b.v"]
START = {"a.x": 1.0, "a.v": 0.0, "b.x": -0.5, "b.v": 0.3}


@dataclass(frozen=True)
class Whole:
    """The two parts as one system, x' = A x."""

    m1: float = 1.0
    k1: float = 20.0
    k_c: float = 10.0
    d_c: float = 0.5
    m2: float = 2.0
    k2: float = 30.0

    @property
    def A(self):
        """(4, 4)"""
        s, d = self.k_c, self.d_c
        return np.array(
            [
                [0, 1, 0, 0],
                [-(self.k1 + s) / self.m1, -d / self.m1, s / self.m1, d / self.m1],
                [0, 0, 0, 1],
                [s / self.m2, d / self.m2, -(self.k2 + s) / self.m2, -d / self.m2],
            ]
        )

    def solved(self, t, x0=None):
        """States (n, 4) at times t (n,), from START or a state (4,)."""
        x0 = np.array([START[n] for n in STATES]) if x0 is None else x0
        rates, modes = np.linalg.eig(self.A)
        return ((np.exp(np.outer(t, rates)) * np.linalg.solve(modes, x0)) @ modes.T).real

    def energy(self, x):
        """(n,), of states (n, 4)."""
        x1, v1, x2, v2 = np.asarray(x).T
        kinetic = self.m1 * v1**2 + self.m2 * v2**2
        return (kinetic + self.k1 * x1**2 + self.k2 * x2**2 + self.k_c * (x1 - x2) ** 2) / 2
