"""The test rig: motor and contact against the literature, energy, standstill, and the independent truth."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.host.fmu import Fmu
from fmus.model import equations
from fmus.testrig.model import Testrig
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from tests.helpers.everything import start, values
from tests.truth.rig import (
    Inputs,
    Rig,
    frequency_profile,
    simulate,
    torque_profile,
)

RIG = Testrig()
MADE = equations(RIG)
STATES, INPUTS, PARAMETERS, OUTPUTS = ([v.name for v in RIG.of(k)] for k in (State, Input, Parameter, Output))
P = dict(zip(PARAMETERS, start(RIG, Parameter).tolist(), strict=True))
rim_speeds = st.floats(-15.0, 15.0)  # m/s


def outputs(omega_w=0.0, omega_r=0.0, T_P=0.0, f_sync=0.0, **parameters):
    """Outputs by name at a state and inputs."""
    p = list((P | parameters).values())
    return dict(zip(OUTPUTS, values(MADE.h, [omega_w, omega_r, 0, 0], [T_P, f_sync, 0, 0], p), strict=True))


def at_rims(V_r, V_w, **parameters):
    """Outputs at rim speeds, m/s."""
    return outputs(V_w / P["r_w"], V_r / P["r_r"], **parameters)


def torque(f_sync, omega_r):
    return outputs(omega_r=omega_r, f_sync=f_sync)["T_A"]


def runs(path, t, names=("omega_w", "omega_r"), first=None, **inputs):
    """Free run of an FMU: named outputs (N, n), inputs (N,) held at the mean of both ends of a step."""
    held = {name: (u[1:] + u[:-1]) / 2 for name, u in inputs.items()}
    with Fmu(path) as fmu:
        return fmu.simulate(t, held, names, first or {})


def test_motor_has_the_pull_out_of_its_circuit():
    synchronous = 2 * np.pi * 50 / 5
    slips = np.linspace(0.03, 0.042, 1201)
    torques = [torque(50.0, synchronous * (1 - s)) for s in slips]
    assert_allclose(max(torques), 2051, rtol=1e-3)
    assert_allclose(slips[np.argmax(torques)], 0.03604, rtol=1e-3)


def test_motor_at_its_working_point():
    # the circuit gives 889.9 N.m; 595.2 rpm is given to 0.1 of 4.8 rpm slip, so 891 is known to 2 %
    assert_allclose(torque(50.0, 595.2 * 2 * np.pi / 60), 891, rtol=2e-3)


@given(st.floats(0.5, 50.0), st.floats(-0.5, 2.0).filter(lambda s: abs(s) > 1e-3))
def test_motor_is_the_thevenin_circuit_at_constant_v_over_f(f, s):
    k, synchronous = f / P["f_nom"], 2 * np.pi * f / P["pole_pairs"]
    resistance, reactance = P["R_Th"] + P["R_2"] / s, k * (P["X_Th"] + P["X_2"])
    expected = 3 / synchronous * (k * P["V_Th"]) ** 2 * P["R_2"] / s / (resistance**2 + reactance**2)
    # the floor that keeps the torque finite at no supply takes 5e-5 of it at 0.5 Hz
    assert_allclose(torque(f, synchronous * (1 - s)), expected, rtol=1e-4)


@given(st.floats(0.0, 50.0), st.floats(-70.0, 70.0))
def test_motor_pulls_towards_its_synchronous_speed(f, omega_r):
    T_A = torque(f, omega_r)
    assert np.isfinite(T_A)
    assert T_A * (2 * np.pi * f / P["pole_pairs"] - omega_r) >= 0


@given(st.floats(-70.0, 70.0))
def test_motor_without_supply_gives_nothing(omega_r):
    assert torque(0.0, omega_r) == 0.0


@given(rim_speeds, rim_speeds, st.floats(0.01, 0.8))
def test_contact_takes_energy_and_stays_within_friction(V_r, V_w, mu0):
    F_x = at_rims(V_r, V_w, mu0=mu0)["F_x"]
    assert F_x * (V_w - V_r) >= 0  # J_w omega_w_dot = -F_x r_w: the force brakes a wheel that runs ahead
    assert abs(F_x) <= mu0 * P["N"]


@given(rim_speeds, st.floats(0.0, 10.0))
def test_contact_is_symmetric_in_the_sign_of_slip_and_of_rolling(V, slip):
    F_x = at_rims(V, V + slip)["F_x"]
    # 1e-6 N: rim speeds go through the radii and lose their last digits
    assert_allclose(at_rims(V, V - slip)["F_x"], -F_x, rtol=1e-6, atol=1e-2)
    assert_allclose(at_rims(-V, -V - slip)["F_x"], -F_x, rtol=1e-6, atol=1e-2)


@given(rim_speeds, rim_speeds)
def test_creepage_has_the_sign_of_its_definition(V_r, V_w):
    seen = at_rims(V_r, V_w)
    assert seen["xi_x"] * (V_r - V_w) >= 0
    assert seen["F_x"] * seen["xi_x"] <= 0
    assert seen["f_adhesion"] == pytest.approx(seen["F_x"] / P["N"])
    if V_r > 1:  # the speed that rounds the creepage at rest is no longer seen, to 1e-4
        assert_allclose(seen["xi_x"], (V_r - V_w) / V_r, rtol=1e-4, atol=1e-12)


def test_small_creepage_gives_kalkers_linear_force():
    creepage, c11 = 1e-7, 4.2262  # Kalker 1990 at a/b = 1, nu = 0.28
    linear = -P["G"] * P["a"] * P["b"] * c11 * creepage * (P["k_A"] + P["k_S"]) / 2
    assert_allclose(at_rims(4.0, 4.0 * (1 - creepage))["F_x"], linear, rtol=1e-3)


def test_friction_falls_to_its_limit_at_high_slip():
    F_x = at_rims(20.0, 0.0)["F_x"]
    assert_allclose(abs(F_x), P["A"] * P["mu0"] * P["N"], rtol=0.01)


def test_equations_of_motion():
    seen = outputs(12.0, 9.4, T_P=200.0, f_sync=7.5)
    assert_allclose(P["J_w"] * seen["omega_w_dot"], -200.0 - seen["F_x"] * P["r_w"])
    assert_allclose(P["J_r"] * seen["omega_r_dot"], seen["T_A"] + seen["F_x"] * P["r_r"])


def ramp(t, *knots):
    return np.interp(t, *zip(*knots, strict=True))


@pytest.mark.parametrize("dt", [0.005, 0.02, 0.1])
def test_starts_from_standstill_to_30_km_h(built, dt):
    t = np.arange(round(35 / dt) + 1) * dt
    f_sync = ramp(t, (0, 0.0), (1, 0.0), (25, 15.0))
    speeds = runs(built("testrig"), t, T_P=np.zeros_like(t), f_sync=f_sync)
    assert np.abs(speeds[t <= 1]).max() == 0.0
    assert np.diff(speeds, axis=0).min() > -1e-4  # the motor comes to its speed without a rebound
    V_w, V_r = speeds[-1] * [P["r_w"], P["r_r"]]
    assert_allclose([V_w, V_r], 2 * np.pi * 15 / 5 * P["r_r"], rtol=1e-4)
    assert_allclose(V_r * 3.6, 30, rtol=0.03)


@pytest.mark.parametrize("T_P", [300.0, -300.0])
def test_starts_from_standstill_against_and_with_the_wheel_motor(built, T_P):
    dt = 0.01
    t = np.arange(round(30 / dt) + 1) * dt
    f_sync, T = ramp(t, (0, 0.0), (20, 15.0)), ramp(t, (0, 0.0), (5, 0.0), (5.5, T_P))
    names = ("omega_w", "omega_r", "F_x")
    omega_w, omega_r, F_x = runs(built("testrig"), t, names, T_P=T, f_sync=f_sync).T
    assert min(omega_w.min(), omega_r.min()) > -1e-3
    assert np.abs(F_x).max() <= P["mu0"] * P["N"]
    V_w, V_r = omega_w[-1] * P["r_w"], omega_r[-1] * P["r_r"]
    assert np.sign(V_r - V_w) == np.sign(T_P)  # a braked wheel runs behind the roller
    assert_allclose(F_x[-1], -T_P / P["r_w"], rtol=1e-3)


def test_torque_at_rest_without_supply_turns_both_together(built):
    t = np.linspace(0, 2, 201)
    omega_w, omega_r = runs(built("testrig"), t, T_P=np.full_like(t, -50.0), f_sync=np.zeros_like(t)).T
    ratio = P["r_r"] / P["r_w"]
    slope = 50.0 * ratio / (P["J_r"] + P["J_w"] * ratio**2)
    assert_allclose(omega_r[-1], slope * t[-1], rtol=2e-3)  # the creepage parts them by some 1e-4
    assert_allclose(omega_w, ratio * omega_r, rtol=2e-3, atol=1e-3)


def test_reverse_rotation_is_the_mirror_image(built):
    t = np.linspace(0, 3, 301)
    still, pulse = np.zeros_like(t), 200 * np.sin(2 * t)
    x0 = {"omega_w": 13.0, "omega_r": 10.0}
    ahead = runs(built("testrig"), t, first=x0, T_P=pulse, f_sync=still)
    back = runs(built("testrig"), t, first={k: -v for k, v in x0.items()}, T_P=-pulse, f_sync=still)
    assert_allclose(back, -ahead, rtol=1e-9)


def test_motor_turns_a_roller_that_runs_backwards(built):
    t = np.linspace(0, 30, 3001)
    x0 = {"omega_w": -12.98, "omega_r": -10.0}
    speeds = runs(built("testrig"), t, first=x0, T_P=np.zeros_like(t), f_sync=np.full_like(t, 7.5))
    assert np.diff(speeds[:, 1]).min() > -1e-4
    assert_allclose(speeds[-1], [12.238, 9.4248], rtol=1e-3)


def test_free_run_settles_near_the_starting_point_of_the_thesis(built):
    t = np.linspace(0, 20, 2001)
    x0 = {"omega_w": 12.16, "omega_r": 9.36}
    omega_w, omega_r = runs(built("testrig"), t, first=x0, f_sync=np.full_like(t, 7.5))[-1]
    # the thesis starts loaded at 9.36, 0.7 % below the synchronous speed of 9.425, where a free run ends
    assert 9.36 < omega_r < 9.43
    assert_allclose(omega_w * P["r_w"], omega_r * P["r_r"], rtol=1e-6)


def test_coasting_loses_energy(built):
    t = np.linspace(0, 5, 501)
    still, x0 = np.zeros_like(t), {"omega_w": 14.0, "omega_r": 8.0}
    omega_w, omega_r = runs(built("testrig"), t, first=x0, T_P=still, f_sync=still).T
    energy = P["J_w"] * omega_w**2 / 2 + P["J_r"] * omega_r**2 / 2
    # the step keeps the sum to its tolerance, 1e-6 of the nominal speed
    assert np.diff(energy).max() < 1e-6 * energy[0]
    assert energy[-1] < 0.99 * energy[0]


def test_declared_parameters_are_those_of_the_truth():
    assert {f.name: f.default for f in fields(Rig)} == P


@pytest.mark.parametrize("seed", [1, 2, 3])
# inputs held over 5 ms are not the truth's straight lines: 2e-5 rad/s, a hundredth of the sensors' noise;
# over a quarter of that they differ by a sixteenth, and the model's own error does not show
@pytest.mark.parametrize(("finer", "rms"), [(1, 2e-5), (4, 2e-6)])
def test_a_record_agrees_with_the_independent_truth(built, seed, finer, rms):
    samples, rng = np.arange(4001) * 0.005, np.random.default_rng(seed)
    t = np.linspace(0, 20, 4000 * finer + 1)
    T_P, f_sync = (np.interp(t, samples, made(samples, rng)) for made in (torque_profile, frequency_profile))
    # at this nu a row of Kalker's table holds; between rows the truth interpolates c11, the model 1/c11
    truth = np.column_stack(simulate(Inputs(t, T_P, f_sync), Rig(nu=0.25)))
    x0 = dict(zip(("omega_w", "omega_r"), truth[0].tolist(), strict=True)) | {"nu": 0.25}
    found = runs(built("testrig"), t, first=x0, T_P=T_P, f_sync=f_sync)
    assert np.sqrt(np.mean((found - truth) ** 2, axis=0)).max() < rms
