"""The laws of all effects a second time, with NumPy alone: what tests compare the library with."""

import numpy as np

RISE = 0.02


def begun(t, p):
    """0 before t0, 1 after, a cubic over T_r in between."""
    s = np.clip((t - p["t0"]) / p.get("T_r", RISE) + 0.5, 0, 1)
    return 1.0 if p["t0"] == 0 else 3 * s**2 - 2 * s**3


def friction(v, v_s):
    return np.sign(v) * (1 - 2 / (np.exp(np.minimum(2 * np.abs(v) / v_s, 700)) + 1))


# force at a port by time, way, displacement, velocity, parameters and states
FORCES = {
    "constant_force": lambda t, x, q, v, p: -p["F_0"],
    "step_force": lambda t, x, q, v, p: -p["F_0"] * begun(t, p),
    "coulomb_friction": lambda t, x, q, v, p: -p["F_c"] * friction(v, p["v_s"]),
    "stribeck_friction": lambda t, x, q, v, p: (
        -(p["F_c"] + p["F_b"] * np.exp(-np.minimum(v * v / p["v_b"] ** 2, 700))) * friction(v, p["v_s"])
    ),
    "viscous_damping": lambda t, x, q, v, p: -p["c"] * v,
    "quadratic_damping": lambda t, x, q, v, p: -p["c"] * v * v * np.sign(v),
    "cubic_stiffness": lambda t, x, q, v, p: -p["k_3"] * q * q * q,
    "bump_stop": lambda t, x, q, v, p: (
        -p["k"]
        * (
            (q - p["gap"] if q > p["gap"] and p["side"] >= 0 else 0)
            + (q + p["gap"] if q < -p["gap"] and p["side"] <= 0 else 0)
        )
    ),
    "free_play": lambda t, x, q, v, p: p["k"] * np.clip(q, -p["gap"], p["gap"]),
    "hysteresis": lambda t, x, q, v, p: -np.clip(p["Z"], -p["F_h"], p["F_h"]),
    "periodic_force": lambda t, x, q, v, p: (
        np.hypot(p["F_sin"], p["F_cos"]) * np.sin(p["order"] * q + np.arctan2(p["F_cos"], p["F_sin"]))
    ),
    "harmonic_excitation": lambda t, x, q, v, p: (
        np.hypot(p["F_sin"], p["F_cos"])
        * np.sin(2 * np.pi * (p["f"] * t + p.get("n_x", 0.0) * x) + np.arctan2(p["F_cos"], p["F_sin"]))
    ),
    "flexible_mode": lambda t, x, q, v, p: (
        (2 * np.pi * p["f"]) ** 2 * p["e"] + 4 * np.pi * p["f"] * p["D"] * (p["P"] - p["m"] * (v - p["v_0"]))
    ),
}


def bouc_wen(q, v, p):
    """Rate of the force of a spring that slips, by the usual form with z of unit size."""
    z = np.clip(p["Z"] / p["F_h"], -1, 1)
    n, beta, gamma = p["n"], p["beta"], 1 - p["beta"]
    z_dot = (v - beta * abs(v) * z * abs(z) ** (n - 1) - gamma * v * abs(z) ** n) / p["q_y"]
    return p["F_h"] * z_dot


# rates of states at a port
RATES = {
    "hysteresis": {"Z": bouc_wen},
    "flexible_mode": {
        "e": lambda q, v, p: p["P"] - p["m"] * (v - p["v_0"]),
        "P": lambda q, v, p: -FORCES["flexible_mode"](0, 0, q, v, p),
    },
}

# value of a parameter by time
PARAMETERS = {
    "parameter_offset": lambda t, value, p: value + p["delta"],
    "parameter_step": lambda t, value, p: value + p["delta"] * begun(t, p),
    "parameter_drift": lambda t, value, p: value + p["rate"] * t,
    "stiffness_change": lambda t, value, p: value * (1 + p["change"] * begun(t, p)),
    "damping_change": lambda t, value, p: value * (1 + p["change"] * begun(t, p)),
}
