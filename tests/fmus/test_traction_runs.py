"""Runs of the driven wheelset's FMU: as the truth runs, to a stop and at rest, with effects built in."""

from dataclasses import replace

import numpy as np
import pytest
from fmpy import simulate_fmu
from numpy.testing import assert_allclose

from fmus.effects import EFFECTS
from fmus.export.builders.native.build import build_native
from fmus.host.fmu import Fmu
from fmus.traction.model import V_MIN, Traction
from fmus.variables import State
from tests.helpers.native import native
from tests.helpers.traction import MODEL, SAME, STATES, P, rolling
from tests.truth import traction as truth


def run(path, t, names, first, **inputs):
    """Free run of an FMU: named outputs (N, n), inputs (N,) held at the mean of both ends of a step."""
    held = {name: (u[1:] + u[:-1]) / 2 for name, u in inputs.items()}
    with Fmu(path) as fmu:
        return fmu.simulate(t, held, names, first)


SEEN = ("omega_left", "omega_right", "omega_m", "V")
ENCODERS = np.array([1e-2, 1e-2, 5e-2, 2e-2])  # rad/s, m/s: noise of a record


@pytest.mark.parametrize("friction", [(0.46, 0.4, 0.6), (0.2, 0.1, 0.2)], ids=["dry", "poor"])
def test_it_runs_as_the_truth_through_slip_and_back(friction):
    mu0, A, B = friction
    t = np.arange(1501) * 1e-3
    limit = mu0 * 2 * P["F_n"] * P["r0"] / P["i_g"]
    T_m = limit * np.interp(t, [0, 0.5, 0.9, 1.0, 1.1, 1.5], [0, 0.8, 1.1, 1.1, 0.2, 0.2])
    rails = {"y": 2e-3 * np.sin(6 * t), "y_dot": 12e-3 * np.cos(6 * t), "psi": 1e-3 * np.cos(6 * t),
             "psi_dot": -6e-3 * np.sin(6 * t)}  # fmt: skip
    p = replace(truth.Traction(), mu0=mu0, A=A, B=B)
    expected = truth.simulate(truth.Inputs(t, {"T_m": T_m, **rails}), p, truth.rolling(p, 10.0))[:, 4:]
    first = {n: v for n, v in rolling(10.0).items() if v} | {"mu0": mu0, "A": A, "B": B, **SAME}
    found = run(native("traction"), t, SEEN, first, T_m=T_m, **rails)
    assert np.abs(expected[:, 0] * P["r0"] / expected[:, 3] - 1).max() > 0.01  # it slips
    assert (np.sqrt(np.mean((found - expected) ** 2, axis=0)) / ENCODERS).max() < 0.1


def test_it_brakes_to_a_stop_and_stays_there():
    t = np.arange(7001) * 1e-3
    first = {n: v for n, v in rolling(10.0).items() if v}
    V, omega = run(native("traction"), t, ("V", "omega_left"), first, T_b=np.full_like(t, 8e3)).T
    slowed = 2 * 8e3 / P["r0"] / (P["M_v"] + (128 + 70) / P["r0"] ** 2)
    assert_allclose(V[2000], 10 - 2 * slowed, rtol=5e-3)
    moving = V > V_MIN  # then the shafts spring back a little
    assert not moving[np.argmin(moving) :].any()
    assert np.diff(V[moving]).max() < 0
    assert abs(V[-1]) < 1e-6
    assert abs(omega[-1]) < 1e-6


def test_a_braked_wheelset_stands_on_a_slope():
    t = np.arange(2001) * 1e-3
    slope = np.full_like(t, -0.03 * 9.81 * P["M_v"])
    V, F_x = run(native("traction"), t, ("V", "F_x"), {}, T_b=np.full_like(t, 8e3), F_x_ext=slope).T
    assert_allclose(F_x[-500:].mean(), -slope[0], rtol=1e-3)  # the contacts carry it
    assert -2e-4 < V[-500:].min() <= V[-500:].max() < 0


@pytest.mark.parametrize("drawn", [0.0, 4e3], ids=["level", "slope"])
def test_cvode_follows_it_to_a_stop(drawn):
    """Model exchange by another solver, through the contact's and the brake's change at standstill."""
    start = {"V": 1.0, "omega_left": 2.0, "T_b": 8e3, "F_x_ext": -drawn}
    common = {"start_values": start, "stop_time": 1.0, "output_interval": 0.01, "output": STATES}
    stepped = simulate_fmu(str(native("traction")), fmi_type="CoSimulation", **common)
    solved = simulate_fmu(
        str(native("traction")), fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-9, **common
    )
    nominal = np.array([v.nominal for v in MODEL.of(State)])
    a, b = (np.array([list(row)[1:] for row in run]) / nominal for run in (stepped, solved))
    assert abs(a[-1, -1]) < 1e-4  # it stands
    assert_allclose(a, b, atol=100 * MODEL.tolerance)


def test_nothing_moves_at_rest_without_torque():
    t = np.linspace(0, 1, 101)
    assert np.abs(run(native("traction"), t, SEEN, {}, T_m=np.zeros_like(t))).max() == 0.0


def test_dampers_as_effects_are_dampers_as_parameters(tmp_path):
    places = {"axle": "c_s", "drive": "c_g"}
    built = build_native(Traction([(EFFECTS["viscous_damping"], place) for place in places]), tmp_path)
    t = np.arange(201) * 1e-3
    # on a patch so small that it hardly holds
    first = {n: v for n, v in rolling(20.0).items() if v} | {"theta_s": 1e-3, "theta_g": 3e-4, "a": 1e-6}
    names = ("theta_s", "theta_g", "omega_m")
    T_m = np.full_like(t, 2e3)
    for place, parameter in places.items():
        by_effect = run(built, t, names, {**first, f"viscous_damping_{place}_c": 400.0}, T_m=T_m)
        by_parameter = run(native("traction"), t, names, {**first, parameter: P[parameter] + 400.0}, T_m=T_m)
        without = run(native("traction"), t, names, first, T_m=T_m)
        assert_allclose(by_effect, by_parameter, rtol=1e-6, atol=1e-9)
        assert np.abs(without - by_parameter)[:, 0].max() > 1e-5
