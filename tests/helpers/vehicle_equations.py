"""The vehicle's equations by names: what its tests share."""

import casadi as cs
import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from fmus.model import equations
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from fmus.vehicle7dof.model import CORNERS, FORCES, Vehicle7dof
from tests.helpers.everything import start, values

MODEL = Vehicle7dof()
MADE = equations(MODEL)
STATES, INPUTS, PARAMETERS, OUTPUTS = (
    [v.name for v in MODEL.of(k)] for k in (State, Input, Parameter, Output)
)
P = dict(zip(PARAMETERS, start(MODEL, Parameter).tolist(), strict=True))
INERTIA = dict(zip(FORCES, ("m1", "J_y1", "J_x1", "m2", "J_x2", "m2", "J_x2"), strict=True))
SIDE = {"fl": 1, "fr": -1, "rl": 1, "rr": -1}  # y over its half width
END = {"fl": 1, "fr": 1, "rl": -1, "rr": -1}  # x over the distance of its bogie
BOGIE = {"fl": 2, "fr": 2, "rl": 3, "rr": 3}
each_corner = pytest.mark.parametrize("c", CORNERS)

small = st.floats(-1e-2, 1e-2)
motions = st.fixed_dictionaries(dict.fromkeys(STATES, small))
rails = st.fixed_dictionaries({f"u_{c}{end}": small for c in CORNERS for end in ("", "_dot")})
pushes = st.fixed_dictionaries({name: st.floats(-1e4, 1e4) for name in FORCES.values()})
healths = st.fixed_dictionaries(
    {f"h_{e}_{c}": st.floats(0.1, 3.0) for e in ("k1", "b1", "k2", "b2") for c in CORNERS}
)


def vectors(x, u, p):
    return (
        [x.get(n, 0.0) for n in STATES],
        [u.get(n, 0.0) for n in INPUTS],
        list((P | p).values()),
    )


def outputs(x=None, u=None, **parameters):
    """Outputs by name at states and inputs by name, those not given at 0."""
    return dict(zip(OUTPUTS, values(MADE.h, *vectors(x or {}, u or {}, parameters)), strict=True))


def accelerations(x=None, u=None, **parameters):
    """Accelerations by coordinate."""
    found = outputs(x, u, **parameters)
    return {q: found[f"{q}_ddot"] for q in FORCES}


def forces(x=None, u=None, **parameters):
    """Mass times acceleration by coordinate."""
    p = P | parameters
    return {q: a * p[INERTIA[q]] for q, a in accelerations(x, u, **parameters).items()}


def system(**parameters):
    """A, B of x' = A x + B u and C, D of the outputs."""
    x, u = (cs.SX.sym(n, len(names)) for n, names in (("x", STATES), ("u", INPUTS)))
    p = list((P | parameters).values())
    dot, y = MADE.f(x, u, p), MADE.h(x, u, p)
    parts = [cs.jacobian(of, by) for of in (dot, y) for by in (x, u)]
    return [np.array(m.full()) for m in cs.Function("parts", [x, u], parts)(0, 0)]


def settled(u, **parameters):
    """Coordinates at rest under constant inputs by name."""
    A, B, *_ = system(**parameters)
    x = np.linalg.solve(A, -B @ vectors({}, u, {})[1])
    return dict(zip(STATES, x.tolist(), strict=True))


def modes(**parameters):
    """Undamped frequency, Hz, and damping ratio of each mode, slowest first."""
    poles = np.linalg.eigvals(system(**parameters)[0])
    poles = sorted(poles[poles.imag > 0], key=abs)
    return np.array([(abs(s) / 2 / np.pi, -s.real / abs(s)) for s in poles]).T


def linear_run(t, u, names, **parameters):
    """Outputs (N, n) of the model from rest, exact for inputs that run linearly between even samples."""
    A, B, C, D = system(**parameters)
    states, shown = {n: i for i, n in enumerate(STATES)}, {n: i for i, n in enumerate(OUTPUTS)}
    C_y = np.array([np.eye(len(STATES))[states[n]] if n in states else C[shown[n]] for n in names])
    D_y = np.array([0 * D[0] if n in states else D[shown[n]] for n in names])
    A_d, B_d, C_d, D_d, _ = cont2discrete((A, B, C_y, D_y), t[1] - t[0], "foh")
    x, driven, y = np.zeros(len(A)), u @ B_d.T, u @ D_d.T
    for k in range(len(t)):
        y[k] += C_d @ x
        x = A_d @ x + driven[k]
    return y
