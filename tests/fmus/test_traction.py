"""The driven wheelset: its laws, its torsion against the eigenvalues, and the independent truth."""

from dataclasses import fields
from functools import cache

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import eigvals

from fmus.effects import EFFECTS
from fmus.model import equations
from fmus.traction.model import OMEGA_MIN, Traction
from tests.helpers.everything import values
from tests.helpers.traction import MADE, MODEL, SAME, STATES, P, U, at, rolling, spinning_up, turning
from tests.truth import traction as truth
from tests.truth.laws import ViscousDamping

speeds = st.floats(0.5, 60.0)
slips = st.floats(-0.9, 0.9)
twists = st.floats(-3e-3, 3e-3)
states = st.builds(
    rolling, speeds, slips, slips, slips, theta_s=twists, theta_g=twists, theta_left=st.floats(-10, 10)
)
torques = st.fixed_dictionaries(
    {
        "T_m": st.floats(-9e3, 9e3),
        "T_b": st.floats(0.0, 2e4),
        "F_x_ext": st.floats(-1e5, 1e5),
        "y": st.floats(-5e-3, 5e-3),
        "psi": st.floats(-5e-3, 5e-3),
        "y_dot": st.floats(-0.1, 0.1),
        "psi_dot": st.floats(-0.1, 0.1),
    }
)


@cache
def with_damper(place):
    """Equations with a viscous damper at a port."""
    return equations(Traction([(EFFECTS["viscous_damping"], place)]))


@given(states, torques)
def test_power_goes_into_motion_torsion_and_what_is_lost(x, inputs):
    """Straight from energy: only contacts, brakes and dampers lose it."""
    inputs = inputs | {"y_dot": 0.0, "psi": 0.0, "psi_dot": 0.0}  # what steers does work elsewhere
    parameters = {"c_s": 100.0}
    dx, seen = at(MADE.f, x, inputs, parameters), at(MADE.h, x, inputs, parameters)
    speed, spun = turning(x), spinning_up(dx)
    inertias = {"omega_left": "I_left", "omega_right": "I_right", "omega_m": "J_m"}
    stored = sum(P[inertias[name]] * speed[name] * spun[name] for name in speed) + (
        P["M_v"] * x["V"] * dx["V"]
        + P["k_s"] * x["theta_s"] * dx["theta_s"] + P["k_g"] * x["theta_g"] * dx["theta_g"]
    )  # fmt: skip
    given_in = inputs["T_m"] * speed["omega_m"] + inputs["F_x_ext"] * x["V"]
    lost = 100.0 * dx["theta_s"] ** 2 + P["c_g"] * dx["theta_g"] ** 2
    for side in ("left", "right"):
        omega = speed[f"omega_{side}"]
        slipping = x["V"] - seen[f"r_{side}"] * omega
        contact = -seen[f"F_x_{side}"] * slipping
        brake = inputs["T_b"] * np.tanh(omega / OMEGA_MIN) * omega
        assert contact >= 0
        assert brake >= 0
        lost += contact + brake
    size = abs(given_in) + lost + 1.0
    assert abs(stored - given_in + lost) < 1e-9 * size


@given(states, torques)
def test_no_wheel_takes_more_than_its_friction_and_force_opposes_slip(x, inputs):
    seen = at(MADE.h, x, inputs)
    for side in ("left", "right"):
        F = np.array([seen[f"F_x_{side}"], seen[f"F_y_{side}"]])
        xi = np.array([seen[f"xi_x_{side}"], seen[f"xi_y_{side}"]])
        assert np.hypot(*F) <= P["mu0"] * P["F_n"] * (1 + 1e-12)
        assert F @ xi <= 0


@given(states, torques)
def test_backwards_is_forwards_mirrored(x, inputs):
    """All that moves turned round: so is all that follows, but for yaw, which steers by where it points."""
    still = {"psi": 0.0, "y": 0.0, "T_b": inputs["T_b"]}
    turned = {n: -u for n, u in inputs.items()} | still
    forwards = at(MADE.f, x, inputs | still)
    backwards = at(MADE.f, {n: -value for n, value in x.items()}, turned)
    size = np.abs([*forwards.values()]).max()
    assert_allclose([*backwards.values()], [-v for v in forwards.values()], atol=1e-9 * size)


@given(states, torques)
def test_forces_and_accelerations_are_the_truths(x, inputs):
    """The equations written a second time, from absolute angles and Mal's contact shear stiffness."""
    p = truth.Traction()
    seen = at(MADE.h, x, inputs, SAME)
    left, right = x["theta_left"], x["theta_left"] + x["theta_s"]
    other = np.array([left, right, P["i_g"] * (right + x["theta_g"]), 0.0,
                      *turning(x).values(), x["V"]])  # fmt: skip
    u = dict.fromkeys(truth.INPUTS, 0.0) | inputs
    expected = truth.outputs(p, other, u)
    for name in (
        "r_left",
        "xi_x_left",
        "xi_x_right",
        "xi_y_right",
        "F_x_left",
        "F_x_right",
        "F_y_left",
        "F_x",
    ):
        assert_allclose(seen[name], expected[name], rtol=1e-8, atol=1e-6, err_msg=name)
    t = np.array([0.0, 1.0])
    inputs_then = truth.Inputs(t, {name: np.full(2, value) for name, value in inputs.items()})
    rates = dict(zip(truth.STATES, truth.motion(p, inputs_then)(0.5, other), strict=True))
    dx = at(MADE.f, x, inputs, SAME)
    for name, found in {**spinning_up(dx), "V": dx["V"]}.items():
        assert_allclose(found, rates[name], rtol=1e-6, atol=1e-3, err_msg=name)


@pytest.mark.parametrize("place", sorted(MODEL.ports()))
@given(x=states, c=st.floats(1.0, 1e3))
def test_an_effect_at_a_port_moves_the_model_as_it_moves_the_truth(place, x, c):
    def rates(damping):
        p = P | SAME | {f"viscous_damping_{place}_c": damping}
        dx = values(with_damper(place).f, list(x.values()), list(U.values()), list(p.values()))
        named = dict(zip(STATES, dx, strict=True))
        return {**spinning_up(named), "V": named["V"]}

    found, bare = rates(c), rates(0.0)
    right = x["theta_left"] + x["theta_s"]
    other = np.array([x["theta_left"], right, P["i_g"] * (right + x["theta_g"]), x["x"],
                      *turning(x).values(), x["V"]])  # fmt: skip
    forces = truth.pushed(truth.Traction(), [(place, ViscousDamping(c))], 0.0, other)
    expected = forces / np.array([P["I_left"], P["I_right"], P["J_m"], P["M_v"]])
    gained = [found[name] - bare[name] for name in found]
    # two sums of large torques are taken from each other
    size = 1 + max(abs(v) for v in found.values())
    assert_allclose(gained, expected, rtol=1e-9, atol=1e-12 * size)


def test_declared_values_are_the_truths():
    assert {f.name: f.default for f in fields(truth.Traction) if f.name in P} == {
        f.name: P[f.name] for f in fields(truth.Traction) if f.name in P
    }
    assert len([f for f in fields(truth.Traction) if f.name in P]) > 20


def modes(**parameters):
    """Eigenvalues of the linearised model, rolling freely at 20 m/s."""
    point = [list(rolling(20.0).values()), list(U.values()), list((P | parameters).values())]
    x = cs.MX.sym("x", len(STATES))
    A = cs.Function("A", [x], [cs.jacobian(MADE.f(x, *point[1:]), x)])
    return eigvals(A(point[0]).full())


def frequencies(values_of):
    return np.sort(values_of.imag[values_of.imag > 1]) / (2 * np.pi)


@given(st.floats(20.0, 200.0), st.floats(0.5, 8.0), st.floats(1e6, 2e7), st.floats(1e6, 1e8))
def test_lifted_off_the_rail_it_swings_at_the_chains_eigenvalues(I_left, J_m, k_s, k_g):
    off = {"a": 1e-6, "b": 1e-6, "c_g": 0.0}
    given_p = {"I_left": I_left, "J_m": J_m, "k_s": k_s, "k_g": k_g}
    expected = np.sort(truth.Traction(**given_p).frequencies())
    assert_allclose(frequencies(modes(**off, **given_p)), expected, rtol=1e-4)


def test_a_stiff_drive_leaves_the_two_inertias_of_the_source():
    """Table 1: 64 and 134 kg.m2 on 6063260 N.m/rad."""
    found = frequencies(modes(a=1e-6, b=1e-6, c_g=0.0, k_g=1e12))[0]
    assert_allclose(found, np.sqrt(6063260 * (1 / 64 + 1 / 134)) / (2 * np.pi), rtol=1e-4)


def test_on_the_rail_every_swing_is_damped_and_past_the_peak_one_grows():
    def fastest(creep):
        x = rolling(10.0, creep, creep, creep)
        symbol = cs.MX.sym("x", len(STATES))
        slope = cs.jacobian(MADE.f(symbol, list(U.values()), list((P | {"M_v": 1e8}).values())), symbol)
        found = eigvals(cs.Function("A", [symbol], [slope])(list(x.values())).full())
        return found[np.abs(found.imag) > 2 * np.pi * 20].real.max(initial=-np.inf)

    assert fastest(0.003) < -10
    assert fastest(0.008) < -1
    assert fastest(0.02) > 5
    assert fastest(0.03) > 5


def test_a_cone_and_a_given_growth_make_the_radii():
    shifted = {"y": 3e-3, "y_irr": 1e-3, "dr_left": 1e-4, "dr_right": -2e-4}
    seen = at(MADE.h, rolling(20.0), shifted)
    assert_allclose(seen["r_left"], 0.5 + 0.15 * 2e-3 + 1e-4)
    assert_allclose(seen["r_right"], 0.5 - 0.15 * 2e-3 - 2e-4)
    # a shift to the left lets the left wheel run ahead: its creep force pulls back and turns to the right
    cone = at(MADE.h, rolling(20.0), {"y": 1e-4})
    assert cone["F_x_left"] > 0 > cone["F_x_right"]
    assert cone["M_z"] < 0
    assert_allclose(cone["M_z"], 0.75 * (cone["F_x_right"] - cone["F_x_left"]))


def test_lateral_creepage_and_traction_share_one_friction():
    pulling = at(MADE.h, rolling(20.0, 0.02, 0.02, 0.02))
    yawed = at(MADE.h, rolling(20.0, 0.02, 0.02, 0.02), {"psi": 0.02})
    alone = at(MADE.h, rolling(20.0), {"psi": 0.02})
    assert yawed["F_x_left"] < 0.8 * pulling["F_x_left"]
    assert 0 < yawed["F_y_left"] < 0.8 * alone["F_y_left"]
    assert_allclose(yawed["F_x_left"], yawed["F_y_left"], rtol=1e-9)  # as large, as both creepages are
