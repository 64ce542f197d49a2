"""Contact forces by an EKF, and nonlinear conicity: laws on short runs of their truth models."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from typer.testing import CliRunner

from scenarios.cli.app import loaded
from scenarios.literature import ROWS
from scenarios.literature import conicity as cone
from scenarios.literature import contact_force_ekf as contact
from scenarios.literature.case import TRUE
from scenarios.literature.conicity_fits import one_cubic, piecewise, shift_of
from scenarios.literature.conicity_model import (
    DT,
    HALF,
    MOTION,
    R0,
    Along,
    V,
    Wheelset,
    equations,
)
from scenarios.literature.conicity_run import generic, response
from scenarios.literature.conicity_table import Tabled
from scenarios.literature.contact_force_judged import JUDGED, Judged, gathered
from scenarios.literature.following import rmse
from tests.helpers.native import native
from tests.helpers.rows import truth
from tests.helpers.rows_charles import conicity

NOTHING = np.empty(0)


def case_of(row, name, **changed):
    """A case of a row, shortened."""
    (found,) = (c for c in ROWS[row].cases if c.name == name)
    return replace(found, **changed)


# ---- contact forces


def judged(case, way):
    """A filter's way through a case."""
    record, fmu = truth(case), native("wheelset")
    true = gathered({name: record.columns[name + TRUE] for name in JUDGED})
    shape = contact.Shaped("y_irr", contact.DEVIATION, 1.0, "y_irr_dot") if way == contact.OUTPUTS else None
    found = contact.followed(case, record, fmu, shape)
    return Judged(case, way, found, true, contact.seen(case, record, found, fmu))


def test_creep_forces_stay_within_what_friction_allows_and_oppose_creep():
    record = truth(case_of("contact_force_ekf", "worst", duration=2.0))
    true = {name: record.columns[name + TRUE] for name in JUDGED}
    force = gathered(true)["force"]
    limit = contact.CONDITIONS["worst"]["mu0"] * contact.PLANT["F_n"]
    assert 0.3 * limit < force.max() < 1.1 * limit  # the spin's part comes on top
    for side in ("left", "right"):
        assert np.all(true[f"xi_x_{side}"] * true[f"F_x_{side}"] <= 0)


@pytest.mark.slow
@pytest.mark.parametrize("way", contact.WAYS)
def test_motion_creep_and_force_are_found_from_two_sensors(way):
    one = judged(case_of("contact_force_ekf", "worst", duration=4.0), way)
    assert not one.found.reason
    late = one.found.t >= 0.5
    for quantity in ("y_dot", "psi_dot", "force"):
        off = one.error(quantity)[late]
        assert rmse(off, np.zeros_like(off)) < 0.05, quantity
    assert one.found.value["mu0"][-1] == pytest.approx(0.1, abs=0.03)


def test_a_transition_makes_a_spike_that_passes():
    case = case_of("contact_force_ekf", "transition", duration=5.0, when=2.0)
    case = replace(case, later=contact.CONDITIONS["worst"], further=())
    one = judged(case, contact.WAYS[1])
    (spike,) = one.spikes().values()
    assert spike > 2 * one.calm()
    assert one.found.value["mu0"][-1] == pytest.approx(0.1, abs=0.02)


# ---- conicity


def test_sampled_equations_are_the_continuous_ones():
    rng = np.random.default_rng(1)
    X = rng.normal(size=(5, len(MOTION) + 2)) * 1e-3
    X[:, -2] = (0.0, 0.1, 0.2, 0.5, 1.0)
    moved, _ = Wheelset(Along()).f(X, NOTHING, 0.0, DT, NOTHING)
    for x, found in zip(X, moved, strict=True):
        expected = expm(equations(x[-2]) * DT) @ np.append(x[: len(MOTION)], x[-1])
        np.testing.assert_allclose(found[: len(MOTION)], expected[:-1], rtol=1e-6, atol=1e-12)
        np.testing.assert_array_equal(found[len(MOTION) :], x[len(MOTION) :])


def test_a_free_wheelset_runs_in_the_wave_of_klingel():
    free = equations(0.1)[:4, :4].copy()  # no suspended mass, whose spring would hold it
    free[3, 1] = 0.0
    fastest = np.linalg.eigvals(free)
    wave = np.abs(fastest[np.argmin(np.abs(fastest))])
    assert wave == pytest.approx(V * np.sqrt(0.1 / (R0 * HALF)), rel=0.25)


def test_a_table_learns_a_curve_and_keeps_what_it_has_not_seen():
    nodes = 1e-3 * np.arange(-6.0, 6.1, 1.0)
    table = Tabled(nodes, 0.15, 0.1, memory=1.0)
    rng = np.random.default_rng(2)
    for shift in rng.uniform(-6e-3, 3e-3, 3000):
        table.learn(shift, 0.1 + 10 * abs(shift), 1e-4)
    inner = nodes < 2.5e-3
    np.testing.assert_allclose(table.values[inner], 0.1 + 10 * np.abs(nodes[inner]), atol=5e-3)
    assert table.values[-1] == 0.15


def test_least_squares_find_the_conicity_where_one_cubic_cannot():
    record = truth(case_of("conicity", "generic", duration=16.0))
    low, high = np.percentile(shift_of(record), (2, 98))
    shift = np.linspace(low, high, 100)
    rough, fine = (rmse(fit(record)(shift), conicity(shift)) for fit in (one_cubic, piecewise))
    assert fine < 5e-3
    assert rough > 5 * fine


@pytest.mark.slow
def test_the_irregularity_must_be_estimated_along():
    record = truth(case_of("conicity", "generic", duration=12.0))
    late, true = record.t > 2.0, record.columns["conicity" + TRUE]
    spread = true[late].std()
    errors = []
    for way in cone.WAYS[:2]:
        found, _ = cone.followed(way, record)
        errors.append(rmse(found.value["conicity"][late], true[late]) / spread)
    constant, along = errors
    assert constant > 1.0
    assert along < 0.5


def test_an_irregularity_that_was_lost_is_found_again():
    record = truth(case_of("conicity", "generic", duration=12.0, seed=5))
    found, _ = cone.followed("irregularity too", record)
    late = record.t > 2.0
    # less than without any estimate; as a random walk it went off by 38 mm
    assert rmse(found.value["d"][late], record.columns["y_irr"][late]) < cone.DEVIATION


def stepped(height, length=3.0):
    """Times, and the response to a step at 0.2 s."""
    t = DT * np.arange(round(length / DT))
    return t, response(np.where(t >= 0.2, height, 0.0))


def test_the_response_to_a_step_is_the_second_programs_and_ends_on_the_new_centre_line():
    case = case_of("conicity_step", "10 mm", duration=4.0)
    outcome = ROWS["conicity_step"].rebuilt([(case, truth(case))], None, print)
    assert outcome.aimed == 5
    assert outcome.ok


def test_a_step_to_the_other_side_is_answered_by_the_mirrored_motion():
    (_, left), (_, right) = stepped(10e-3, 1.0), stepped(-10e-3, 1.0)
    for name in ("y", "psi", "y_m"):
        np.testing.assert_allclose(left[name], -right[name], atol=1e-15)
    np.testing.assert_allclose(left["conicity"], right["conicity"])


def test_a_small_step_is_answered_in_proportion_and_a_large_one_faster():
    (t, small), (_, half), (_, large) = (stepped(height, 1.0) for height in (2e-4, 1e-4, 10e-3))
    assert np.abs(small["y"] / 2e-4 - half["y"] / 1e-4).max() < 1e-2
    reached = [t[np.argmax(y["y"] > h / 2)] for y, h in ((small, 2e-4), (large, 10e-3))]
    assert reached[1] < 0.2 + 0.6 * (reached[0] - 0.2)  # the root of a flange steers harder than the tread


def test_the_last_of_a_response_is_made_of_the_slow_modes_of_the_linear_equations():
    _, found = stepped(1e-4)
    rest = found["y"][round(1.2 / DT) :] - 1e-4
    n = len(MOTION)
    values = np.linalg.eigvals(equations(float(generic(np.zeros(1))[0]))[:n, :n])
    slow = values[(values.real > -10) & (values.imag > 0)]
    assert len(slow) == 2
    turning = np.exp(np.outer(DT * np.arange(len(rest)), slow))
    waves = np.hstack([turning.real, turning.imag])
    part, *_ = np.linalg.lstsq(waves, rest, rcond=None)
    assert rmse(waves @ part, rest) < 0.01 * np.sqrt(np.mean(rest**2))


def test_a_row_with_equations_of_its_own_makes_its_records():
    case = case_of("conicity", "generic", duration=2.0)
    record = cone.simulated(None)(case)
    assert set(record.columns) == set(case.columns)
    assert record.columns["y_irr"].std() == pytest.approx(cone.DEVIATION)
    seen, true = record.columns["y_ddot"], record.columns["conicity" + TRUE]
    assert np.isfinite(seen).all()
    np.testing.assert_allclose(true, conicity(shift_of(record)), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["contact_force_ekf", "conicity", "conicity_step"])
def test_the_whole_row_meets_its_targets(tmp_path, name):
    from scenarios.literature import run_row

    outcome = run_row(name, tmp_path, truth, native("wheelset"))
    assert not outcome.missed


# ---- the command


def test_the_command_lists_the_rows():
    found = CliRunner().invoke(loaded(["row"]), ["row"])
    assert found.exit_code == 0
    assert all(name in found.stdout for name in ROWS)


@pytest.mark.slow
def test_the_command_rebuilds_a_row_from_records(tmp_path):
    case = case_of("conicity", "generic", duration=4.0)
    truth(case).write(tmp_path / "records" / "generic.csv")
    out = tmp_path / "out"
    chosen = [
        "row",
        "conicity",
        "--records",
        str(tmp_path / "records"),
        "--case",
        "generic",
        "--out",
        str(out),
    ]
    found = CliRunner().invoke(loaded(["row"]), chosen)
    assert found.exit_code in (0, 1)  # four seconds need not meet the targets
    assert (found.exit_code == 1) == ("not met" in found.stdout)
    assert (out / "table.md").stat().st_size > 0
