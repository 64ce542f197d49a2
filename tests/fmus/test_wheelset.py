"""The wheelset: laws of physics, limits by hand, the thesis's runs, and its independent truth."""

from array import array
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact import contact_table, creep_forces, klingel_wavelength
from fmus.contact.forces.conditions import CONDITIONS, PARAMETERS
from fmus.contact.forces.laws import LAWS
from fmus.contact.geometry.table import SEARCHES
from fmus.export.runtime.stepping import Stepper
from fmus.export.runtime.symbolic import on_memory
from fmus.host.fmu import Fmu
from fmus.model import equations
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from fmus.wheelset.model import Wheelset
from tests.helpers.everything import values
from tests.truth import wheelset_effects
from tests.truth.wheelset import NOISE, true_run

MODEL = Wheelset()
MADE = equations(MODEL)
NAMES = {kind: [v.name for v in MODEL.of(kind)] for kind in (State, Input, Parameter, Output)}
FREE = {"k_y": 0.0, "k_x": 0.0, "b_y": 0.0, "b_x": 0.0}
OWN_WEIGHT = 1813 * 9.81 / 2  # N, wheel load of a wheelset that carries nothing
CODES = {name: float(law.code) for name, law in LAWS.items()}
GIVEN = {"y": 2e-3, "psi": 4e-4, "y_dot": 0.02, "psi_dot": 0.03, "y_m": -1e-3, "y_m_dot": 0.01}

states = st.tuples(*(st.floats(-1, 1) for _ in range(6))).map(
    lambda s: dict(zip(NAMES[State], np.array(s) * [5e-3, 2e-3, 0.1, 0.05, 5e-3, 0.1], strict=True))
)


def column(kind, changed):
    """Start values of a kind of variable, with those that are changed."""
    return np.array([float(changed.get(v.name, v.start)) for v in MODEL.of(kind)])


def rates(**changed):
    """Derivatives by name of state."""
    found = values(MADE.f, *(column(kind, changed) for kind in (State, Input, Parameter)))
    return dict(zip(NAMES[State], found, strict=True))


def outputs(**changed):
    """Outputs by name."""
    found = values(MADE.h, *(column(kind, changed) for kind in (State, Input, Parameter)))
    return dict(zip(NAMES[Output], found, strict=True))


def run(duration, dt=1e-3, inputs=None, **changed):
    """States (n, 6) every 1 ms; inputs(t) -> values of inputs held over the millisecond after t, s."""
    x, u, p = (array("d", column(kind, changed)) for kind in (State, Input, Parameter))
    stepper = Stepper(partial(on_memory, MADE.step), *map(memoryview, (x, u, p)), dt)
    found = [list(x)]
    for i in range(round(duration / 1e-3)):
        for name, value in (inputs(i * 1e-3) if inputs else {}).items():
            u[NAMES[Input].index(name)] = value
        for _ in range(round(1e-3 / dt)):
            assert stepper.advance(dt)
        found.append(list(x))
    return np.array(found)


def forces(**changed):
    """Lateral force, N, and yaw moment, N.m, on a wheelset without suspension."""
    dot = rates(**FREE, **changed)
    return dot["y_dot"] * 1813, dot["psi_dot"] * 1120


@given(states, st.sampled_from([*CODES.values()]), st.floats(0, 60), st.floats(-5e-3, 5e-3))
def test_a_mirror_image_moves_as_the_mirror_image(x, law, V, y_irr):
    said = {**x, "V": V, "creep_law": law, "y_irr": y_irr, "y_irr_dot": 0.02, "F_y_ext": 300.0}
    other = {name: -v for name, v in said.items() if name not in ("V", "creep_law")}
    there, here = rates(**said), rates(**other, V=V, creep_law=law)
    assert_allclose([*there.values()], [-v for v in here.values()], rtol=1e-7, atol=1e-7)
    there, here = outputs(**said), outputs(**other, V=V, creep_law=law)
    for name, turns in (("F_x", 1), ("F_y", -1), ("M_z", -1), ("xi_s", -1), ("r", 1), ("delta", 1)):
        assert there[f"{name}_left"] == pytest.approx(turns * here[f"{name}_right"], rel=1e-6, abs=1e-6)


@given(states, st.sampled_from(["linear", "shen", "fastsim"]), st.floats(1, 60))
def test_creep_takes_energy_from_slip(x, law, V):
    o = outputs(**x, V=V, creep_law=CODES[law])
    for side in ("left", "right"):
        power = sum(o[f"{F}_{side}"] * o[f"{s}_{side}"] for F, s in (("F_x", "xi_x"), ("F_y", "xi_y")))
        assert power + o[f"M_z_{side}"] * o[f"xi_s_{side}"] <= 1e-9


@given(states, st.sampled_from(["shen", "fastsim", "polach_no_spin", "polach"]), st.floats(1, 60))
def test_no_wheel_gets_more_than_friction_gives(x, law, V):
    o = outputs(**x, V=V, creep_law=CODES[law])
    for side in ("left", "right"):
        # Polach's spin term does not bound the force by its form, see fmus/contact
        assert np.hypot(o[f"F_x_{side}"], o[f"F_y_{side}"]) <= 0.5 * 55e3 * (1.001 + 0.1 * (law == "polach"))


@pytest.mark.parametrize("law", CODES.values())
@pytest.mark.parametrize("V", [0.0, 0.05, 40.0])
def test_straight_running_goes_on_and_has_finite_derivatives(law, V):
    assert_allclose([*rates(V=V, creep_law=law).values()], 0.0, atol=1e-9)
    arguments = [column(kind, {"V": V, "creep_law": law}) for kind in (State, Input, Parameter)]
    for block in MADE.f.jacobian()(*arguments, 0):
        assert np.isfinite(block.full()).all()


def test_a_wheelset_that_stands_is_not_steered():
    """At rest only the rails' normal forces push; rolling would make it turn."""
    y, M = forces(y=3e-3, V=0.0)
    assert abs(M) < 1e-6
    assert y < 0


def test_suspension_by_hand():
    x = {"y": 1e-3, "y_m": 4e-3, "psi": 2e-3, "y_dot": 0.1, "y_m_dot": 0.3, "psi_dot": 0.4}
    hung, free = rates(**x), rates(**x, **FREE)
    F = -2 * 2e6 * (1e-3 - 4e-3) - 2 * 1e3 * (0.1 - 0.3)
    M = -2 * 1.0**2 * (4e6 * 2e-3 + 1e3 * 0.4)
    assert (hung["y_dot"] - free["y_dot"]) * 1813 == pytest.approx(F, rel=1e-6)
    assert (hung["psi_dot"] - free["psi_dot"]) * 1120 == pytest.approx(M, rel=1e-6)
    assert hung["y_m_dot"] * 6241 == pytest.approx(-F)
    pushed = rates(**x, F_y_ext=500.0, M_z_ext=-70.0, F_ym_ext=40.0)
    for name, F_more, m in (("y_dot", 500, 1813), ("psi_dot", -70, 1120), ("y_m_dot", 40, 6241)):
        assert (pushed[name] - hung[name]) * m == pytest.approx(F_more)


def test_gravity_centres_by_the_difference_of_contact_angles():
    """Without friction the lateral force is N times the sines of both slopes, and yaw drives itself on."""
    slippery = {"mu0": 1e-12, "creep_law": CODES["polach_no_spin"], "psi": 1e-3}
    for y in (1e-3, 4e-3):
        o = outputs(y=y, **slippery)
        left, right = np.sin([o["delta_left"] + o["phi"], o["delta_right"] - o["phi"]])
        arms = 0.75 + o["r_left"] * o["phi"], 0.75 - o["r_right"] * o["phi"]
        F, M = forces(y=y, **slippery)
        assert pytest.approx(F, rel=1e-6) == -55e3 * (left - right)
        assert pytest.approx(M, rel=1e-6) == 55e3 * 1e-3 * (arms[0] * left + arms[1] * right)
        assert F < 0 < M


def test_a_wheelset_that_rolls_over_turns_as_a_gyroscope():
    """Rolling forward about +y while the left side rises (roll about +x): it turns to the right."""
    moving = {"y": 4e-3, "y_dot": 0.1, "V": 40.0}
    still, spinning = (rates(**moving, I_wy=I_wy)["psi_dot"] * 1120 for I_wy in (0.0, 112.0))
    step = 1e-6
    phi_dot = (outputs(y=4e-3 + step)["phi"] - outputs(y=4e-3 - step)["phi"]) / (2 * step) * 0.1
    assert phi_dot > 0
    assert spinning - still == pytest.approx(-112 * 40 / 0.46 * phi_dot, rel=1e-4)


def test_creepages_by_hand():
    o = outputs(**GIVEN, V=20.0)
    step = 1e-7
    slope = (outputs(y=2e-3 + step)["phi"] - outputs(y=2e-3 - step)["phi"]) / (2 * step)
    for side, sign in (("left", 1), ("right", -1)):
        r, delta = o[f"r_{side}"], o[f"delta_{side}"]
        # velocity of the point (0, sign s, -r) of a body that moves and turns, with roll
        point = np.array([20.0, 0.02, 0]) + np.cross([slope * 0.02, 20 / 0.46, 0.03], [0, sign * 0.75, -r])
        assert o[f"xi_x_{side}"] == pytest.approx(point[0] / 20, rel=1e-6, abs=1e-9)
        assert o[f"xi_y_{side}"] == pytest.approx(point[1] / 20 - 4e-4, rel=1e-5)
        assert o[f"xi_s_{side}"] == pytest.approx((0.03 - sign * delta * 20 / 0.46) / 20, rel=1e-9)


def test_wider_gauge_takes_both_wheels_from_their_flanges_alike():
    wide, plain = outputs(gauge_irr=4e-3), outputs()
    assert wide["r_left"] == wide["r_right"] < plain["r_left"]
    assert_allclose([*rates(gauge_irr=4e-3).values()], 0.0, atol=1e-9)
    for side, y in (("left", 1e-3), ("right", 5e-3)):
        shifted = outputs(y=y)[f"r_{side}"]
        assert outputs(y=3e-3, gauge_irr=4e-3)[f"r_{side}"] == pytest.approx(shifted, abs=1e-12)


def test_the_track_counts_not_the_place():
    beside = rates(y=5e-3, y_irr=3e-3, y_m=5e-3, V=40.0)
    assert_allclose([*beside.values()], [*rates(y=2e-3, y_m=2e-3, V=40.0).values()], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("search", [0.0, 1.0])
@pytest.mark.parametrize("patch", [0.0, 1.0])
@pytest.mark.parametrize("law", CODES)
def test_every_choice_gives_the_forces_of_the_public_functions(law, search, patch):
    chosen = {"creep_law": CODES[law], "contact_search": search, "patch": patch, "V": 30.0, "F_n": 70e3}
    o = outputs(**GIVEN, **chosen, G=7.5e10, k_A=0.8, k_S=0.3)
    for side in ("left", "right"):
        a, b, *xi = (o[f"{name}_{side}"] for name in ("a", "b", "xi_x", "xi_y", "xi_s"))
        mu = 0.5 * (0.6 * np.exp(-0.6 * 30 * np.hypot(*xi[:2])) + 0.4)
        expected = creep_forces(law, a, b, 70e3, mu, 7.5e10, 0.28, *xi, k_A=0.8, k_S=0.3)
        found = [o[f"{name}_{side}"] for name in ("F_x", "F_y", "M_z")]
        assert_allclose(found, expected, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("patch", ["hertz", "virtual_penetration"])
def test_patches_grow_with_load_and_stiffness_as_hertz_says(search, patch):
    y, choice = 1.5e-3, {"hertz": 0.0, "virtual_penetration": 1.0}[patch]
    o = outputs(y=y, F_n=90e3, G=7e10, nu=0.3, patch=choice, contact_search=float(SEARCHES.index(search)))
    table = contact_table(search=search, patch=patch, N=90e3, E=2 * 7e10 * 1.3, nu=0.3, shifts=[y])
    for name in ("a_left", "b_left", "a_right", "b_right"):
        assert o[name] == pytest.approx(float(table[name].iloc[0]), rel=1e-3 if search == "rigid" else 1e-4)


@pytest.mark.parametrize("patch", [0, 1])
def test_patches_follow_the_shift_as_far_as_they_are_told_to(patch):
    """All, half and nothing of the way in logarithms from the mean over usual shifts."""
    names = ("a_left", "b_left", "a_right", "b_right")
    at = {k_c: [outputs(y=y, patch=patch, k_c=k_c) for y in (-2e-3, 5e-4, 2e-3)] for k_c in (0.0, 0.5, 1.0)}
    for i, whole in enumerate(at[1.0]):
        for name in names:
            mean, half = at[0.0][0][name], at[0.5][i][name]
            assert at[0.0][i][name] == pytest.approx(mean, rel=1e-12)
            assert half == pytest.approx(np.sqrt(mean * whole[name]), rel=1e-12)
    assert at[0.0][0]["a_left"] == pytest.approx(at[0.0][0]["a_right"], rel=1e-12)
    assert 0.6 < at[0.0][0]["b_left"] / np.mean([o["b_left"] for o in at[1.0]]) < 1.6


def test_creep_coefficients_that_are_given_count_for_the_linear_law_only():
    f = {"f11": 8e6, "f22": 7e6, "f23": 1.6e4, "f33": 100.0}
    o = outputs(**GIVEN, **f, creep_law=0.0)
    for side in ("left", "right"):
        xi_x, xi_y, xi_s = (o[f"xi_{c}_{side}"] for c in "xys")
        assert o[f"F_x_{side}"] == pytest.approx(-8e6 * xi_x)
        assert o[f"F_y_{side}"] == pytest.approx(-7e6 * xi_y - 1.6e4 * xi_s)
        assert o[f"M_z_{side}"] == pytest.approx(1.6e4 * xi_y - 100 * xi_s)
    assert outputs(**GIVEN, **f)["F_y_left"] == outputs(**GIVEN)["F_y_left"]


@pytest.mark.parametrize("V", [0.2, 2.0])
def test_slow_hunting_has_klingels_wavelength(V):
    """A light, unsuspended wheelset rolls kinematically: 2 pi sqrt(s r0/conicity), the conicity at rest."""
    f = {"f11": 1e8, "f22": 1e8, "f23": 1e-9, "f33": 1e-9}
    said = {**FREE, **f, "creep_law": 0.0, "V": V}
    A = MADE.f.jacobian()(*(column(kind, said) for kind in (State, Input, Parameter)), 0)[0].full()[:4, :4]
    omega = np.abs(np.linalg.eigvals(A).imag).max()
    step = 1e-5
    o = outputs(y=step)
    expected = klingel_wavelength((o["r_left"] - o["r_right"]) / (2 * step), r0=0.46, s=0.75)
    assert 2 * np.pi * V / omega == pytest.approx(float(expected), rel=0.02)


@pytest.mark.parametrize(("law", "stable"), [("polach_no_spin", True), ("fastsim", False), ("polach", False)])
def test_spin_makes_the_hunting_of_a_wheelset_on_its_own_unstable(law, stable):
    """Thesis Figs 4.13 to 4.18: 3 mm aside at 10 m/s, under its own weight; then up to its flanges."""
    duration = 15.0 if law != "fastsim" else 6.0
    y = np.abs(run(duration, y=3e-3, V=10.0, creep_law=CODES[law], F_n=OWN_WEIGHT, **FREE)[:, 0])
    early, late = y[:1500].max(), y[-1500:].max()
    assert late < 0.8 * early if stable else 1.4 * early < late < 7e-3


def test_under_a_vehicles_load_it_becomes_unstable_at_a_higher_speed():
    late = {V: np.abs(run(10.0, y=3e-3, V=V, **FREE)[-1500:, 0]).max() for V in (10.0, 20.0)}
    assert late[10.0] < 2.9e-3 < 4.5e-3 < late[20.0]


def test_friction_conditions_are_those_that_the_independent_truth_copied_from_the_source_for_itself():
    assert wheelset_effects.FRICTION == PARAMETERS
    assert {n: tuple(row.values()) for n, row in CONDITIONS.items()} == wheelset_effects.CONDITIONS
    assert all(tuple(row) == PARAMETERS for row in CONDITIONS.values())


def test_friction_conditions_answer_a_step_of_alignment_each_in_its_way():
    """Thesis Fig. 4.25: 5 mm at 1 s; less friction turns the wheelset less."""

    def answer(condition):
        return run(2.5, inputs=lambda t: {"y_irr": 5e-3 if t >= 1.0 else 0.0}, **CONDITIONS[condition])

    found = {condition: answer(condition) for condition in CONDITIONS}
    yaw = [np.abs(x[:, 1]).max() for x in found.values()]
    assert yaw == sorted(yaw, reverse=True)
    for i, one in enumerate(found.values()):
        for other in [*found.values()][i + 1 :]:
            apart = np.abs(one - other)[:, :4].max(axis=0)
            assert (apart > 50 * np.array([*NOISE.values()]) * [1, 1, 0.1, 0.1]).all()
    for condition in ("dry", "wet", "low"):
        assert found[condition][-1, 0] == pytest.approx(5e-3, abs=5e-4)


def test_flange_contact_is_told_and_the_wheelset_comes_back():
    assert outputs(y=5e-3)["flange_contact"] == 0.0
    for y in (7e-3, -7e-3, 30e-3):
        assert outputs(y=y)["flange_contact"] == 1.0
    back = run(1.0, y=30e-3, V=40.0)
    assert np.isfinite(back).all()
    assert abs(back[-1, 0]) < 6e-3


def wave(V):
    """Alignment of 12 m and 2 mm, held over each millisecond."""
    w = 2 * np.pi * V / 12

    def at(t):
        return {"y_irr": 2e-3 * np.sin(w * (t + 5e-4)), "y_irr_dot": 2e-3 * w * np.cos(w * (t + 5e-4))}

    return at


@pytest.mark.parametrize("V", [10.0, 60.0])
def test_a_millisecond_is_short_enough(V):
    coarse, fine = (run(0.8, dt, wave(V), V=V) for dt in (1e-3, 1e-4))
    assert (np.abs(coarse - fine).max(axis=0) < 2e-4 * np.abs(fine).max(axis=0)).all()


@pytest.mark.parametrize("V", [0.0, 0.05, 1.0, 3.0])
def test_slow_running_is_stable(V):
    coarse, fine = (run(0.1, dt, y=3e-3, psi=1e-3, V=V) for dt in (1e-3, 1e-4))
    assert (np.abs(coarse - fine)[:, :2].max(axis=0) < 2e-3 * np.abs(fine)[:, :2].max(axis=0)).all()


def test_the_fmu_is_the_truth_within_the_noise(built):
    """Two models that share no code, over 8 s of random track: a tenth of the noise of a record."""
    track, truth = true_run(np.random.default_rng(3), duration=8.0)
    inputs = {"y_irr": track.y_irr[::2], "y_irr_dot": track.y_irr_dot[::2]}
    with Fmu(built("wheelset")) as fmu:
        found = fmu.simulate(track.t, inputs, [*NOISE], {})
    off = (found - truth[:, :4]).std(axis=0) / [*NOISE.values()]
    assert (off < 0.1).all(), off
