"""The bogie: laws of mechanics, hand formulas of curving, stability against a state matrix by hand."""

from dataclasses import replace
from functools import cache

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.bogie.model import Bogie
from fmus.contact import creep_forces
from fmus.contact.forces.laws import LAWS
from fmus.errors import BadInput
from fmus.variables import Parameter, State
from tests.helpers.evaluated import Evaluated
from tests.truth import bogie_linear

BOGIE = Evaluated(Bogie())
CODES = {name: float(law.code) for name, law in LAWS.items()}
STATES = BOGIE.names[State]
SIZES = {v.name: v.nominal for v in BOGIE.model.of(State)}
UNTURNED = ("V", "omega_1", "omega_2", "creep_law")  # what a mirror leaves as it is
SPRINGS = ("k_px", "k_py", "k_pz", "k_sx", "k_sy", "k_sz", "k_r")
DAMPERS = ("b_px", "b_py", "b_pz", "b_sy", "b_sz", "b_d")
G = 9.81
WEIGHT = (32000 / 2 + 2615 + 2 * 1813) * G

states = st.tuples(*(st.floats(-2, 2) for _ in STATES)).map(
    lambda s: {name: float(x * SIZES[name]) for name, x in zip(STATES, s, strict=True)}
)


def curve(V=25.0, radius=800.0, cant=0.0, **more):
    """Inputs of a curve to the left."""
    both = {f"{name}_{i}": v for name, v in (("kappa", 1 / radius), ("cant", cant)) for i in (1, 2)}
    return {"V": V, **both, **more}


@cache
def settled(**inputs):
    """Equilibrium and outputs there."""
    at = BOGIE.equilibrium(**inputs)
    return at, BOGIE.outputs(**inputs, **at)


@settings(deadline=None, max_examples=40)
@given(states, st.sampled_from([*CODES.values()]), st.floats(0, 80), st.floats(-2e-3, 2e-3))
def test_a_mirror_image_moves_as_the_mirror_image(x, law, V, kappa):
    said = {**x, "V": V, "creep_law": law, "kappa_1": kappa, "cant_2": 0.05, "y_irr_1": 1e-3, "y_c": 4e-3}
    said |= {"phi_c": 0.01, "psi_c": 1e-3, "F_y_1_ext": 300.0, "kappa_2_dot": 1e-4, "cant_1_dot": 0.01}
    other = {name: v if name in UNTURNED or name.startswith("omega") else -v for name, v in said.items()}
    there, here = BOGIE.rates(**said), BOGIE.rates(**other)
    for name, rate in there.items():
        turns = 1 if name.startswith("omega") else -1
        assert rate == pytest.approx(turns * here[name], rel=1e-7, abs=1e-6), name
    there, here = BOGIE.outputs(**said), BOGIE.outputs(**other)
    for name in ("Y_1", "Q_2", "YQ_2", "delta_1"):
        assert there[f"{name}_left"] == pytest.approx(here[f"{name}_right"], rel=1e-6)


@given(st.floats(-0.02, 0.02), st.floats(-5e-3, 5e-3), st.floats(0, 60))
def test_a_bogie_that_is_shifted_and_turned_as_a_whole_strains_nothing(y, psi, V):
    """With its track and its body: no port of a suspension moves."""
    a = 1.28
    moved = {"y_1": y + a * psi, "y_2": y - a * psi, "y_b": y, "y_c": y}
    moved |= dict.fromkeys(["psi_1", "psi_2", "psi_b", "psi_c"], psi)
    on_track = {"y_irr_1": y + a * psi, "y_irr_2": y - a * psi, "V": V}
    probed = probes(**moved, **on_track)
    for name, (q, v) in probed.items():
        if name.startswith(("primary", "secondary")):
            assert (abs(q), abs(v)) < (1e-12, 1e-12), name
    still = BOGIE.rates(y_1=0.0, V=V)
    shifted = BOGIE.rates(**{**moved, **dict.fromkeys([n for n in moved if n[:3] == "psi"], 0.0)}, **on_track)
    if psi == 0.0:
        assert_allclose([*shifted.values()], [*still.values()], atol=1e-9)


@cache
def motions():
    """Function of all variables -> displacement and velocity of every port."""
    model = BOGIE.model
    kinds = [cs.vertcat(*(model.free_symbols[n] for n in names)) for names in list(BOGIE.names.values())[:3]]
    ports = model.ports()
    found = [cs.vertcat(p.displacement, p.velocity) for p in ports.values()]
    return list(ports), cs.Function("motions", kinds, found)


def probes(**changed):
    """Displacement and velocity of every port by location."""
    names, function = motions()
    found = function(*BOGIE.arguments(**changed))
    return {name: (float(x[0]), float(x[1])) for name, x in zip(names, found, strict=True)}


def test_springs_and_weight_are_conservative_and_dampers_take_energy():
    """Matrices of frame and wheelsets without contact: stiffness symmetric, damping positive."""
    model, bogie = BOGIE.model, BOGIE.model._bogie
    q = cs.vertcat(*(model.free_symbols[name] for name in bogie.coordinates))
    v = cs.vertcat(*(model.free_symbols[f"{name}_dot"] for name in bogie.coordinates))
    forces = cs.vertcat(*bogie.applied.values())
    kinds = [cs.vertcat(*(model.free_symbols[n] for n in names)) for names in list(BOGIE.names.values())[:3]]
    slopes = cs.Function("slopes", kinds, [cs.jacobian(forces, q), cs.jacobian(forces, v)])
    stiffness, damping = (-m.full() for m in slopes(*BOGIE.arguments()))
    frame = [i for i, name in enumerate(bogie.coordinates) if name.endswith("_b")]
    # the roll of a wheelset is no coordinate: its share acts through the wheel loads, which are not in here
    for i, j in ((i, j) for i in frame for j in frame):
        assert stiffness[i, j] == pytest.approx(stiffness[j, i], rel=1e-9, abs=1e-3)
    plan = [i for i, name in enumerate(bogie.coordinates) if not name.startswith("phi")]
    within = np.ix_(plan, plan)
    for name, matrix in (("stiffness", stiffness), ("damping", damping)):
        held = matrix[within]
        scale = np.sqrt(np.abs(np.diag(held)))
        assert np.abs((held - held.T) / np.outer(scale, scale)).max() < 1e-3, name
        assert np.linalg.eigvalsh((held + held.T) / 2).min() > -1e-3 * np.abs(held).max(), name


@pytest.mark.parametrize("law", CODES)
def test_creep_laws_take_friction_and_load_by_their_product(law):
    """What lets both wheels of a wheelset have loads of their own."""
    slips = (1e-3, -2e-3, 0.2)
    one = creep_forces(law, 5e-3, 4e-3, 60e3, 0.3, 8e10, 0.28, *slips, k_A=0.8, k_S=0.4)
    other = creep_forces(law, 5e-3, 4e-3, 30e3, 0.6, 8e10, 0.28, *slips, k_A=0.8, k_S=0.4)
    assert_allclose(one, other, rtol=1e-12)


@pytest.mark.parametrize("cant", [0.0, 0.06, 0.12])
def test_wheel_loads_and_guiding_forces_balance_in_a_curve(cant):
    """Sum of forces on bogie and rails in the track plane, and of moments about its centre line, by hand."""
    V, radius = 22.0, 1500.0
    at, o = settled(**curve(V, radius, cant))
    across = V**2 / radius * np.cos(cant) - G * np.sin(cant)
    down = np.cos(cant) + V**2 / radius * np.sin(cant) / G
    Q = sum(o[f"Q_{i}_{side}"] for i in (1, 2) for side in ("left", "right"))
    assert pytest.approx(WEIGHT * down, rel=1e-9) == Q
    F_Y = sum(o[f"Y_{i}_right"] - o[f"Y_{i}_left"] for i in (1, 2))
    assert pytest.approx((2615 + 2 * 1813) * across + o["F_y_c"], rel=1e-6, abs=1e-3) == F_Y
    # the body is held over the centre line at 1.8 m, the frame's mass lies at 0.6 m, the wheelsets' at 0.46 m
    frame = 2615 * (0.6 * across - G * down * at["y_b"])
    axles = sum(1813 * (0.46 * across - G * down * at[f"y_{i}"]) for i in (1, 2))
    gyroscopic = 2 * 112 * (V / 0.46) * V / radius
    held = o["F_y_c"] * 1.8 - o["M_x_c"]
    moment = sum((o[f"Q_{i}_right"] - o[f"Q_{i}_left"]) * 0.75 for i in (1, 2))
    shift = sum((o[f"Q_{i}_right"] + o[f"Q_{i}_left"]) * at[f"y_{i}"] for i in (1, 2))
    turned = gyroscopic + frame + axles + shift + held
    assert moment == pytest.approx(
        turned, abs=60
    )  # of 33 kN.m that an m/s2 of the body makes; omega shifts it


def test_leading_wheelset_runs_outwards_and_the_low_rail_is_pushed_outwards():
    at, o = settled(**curve(radius=600.0))
    assert at["y_1"] < at["y_b"] < at["y_2"]  # a curve to the left: right is outside
    assert min(o["Y_1_left"], o["Y_1_right"]) > 0  # the gauge is spread at the leading wheelset
    assert o["YQ_1_right"] > o["YQ_2_right"]


def test_free_wheelsets_roll_through_a_curve_at_the_shift_of_pure_rolling():
    """Without suspension: radii in proportion to the arcs, y = -r0 s / (R conicity)."""
    free = dict.fromkeys((*SPRINGS, *DAMPERS), 0.0) | {"k_sy": 1e6, "k_sz": 1e7, "k_pz": 1e7, "k_sx": 1e6}
    radius, V = 20e3, 20.0
    free |= {"h_s": 0.0, "h_p": 0.0, "m_c": 30000.0, "k_spin": 0.0}
    at = BOGIE.equilibrium(**curve(V, radius, V**2 / radius / G, creep_law=0.0, **free))
    for i in (1, 2):
        assert at[f"y_{i}"] < 0
        rolled = rolled_radii(at[f"y_{i}"])
        assert (rolled[0] - rolled[1]) / 0.46 == pytest.approx(-2 * 0.75 / radius, rel=0.05)


def rolled_radii(y):
    """Rolling radii left and right at a shift, m, by the contact table itself."""
    from fmus.contact import contact_table

    table = contact_table(shifts=[y])
    return float(table["r_left"].iloc[0]), float(table["r_right"].iloc[0])


@pytest.mark.parametrize(
    "changed", [{}, {"b_d": 0.0}, {"k_px": 5e6}, {"k_py": 1e6, "b_d": 0.0}, {"m_b": 4000.0, "a": 1.5}]
)
def test_critical_speed_is_that_of_the_state_matrix_by_hand(changed):
    """0.5 %: the contacts are found in different ways; with the declared values both agree to 0.01 %."""

    def growth(V):
        said = {"V": V, "creep_law": CODES["linear"], **changed}
        return np.linalg.eigvals(BOGIE.state_matrix(**said, **BOGIE.equilibrium(**said))).real.max()

    by_hand = bogie_linear.critical_speed(replace(bogie_linear.Parameters(), **changed))
    assert growth(0.995 * by_hand) < 0 < growth(1.005 * by_hand)


def test_modes_are_those_of_the_state_matrix_by_hand():
    p = bogie_linear.Parameters()
    found = np.linalg.eigvals(BOGIE.state_matrix(V=60.0, creep_law=CODES["linear"]))
    by_hand = np.linalg.eigvals(bogie_linear.state_matrix(60.0, p))
    for pole in by_hand[by_hand.imag > 1]:
        assert np.abs(found - pole).min() < 0.02 * abs(pole), pole


def test_worn_wheels_have_the_contacts_of_the_worn_profile():
    worn = Evaluated(Bogie(wheel="S1002_Hollow"))
    x = {"y_1": 3e-3, "psi_2": 1e-3, "y_2": -1e-3, "y_2_dot": 0.02}
    assert BOGIE.rates(**x, wear=1.0) == pytest.approx(worn.rates(**x), rel=1e-9, abs=1e-9)
    half, new, old = (BOGIE.outputs(**x, wear=w)["delta_1_right"] for w in (0.5, 0.0, 1.0))
    assert half == pytest.approx((new + old) / 2)
    assert abs(new - old) > 0.02


def test_the_worn_profile_can_be_chosen():
    same = Evaluated(Bogie(worn="S1002"))
    x = {"y_1": 3e-3, "psi_2": 1e-3}
    assert same.rates(**x, wear=1.0) == pytest.approx(BOGIE.rates(**x), rel=1e-9, abs=1e-9)
    with pytest.raises(BadInput, match="S1003"):
        Bogie(worn="S1003")


def test_a_lost_yaw_damper_is_a_change_of_a_component():
    from fmus.effects import EFFECTS

    effect = EFFECTS["damping_change"]
    built = Evaluated(Bogie([(effect, "secondary_yaw")]))
    (parameter,) = [n for n in built.names[Parameter] if n.endswith("_change")]
    x = {"psi_b_dot": 0.01}
    lost = built.rates(**x, **{parameter: -1.0})["psi_b_dot"]
    assert lost == pytest.approx(BOGIE.rates(**x, b_d=0.0)["psi_b_dot"], rel=1e-9)
