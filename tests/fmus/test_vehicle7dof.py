"""The vehicle: modes, symmetry, energy, and each corner by hand."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.host.fmu import Fmu
from fmus.vehicle7dof.model import CORNERS, FORCES
from tests.helpers.vehicle_equations import (
    BOGIE,
    END,
    INERTIA,
    OUTPUTS,
    SIDE,
    STATES,
    P,
    accelerations,
    each_corner,
    forces,
    healths,
    modes,
    motions,
    outputs,
    pushes,
    rails,
    settled,
)
from tests.truth.vehicle import Vehicle


def test_parameters_are_those_of_the_thesis_and_of_the_truth():
    assert {f.name: f.default for f in fields(Vehicle)} == {
        n: v for n, v in P.items() if not n.startswith("h_")
    }
    assert {v for n, v in P.items() if n.startswith("h_")} == {1.0}


def test_modes_with_two_springs_on_each_bogie_side():
    frequency, damping = modes()
    # references rounded at the fourth decimal
    assert_allclose(frequency, [0.8095, 1.0802, 1.3106, 7.4114, 7.4271, 9.1661, 9.1888], rtol=1e-4)
    assert_allclose(damping, [0.1014, 0.1345, 0.1625, 0.2406, 0.2367, 0.2856, 0.2816], rtol=1e-3)


def test_modes_with_one_spring_on_each_bogie_side():
    frequency, _ = modes(n_primary=1.0)
    assert_allclose(frequency, [0.7547, 1.0054, 1.2189, 5.6350, 5.6422, 6.9527, 6.9672], rtol=1e-4)


@given(motions, rails)
def test_n_springs_are_n_times_a_spring(x, u):
    three = accelerations(x, u, n_primary=3.0)
    stiffer = accelerations(x, u, n_primary=1.0, k2=3 * P["k2"], b2=3 * P["b2"])
    assert_allclose([*three.values()], [*stiffer.values()], rtol=1e-9, atol=1e-9)


@given(healths, st.floats(5.0, 15.0), st.floats(0.5, 1.5))
def test_a_uniform_step_is_followed_whatever_the_health(health, a1, c1):
    u = {f"u_{c}": 1e-3 for c in CORNERS}
    found = settled(u, **health, a1=a1, c1=c1)
    expected = {q: 1e-3 if q in ("z1", "z2", "z3") else 0.0 for q in STATES}
    assert_allclose([found[n] for n in STATES], [*expected.values()], atol=1e-12)


def test_a_uniform_step_settles_with_gain_one_in_the_fmu(built):
    t = np.linspace(0, 30, 1501)
    inputs = {f"u_{c}": np.full(1500, 1e-3) for c in CORNERS}
    names = [*FORCES, "d_s_fl", "d_p_rr"]
    with Fmu(built("vehicle7dof")) as fmu:
        run = fmu.simulate(t, inputs, names, {})
    # coach roll is not moved and bounce has decayed to exp(-27)
    assert_allclose(run[-1], [1e-3, 0, 0, 1e-3, 0, 1e-3, 0, 0, 0], atol=1e-10)
    assert run[:, 0].max() > 1.3e-3  # it swung


def test_cross_level_rolls_all_bodies_alike():
    found = settled({f"u_{c}": SIDE[c] * 1e-3 for c in CORNERS})
    rolls = {"phi_x1", "phi_x2", "phi_x3"}
    assert_allclose([found[q] for q in FORCES], [1e-3 if q in rolls else 0.0 for q in FORCES], atol=1e-12)


def test_a_front_that_is_higher_pitches_the_coach_upwards():
    found = settled({f"u_{c}": END[c] * 1e-3 for c in CORNERS})
    expected = {"phi_y1": -1e-3 / P["a1"], "z2": 1e-3, "z3": -1e-3}
    assert_allclose([found[q] for q in FORCES], [expected.get(q, 0.0) for q in FORCES], atol=1e-12)


def test_twist_rolls_the_bogies_against_each_other():
    found = settled({f"u_{c}": SIDE[c] * END[c] * 1e-3 for c in CORNERS})
    primary, secondary = P["n_primary"] * P["k2"] * P["c2"] ** 2, P["k1"] * P["c1"] ** 2
    phi = primary / (primary + secondary) * 1e-3 / P["c2"]  # the coach does not roll and holds it back
    expected = {"phi_x2": phi, "phi_x3": -phi}
    assert_allclose([found[q] for q in FORCES], [expected.get(q, 0.0) for q in FORCES], atol=1e-12)


@each_corner
@pytest.mark.parametrize(("what", "element"), [("", "k2"), ("_dot", "b2")])
def test_a_rail_under_a_corner_pushes_its_bogie_alone(c, what, element):
    found = forces(u={f"u_{c}{what}": 1e-3})
    push = P["n_primary"] * P[element] * 1e-3
    expected = {f"z{BOGIE[c]}": push, f"phi_x{BOGIE[c]}": SIDE[c] * P["c2"] * push}
    assert_allclose([found[q] for q in FORCES], [expected.get(q, 0.0) for q in FORCES], atol=1e-9)


@pytest.mark.parametrize(("what", "k1", "k2"), [("", "k1", "k2"), ("_dot", "b1", "b2")])
@pytest.mark.parametrize(
    ("coordinate", "expected"),  # on z1 phi_y1 phi_x1 z2 phi_x2 z3 phi_x3: times s secondary, p primary
    [
        ("z1", lambda s, p, a, c: (-4 * s, 0, 0, 2 * s, 0, 2 * s, 0)),
        ("phi_y1", lambda s, p, a, c: (0, -4 * a * a * s, 0, -2 * a * s, 0, 2 * a * s, 0)),
        ("phi_x1", lambda s, p, a, c: (0, 0, -4 * c * c * s, 0, 2 * c * c * s, 0, 2 * c * c * s)),
        ("z2", lambda s, p, a, c: (2 * s, -2 * a * s, 0, -2 * s - 2 * p, 0, 0, 0)),
        ("phi_x2", lambda s, p, a, c: (0, 0, 2 * c * c * s, 0, -2 * c * c * s - 2 * p, 0, 0)),
        ("z3", lambda s, p, a, c: (2 * s, 2 * a * s, 0, 0, 0, -2 * s - 2 * p, 0)),
        ("phi_x3", lambda s, p, a, c: (0, 0, 2 * c * c * s, 0, 0, 0, -2 * c * c * s - 2 * p)),
    ],
)
def test_each_coordinate_by_hand(coordinate, expected, what, k1, k2):
    q, c = 1e-3, 1.2  # c2 stays 1 m, so that the two widths are told apart
    found = forces({f"{coordinate}{what}": q}, c1=c)
    by_hand = expected(P[k1], P["n_primary"] * P[k2], P["a1"], c)
    assert_allclose([*found.values()], np.multiply(by_hand, q), atol=1e-9)


@each_corner
def test_deflections_are_heights_of_points_less_each_other(c):
    x = {q: 1e-3 * i for i, q in enumerate(STATES, 1)}
    u = {f"u_{c}": 0.02, f"u_{c}_dot": 0.03}
    found, i, y = outputs(x, u), BOGIE[c], SIDE[c] * P["c1"]
    for end in ("", "_dot"):
        coach = x[f"z1{end}"] - END[c] * P["a1"] * x[f"phi_y1{end}"] + y * x[f"phi_x1{end}"]
        bogie = x[f"z{i}{end}"] + y * x[f"phi_x{i}{end}"]  # c1 = c2
        assert found[f"d_s_{c}{end}"] == pytest.approx(coach - bogie, rel=1e-12)
        assert found[f"d_p_{c}{end}"] == pytest.approx(bogie - u[f"u_{c}{end}"], rel=1e-12)


def mirrored(by_name, corners, turned):
    """Values as seen in a mirror: corners changed places, some coordinates turned round."""
    found = {}
    for name, value in by_name.items():
        stem, _, c = name.removesuffix("_dot").rpartition("_")
        end = "_dot" if name.endswith("_dot") else ""
        coordinate = name.removesuffix("_dot")
        if c in corners:
            found[f"{stem}_{corners[c]}{end}"] = value
        else:
            new, sign = turned.get(coordinate, (coordinate, 1))
            found[f"{new}{end}"] = sign * value
    return found


LEFT_RIGHT = (
    {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"},
    {q: (q, -1) for q in ("phi_x1", "phi_x2", "phi_x3")},
)
FRONT_REAR = (
    {"fl": "rl", "rl": "fl", "fr": "rr", "rr": "fr"},
    {
        "phi_y1": ("phi_y1", -1),
        **{f"{q}{i}": (f"{q}{j}", 1) for q in ("z", "phi_x") for i, j in ((2, 3), (3, 2))},
    },
)


@pytest.mark.parametrize("mirror", [LEFT_RIGHT, FRONT_REAR], ids=["left-right", "front-rear"])
@given(motions, rails, healths)
def test_a_mirror_shows_the_same_vehicle(mirror, x, u, health):
    here = mirrored(accelerations(x, u, **health), *mirror)
    there = accelerations(mirrored(x, *mirror), mirrored(u, *mirror), **mirrored(health, *mirror))
    assert_allclose([there[q] for q in FORCES], [here[q] for q in FORCES], rtol=1e-9, atol=1e-9)


def power(x, u, p):
    """Rate of energy, dissipation, power of rails and of outer forces, W; and the energy, J."""
    y, p = outputs(x, u, **p), P | p
    energy = sum(p[INERTIA[q]] * x[f"{q}_dot"] ** 2 / 2 for q in FORCES)
    rate = sum(p[INERTIA[q]] * x[f"{q}_dot"] * y[f"{q}_ddot"] for q in FORCES)
    lost, rail = 0.0, 0.0
    for c in CORNERS:
        for n, k, b, d in ((1.0, "k1", "b1", f"d_s_{c}"), (p["n_primary"], "k2", "b2", f"d_p_{c}")):
            k_c, b_c = n * p[k] * p[f"h_{k}_{c}"], n * p[b] * p[f"h_{b}_{c}"]
            energy += k_c * y[d] ** 2 / 2
            rate += k_c * y[d] * y[f"{d}_dot"]
            lost += b_c * y[f"{d}_dot"] ** 2
            if d.startswith("d_p"):
                rail -= (k_c * y[d] + b_c * y[f"{d}_dot"]) * u[f"u_{c}_dot"]
    outer = sum(u.get(force, 0.0) * x[f"{q}_dot"] for q, force in FORCES.items())
    return rate, lost, rail, outer, energy


@given(motions, rails, pushes, healths)
def test_power_of_rails_and_forces_is_stored_or_dissipated(x, u, push, health):
    rate, lost, rail, outer, _ = power(x, u | push, health)
    assert lost >= 0
    # the terms cancel: to 1e-9 of their size, and of 1 W where all are small
    assert abs(rate + lost - rail - outer) <= 1e-9 * (abs(rate) + lost + abs(rail) + abs(outer) + 1)


def test_energy_of_a_run_is_the_work_done_on_it(built):
    t = np.linspace(0, 5, 5001)
    waves = {
        c: (2e-3, 2 * np.pi * f, phase) for c, f, phase in zip(CORNERS, (1, 1.7, 5, 9), range(4), strict=True)
    }
    u = {f"u_{c}": a * np.sin(w * t + phase) for c, (a, w, phase) in waves.items()}
    u |= {f"u_{c}_dot": a * w * np.cos(w * t + phase) for c, (a, w, phase) in waves.items()}
    u["F_z1_ext"] = 1e3 * np.sin(7 * t)
    with Fmu(built("vehicle7dof")) as fmu:
        run = fmu.simulate(t, {n: (v[1:] + v[:-1]) / 2 for n, v in u.items()}, STATES, {"z1": 5e-3})
    flows = np.array(
        [
            power(dict(zip(STATES, row, strict=True)), {n: float(v[k]) for n, v in u.items()}, {})
            for k, row in enumerate(run.tolist())
        ]
    )
    _, lost, rail, outer, energy = flows.T
    net = np.trapezoid(rail + outer - lost, t)
    done = np.trapezoid(np.abs(rail) + np.abs(outer) + lost, t)
    # inputs held over 1 ms and the trapezoidal rule: both of second order, (w dt)^2/12 = 3e-4 at 9 Hz
    assert abs(energy[-1] - energy[0] - net) < 3e-4 * done
    assert done > 10 * abs(energy[-1] - energy[0])


@each_corner
@pytest.mark.parametrize("element", ["k1", "b1", "k2", "b2"])
@given(x=motions, u=rails, health=st.floats(0.0, 3.0))
def test_a_health_factor_changes_its_element_alone(c, element, x, u, health):
    sound, ill = outputs(x, u), outputs(x, u, **{f"h_{element}_{c}": health})
    moved = {q: (ill[f"{q}_ddot"] - sound[f"{q}_ddot"]) * P[INERTIA[q]] for q in FORCES}
    secondary = element[1] == "1"
    d = sound[f"d_{'s' if secondary else 'p'}_{c}{'_dot' if element[0] == 'b' else ''}"]
    force = (1 - health) * P[element] * d * (1.0 if secondary else P["n_primary"])
    y, i = SIDE[c] * P["c1"], BOGIE[c]
    up = {f"z{i}": force, f"phi_x{i}": y * force}
    if secondary:
        up = {q: -f for q, f in up.items()}
        up |= {"z1": force, "phi_y1": -END[c] * P["a1"] * force, "phi_x1": y * force}
    size = 1e-12 * sum(abs(a) for a in sound.values()) * P["J_y1"]
    assert_allclose([moved[q] for q in FORCES], [up.get(q, 0.0) for q in FORCES], atol=1e-9 + size)
    same = [n for n in OUTPUTS if n.startswith("d_")]
    assert [ill[n] for n in same] == [sound[n] for n in same]
