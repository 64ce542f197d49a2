"""The driven wheelset's equations by name, and states of it: what its tests share."""

from fmus.model import equations
from fmus.traction.model import Traction
from fmus.variables import Input, Output, Parameter, State
from tests.helpers.everything import start, values

MODEL = Traction()
MADE = equations(MODEL)
STATES, INPUTS, PARAMETERS, OUTPUTS = (
    [v.name for v in MODEL.of(k)] for k in (State, Input, Parameter, Output)
)
P = dict(zip(PARAMETERS, start(MODEL, Parameter).tolist(), strict=True))
U = dict(zip(INPUTS, start(MODEL, Input).tolist(), strict=True))
SAME = {"nu": 0.25}  # the truth's column of Kalker's table


def rolling(V, left=0.0, right=0.0, motor=0.0, **others):
    """A state at speed V, m/s, the wheels and the motor turning faster by shares of it."""
    omega = V / P["r0"]
    own = {"V": V, "omega_left": omega * (1 + left)}
    between = {"theta_s_dot": omega * (right - left), "theta_g_dot": omega * (motor - right)}
    return {**dict.fromkeys(STATES, 0.0), **own, **between, **others}


def turning(x):
    """Speeds of both wheels and the motor at a state, rad/s."""
    right = x["omega_left"] + x["theta_s_dot"]
    return {
        "omega_left": x["omega_left"],
        "omega_right": right,
        "omega_m": P["i_g"] * (right + x["theta_g_dot"]),
    }


def spinning_up(dx):
    """Accelerations of both wheels and the motor from the states' rates, rad/s2."""
    right = dx["omega_left"] + dx["theta_s_dot"]
    return {
        "omega_left": dx["omega_left"],
        "omega_right": right,
        "omega_m": P["i_g"] * (right + dx["theta_g_dot"]),
    }


def at(function, x, inputs=None, parameters=None):
    """Results of f or h by name."""
    point = list(x.values()), list((U | (inputs or {})).values()), list((P | (parameters or {})).values())
    names = STATES if function is MADE.f else OUTPUTS
    return dict(zip(names, values(function, *point), strict=True))
