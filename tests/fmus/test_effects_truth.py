"""Effects in the test rig's FMU against the rig written a second time, with scipy and without the library."""

import numpy as np
import pytest

from fmus.effects import parse_effect
from fmus.export.builders.pythonfmu import build_python
from fmus.host.fmu import Fmu
from fmus.models import model_class
from tests.truth.rig_effects import TYPICAL, single
from tests.truth.rig_inputs import Inputs, torque_profile
from tests.truth.rig_motion import simulate, steady_state

NOISE = 0.002  # rad/s, of the shared records: what differs by less cannot be seen in them
FORCES = ["wheel", "roller"]
PARAMETERS = {  # of an effect in the FMU, from the truth's own words
    "constant_force": lambda e: {"F_0": e["constant"]},
    "step_force": lambda e: {"F_0": -e["step"], "t0": 8.0},
    "coulomb_friction": lambda e: {"F_c": e["coulomb"], "v_s": 0.05},
    "stribeck_friction": lambda e: {
        "F_c": e["coulomb"],
        "F_b": e["stribeck"],
        "v_b": e["stribeck_speed"],
        "v_s": 0.05,
    },
    "viscous_damping": lambda e: {"c": e["viscous"]},
    "quadratic_damping": lambda e: {"c": e["quadratic"]},
    "periodic_force": lambda e: {
        "F_sin": e["periodic"] * np.cos(e["periodic_phase"]),
        "F_cos": e["periodic"] * np.sin(e["periodic_phase"]),
        "order": e["periodic_order"],
    },
    "harmonic_excitation": lambda e: {"F_sin": e["harmonic"], "f": e["harmonic_frequency"]},
    "actuator_gain": lambda e: {"gain": e["gain"] - 1},
    "actuator_lag": lambda e: {"share": 1.0, "T": e["lag"]},
    "actuator_saturation": lambda e: {"share": 1.0, "limit": e["limit"]},
    "input_delay": lambda e: {"share": 1.0, "T": e["delay"]},
    "parameter_step": lambda e: {"delta": e["mu0_step"], "t0": 8.0},
}
TIMES = {"step_force": {"step_time": 8.0}, "parameter_step": {"mu0_step_time": 8.0}}
WHERE = {"parameter_step": ["mu0"], **{k: ["T_P"] for k in PARAMETERS if k.startswith(("actuator", "input"))}}
CASES = [(kind, at) for kind in PARAMETERS for at in WHERE.get(kind, FORCES)]
# a delay by its approximation: what it leaves of the corners of a trapezium
SEEN = {"input_delay": 0.2}


@pytest.mark.parametrize(("kind", "location"), CASES, ids=str)
def test_an_effect_in_the_fmu_moves_the_rig_as_the_truth_says(kind, location, tmp_path):
    t = np.arange(1601) / 100
    T_P = torque_profile(t, np.random.default_rng(7))
    T_P *= 600.0 / np.abs(T_P).max()  # N.m, near what the contact can carry
    inputs = Inputs(t, T_P, np.full_like(t, 9.0))
    x0 = steady_state(inputs)
    true = np.column_stack(simulate(inputs, effects=single(kind, location, **TIMES.get(kind, {})), x0=x0))
    without = np.column_stack(simulate(inputs, x0=x0))
    effect = parse_effect(f"{kind}@{location}")
    start = {effect[0].name_at(location, n): v for n, v in PARAMETERS[kind](TYPICAL[kind]).items()}
    start |= {"omega_w": x0[0], "omega_r": x0[1]}
    u = {"T_P": (T_P[1:] + T_P[:-1]) / 2, "f_sync": np.full(len(t) - 1, 9.0)}
    with Fmu(build_python(model_class("testrig")([effect]), tmp_path)) as fmu:
        found = fmu.simulate(t, u, ["omega_w", "omega_r"], start)
    assert np.abs(true - without).max() > 10 * NOISE  # the case shows
    rms = np.sqrt(np.mean((found - true) ** 2))
    assert rms < SEEN.get(kind, 0.1) * NOISE, rms / NOISE
