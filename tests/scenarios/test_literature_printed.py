"""What the sources print, run as printed, and the models for it: laws on short runs of their truth models."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.filters.bounds import bounded
from fmus.model import equations
from fmus.testrig.model import Testrig
from fmus.variables import Input, Output, Parameter, State
from scenarios.literature import ROWS
from scenarios.literature import contact_force_printed as printed
from scenarios.literature import friction_modes as modes
from scenarios.literature import rig_creep_force as by_fastsim
from scenarios.literature import secondary_stiffness as secondary
from scenarios.literature.case import TRUE, Record
from scenarios.literature.cone_model import MOTION, OUTPUTS, TANGENT, Cone, M, N, total_force, wheels
from scenarios.literature.contact_force_ekf import CONDITIONS, V
from scenarios.literature.contact_force_judged import JUDGED, gathered
from scenarios.literature.five_states import STEP, Q, five_states
from scenarios.literature.following import rmse
from scenarios.literature.wheelset import ALIGNMENT
from tests.helpers.native import native
from tests.helpers.rows import truth
from tests.helpers.rows_rig_fastsim import pull
from tests.truth import rig


def case_of(row, name, **changed):
    """A case of a row, shortened."""
    (found,) = (c for c in ROWS[row].cases if c.name == name)
    return replace(found, **changed)


# ---- the rule of the thesis for the secondary stiffness


def test_the_printed_rule_does_not_know_the_sign_and_least_squares_do():
    record = truth(case_of("secondary_stiffness", "static", duration=1.5))
    turned = Record({n: x if n == "time" else -x for n, x in record.columns.items()})
    fmu = native("vehicle7dof")
    one, other = (secondary.printed_rule(record, fmu, sign).value["k1"] for sign in (1.0, -1.0))
    assert one[0] - secondary.START == pytest.approx(secondary.START - other[0], rel=1e-6)
    assert np.abs(one - secondary.START).max() > 1e3  # N/m; it moves, and to the other side
    assert rmse(one - secondary.START, secondary.START - other) < 0.2 * np.std(one - other)
    same, again = (secondary.least_squares(r, fmu).value["k1"] for r in (record, turned))
    assert_allclose(same, again, rtol=1e-5)


# ---- the cone of Mal et al.


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-0.02, 0.02), min_size=4, max_size=4), st.sampled_from(sorted(CONDITIONS)))
def test_creep_forces_on_the_cone_oppose_creep_and_stay_within_friction(x, name):
    on = CONDITIONS[name]
    X = np.array([x]) * [0.3, 0.3, 20.0, 5.0]
    seen = wheels(V, X, 0.0, on["mu0"], on)
    for side in ("left", "right"):
        work = seen[f"xi_x_{side}"] * seen[f"F_x_{side}"] + seen[f"xi_y_{side}"] * seen[f"F_y_{side}"]
        assert work <= 0
        assert np.hypot(seen[f"F_x_{side}"], seen[f"F_y_{side}"]) <= 1.1 * on["mu0"] * N


def test_a_small_creep_on_the_cone_meets_the_slope_of_polach():
    on = CONDITIONS["dry"]
    creep = np.array([1e-8])
    slope = (on["k_A"] + on["k_S"]) / 2 * 4 * TANGENT / np.pi
    assert_allclose(total_force(V, creep, on["mu0"], on) / creep, slope, rtol=1e-4)


def test_the_wheelset_on_its_cone_runs_as_that_of_the_truth_model():
    case = case_of("contact_force_printed", "worst", duration=0.6, noise=dict.fromkeys(OUTPUTS, 0.0))
    record, every = truth(case), printed.EVERY
    cone = Cone(V, printed.surface(case), bounded((0.01, 0.8)))
    u, x = record.table(ALIGNMENT)[::every], np.zeros((1, 5))
    x[0, 4] = cone.transform.z(case.true["mu0"])
    rows = [x[0]]
    for a, b in pairwise(u):
        x, _ = cone.f(x, (a + b) / 2, 0.0, every * STEP, x)
        rows.append(x[0])
    states = np.array(rows)
    for i, name in ((2, "y_dot"), (3, "psi_dot")):
        true = record.columns[name + TRUE][::every]
        assert rmse(states[:, MOTION.index(name)], true) < 3e-3 * true.std(), i


def test_the_printed_states_stay_what_they_are_without_a_correction():
    """Creep, friction and force are functions of each other, which their rates keep but for Euler's error."""
    case = case_of("contact_force_printed", "dry", duration=0.5)
    on, t = printed.surface(case), case.times
    y_t, y_t_dot = 2e-3 * (1 - np.cos(8 * t)), 16e-3 * np.sin(8 * t)
    found = five_states(V, on, np.zeros((5, 5)), y_t, y_t_dot, np.zeros((len(t), 2)))
    creep = found.of("creep")
    assert found.lost is None
    assert np.abs(creep).max() > 1e-4
    force = np.sign(creep) * total_force(V, np.abs(creep), on["mu0"], on)
    assert_allclose(found.of("force"), force, atol=5e-3 * np.abs(force).max())
    friction = on["mu0"] * ((1 - on["A"]) * np.exp(-on["B"] * V * creep) + on["A"])
    assert_allclose(found.of("U"), friction, atol=1e-3)


def test_the_force_is_found_on_the_cone_by_motion_and_friction():
    case = case_of("contact_force_printed", "worst", duration=1.0)
    record = truth(case)
    seen, found = printed.ours(case, record)
    true = gathered({name: record.columns[name + TRUE][:: printed.EVERY] for name in JUDGED})
    late = found.t >= printed.START_UP
    assert rmse(seen["force"][late], true["force"][late]) < 0.1 * true["force"][late].std()
    assert M * record.columns["y_ddot"].std() > 100.0  # N: the wheelset is moved


def test_each_condition_has_its_printed_noise():
    assert set(Q) == set(CONDITIONS)


# ---- the rig by FASTSIM


@cache
def compiled(kind):
    """A rig of a kind with its equations."""
    model = kind()
    return model, equations(model)


def forces(kind, creep, **parameters):
    """Creep force of the rig at creeps (k,), from the outputs of its equations."""
    model, made = compiled(kind)
    values = {v.name: v.start for v in model.of(Parameter)} | parameters
    p = np.array([values[v.name] for v in model.of(Parameter)])
    at = [v.name for v in model.of(Output)].index("F_x")
    V_r, found = 4.0, []
    for c in creep:
        speeds = {"omega_r": V_r / values["r_r"], "omega_w": V_r * (1 - c) / values["r_w"]}
        x = [speeds.get(v.name, 0.0) for v in model.of(State)]
        u = [v.start or 0.0 for v in model.of(Input)]
        found.append(float(np.array(made.h(x, u, p)).ravel()[at]))
    return np.array(found)


CREEP = np.array([-4e-3, -5e-4, 1e-5, 3e-4, 1e-3, 3e-3, 2e-2])


def test_the_creep_force_of_the_rig_by_fastsim_is_that_of_the_truth():
    p = rig.Rig()
    true = [pull(p, 4.0, 4.0 * (1 - c)) for c in CREEP]
    found = forces(by_fastsim.RigByFastsim, CREEP, nu=0.25)
    # the truth has 100 x 100 cells and is interpolated over creep
    assert_allclose(found, true, atol=8e-3 * p.mu0 * p.N)
    assert_allclose(forces(Testrig, CREEP)[-1], found[-1], rtol=0.1)  # both laws end at the friction


def test_spin_on_the_rollers_takes_friction_from_braking():
    kind = by_fastsim.RigByFastsim
    upright, leaning, more = (np.abs(forces(kind, CREEP[2:], delta_w=d)) for d in (0.0, 0.05, 0.2))
    assert np.all(leaning <= upright * (1 + 1e-9))
    assert np.all(more < leaning)
    assert_allclose(forces(kind, CREEP, delta_w=-0.2), forces(kind, CREEP, delta_w=0.2), rtol=1e-9)
    # with one equivalent radius two rollers are one of that radius on a plane
    r, other = 1 / (1 / 0.3 + 1 / 0.6), {"r_w": 2 * 0.2, "r_r": 2 * 0.2}
    assert r == pytest.approx(0.2)
    assert_allclose(
        forces(kind, CREEP, delta_w=0.1, r_w=0.3, r_r=0.6),
        forces(kind, CREEP, delta_w=0.1, **other),
        rtol=1e-9,
    )


# ---- several models


def test_the_true_condition_follows_the_jumps():
    case = case_of("friction_modes", "dry-low")
    assert modes.condition(case, np.array([0.0, case.when, 6.0])).tolist() == [0, 2, 2]
    assert modes.condition(case_of("friction_modes", "between wet and low"), np.zeros(3)) is None
