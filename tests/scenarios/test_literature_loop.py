"""The loop of irregularity and geometry, records by the FMU, and what the friction paper names next."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact import contact_table
from scenarios.literature import ROWS, run_row
from scenarios.literature import conicity as cone
from scenarios.literature import friction_tuning as tuning
from scenarios.literature import friction_ukf as friction
from scenarios.literature import profile_loop as loop
from scenarios.literature import profile_rls as profile
from scenarios.literature.case import TRUE, Record
from scenarios.literature.conicity_fits import CUBIC, Fit, knots_of, piecewise, shift_of
from scenarios.literature.conicity_hybrid import OnCurve, flat
from scenarios.literature.conicity_model import DT, MOTION, Curved
from scenarios.literature.following import moving_mean, rmse
from scenarios.literature.linear_creep import LIMIT, by_fmu
from tests.helpers.native import native
from tests.helpers.rows import truth
from tests.helpers.rows_charles import conicity, of_charles


def case_of(row, name, **changed):
    """A case of a row, shortened."""
    (found,) = (c for c in ROWS[row].cases if c.name == name)
    return replace(found, **changed)


# ---- irregularity and geometry in a loop


@pytest.mark.parametrize("gauge", [1.432, 1.435, 1.438])
def test_the_wheelset_rolls_by_the_sum_of_its_contact_angles(gauge):
    """The law that closes the loop, against the contact table, whose roll is that of both contacts."""
    shifts = np.linspace(-4e-3, 4e-3, 801)
    table = contact_table(r0=profile.R0, gauge=gauge, search="rigid", shifts=shifts)
    phi, total = table["phi"].to_numpy(), (table["delta_left"] + table["delta_right"]).to_numpy()
    found = loop.rolled(total, phi, centred=float(np.interp(0.0, shifts, phi)))
    assert_allclose(found.shift, shifts, atol=0.06 * 4e-3)
    half = loop.rolled(total / 2, phi, centred=0.0)
    assert np.ptp(half.shift) == pytest.approx(2 * np.ptp(found.shift), rel=0.03)


def test_a_cone_rolls_in_proportion():
    total, roll = np.full(101, 0.2), np.linspace(-1e-4, 1e-4, 101)
    found = loop.rolled(total, roll, centred=0.0)
    assert_allclose(found.shift, roll * (2 * loop.HALF / 0.2 - loop.R0), atol=1e-12)
    assert_allclose(found.shift_at(roll), found.shift)


@pytest.fixture(scope="module")
def known():
    """A record, its true shift, and what each assumption leads to."""
    record = truth(case_of("profile_loop", "alignment", duration=60.0))
    shift = record.columns["y"] - record.columns["y_irr"]
    return record, shift, {n: loop.looped(record, a) for n, a in loop.assumptions().items()}


def off(one, shift):
    return rmse(one.shift, shift) / shift.std()


@pytest.mark.slow
def test_the_loop_leads_from_different_assumptions_to_the_same_geometry(known):
    _, shift, found = known
    for rounds in found.values():
        assert off(rounds[-1], shift) < 0.5 * off(rounds[0], shift)
    one, other = (rounds[-1].shift for rounds in found.values())
    assert rmse(one, other) < 0.05 * shift.std()


@pytest.mark.slow
def test_least_squares_in_bins_of_the_true_shift_find_the_geometry_within_their_errors(known):
    record, shift, _ = known
    bins, true = loop.in_bins(record, shift), profile.geometry()
    for i in (0, 2):  # the sums, which the record says least of
        wanted = np.interp(bins.shift, true.shift, true.value[:, i])
        assert np.median(np.abs(bins.value[:, i] - wanted) / bins.std[:, i]) < 2.0
    for i in (1, 3):
        wanted = np.interp(bins.shift, true.shift, true.value[:, i])
        assert rmse(bins.value[:, i], wanted) < 1e-3 * np.ptp(wanted)


@pytest.mark.slow
def test_without_an_ideal_roll_the_loop_does_not_close(known):
    record, shift, found = known
    start = next(iter(loop.assumptions().values()))
    blurred = loop.looped(loop.noisy(record, 1e-6, seed=1), start)
    assert off(blurred[-1], shift) > 2 * off(next(iter(found.values()))[-1], shift)


@pytest.mark.slow
def test_every_assumption_is_judged_and_drawn(known):
    record, _, _ = known
    short = Record({n: x[:4000] for n, x in record.columns.items()})
    outcome = loop.rebuilt([(case_of("profile_loop", "alignment"), short)], fmu=None, tell=print)
    for name in loop.assumptions():
        assert sum(f.what.startswith(name) for f in outcome.findings) >= 9
    assert sum(f.target is not None for f in outcome.findings) == len(loop.assumptions())
    assert len(outcome.plots) == 1


# ---- records by the wheelset FMU, for filters that have equations of their own


@pytest.mark.parametrize(("row", "name"), [("profile_rls", "gauge too"), ("conicity", "S1002 on 60E1")])
def test_the_fmu_makes_the_records_of_other_equations(row, name):
    case = case_of(row, name, duration=2.0)
    record = by_fmu(native("wheelset"))(case)
    assert set(record.columns) == set(case.columns)
    assert all(np.isfinite(x).all() for x in record.columns.values())
    size, sd = np.abs(record.columns["y_irr"]), case.true["alignment_sd"]
    assert 0.5 * sd < record.columns["y_irr"].std() <= sd * (1 + 1e-9)
    assert size.max() <= LIMIT * sd * (1 + 1e-9)


def test_the_fmus_record_obeys_the_rows_equations():
    """Ward's eq. 1 and 2 with the contact table's geometry: what is left is small against their terms."""
    case = case_of("profile_rls", "alignment", duration=6.0)
    record = by_fmu(native("wheelset"))(case)
    X, rest = profile.regression(record)
    true, shift = profile.geometry(), record.columns["y"] - record.columns["y_irr"]
    at = np.column_stack([np.interp(shift, true.shift, v) for v in true.value.T])
    at -= (2 * profile.R0, 0.0, 0.0, 0.0)
    left = rest - np.einsum("nij,nj->ni", X[:, :, :4], at)
    assert np.all(left.std(axis=0) < 0.02 * rest.std(axis=0))


# ---- conicity by a hybrid, several models and particles


@pytest.mark.parametrize("seed", range(3))
def test_the_derivatives_of_the_wheelset_on_a_curve_are_those_of_its_equations(seed):
    rng, nothing = np.random.default_rng(seed), np.empty(0)
    knots = knots_of(-5e-3, 5e-3)
    from scipy.interpolate import BSpline

    curve = Fit(BSpline(knots, rng.uniform(0.05, 0.4, len(knots) - CUBIC - 1), CUBIC))
    system = OnCurve(Curved(curve, 0.99), curve=curve)
    x, e = 1e-3 * rng.standard_normal(len(MOTION) + 1), 1e-8 * np.eye(len(MOTION) + 1)

    def slope(f):
        return np.array([(f(x + a)[0] - f(x - a)[0]) / 2e-8 for a in e]).T

    F = slope(lambda x: system.f(x[None], nothing, 0.0, DT, nothing)[0])
    H = slope(lambda x: system.h(x[None], nothing, 0.0, nothing))
    assert_allclose(system.dfdx(x, nothing, 0.0, DT, nothing), F, atol=1e-6 * np.abs(F).max())
    assert_allclose(system.dhdx(x, nothing, 0.0, nothing), H, atol=1e-6 * np.abs(H).max())


@pytest.fixture(scope="module")
def generic():
    return truth(case_of("conicity", "generic", duration=12.0))


@pytest.mark.slow
def test_filter_and_least_squares_in_turns_find_the_curve_that_neither_knew(generic):
    found = cone.in_turns(generic)
    low, high = np.percentile(shift_of(generic), (5, 95))
    at = np.linspace(low, high, 60)
    assert rmse(found.curve(at), conicity(at)) < 0.5 * rmse(flat(cone.GUESS)(at), conicity(at))
    assert rmse(found.curve(at), conicity(at)) > rmse(
        piecewise(generic)(at), conicity(at)
    )  # which know the track


@pytest.mark.slow
def test_it_is_the_roll_of_the_source_that_tells_conicity_from_irregularity(generic):
    """A wheelset that rolls over the track, as real ones do, loses the hybrid's curve."""
    real = of_charles(case_of("conicity", "generic", duration=12.0), rolls_over_track=True)
    errors = []
    for record in (generic, real):
        at = np.linspace(*np.percentile(shift_of(record), (5, 95)), 60)
        errors.append(rmse(cone.in_turns(record).curve(at), conicity(at)))
    assert errors[1] > 5 * errors[0]


@pytest.mark.parametrize("way", cone.BANKS)
@pytest.mark.slow
def test_several_models_and_particles_follow_the_conicity_from_the_outputs_alone(generic, way):
    found, late = cone.banked(way, generic, seed=1), generic.t > cone.START_UP
    true = generic.columns["conicity" + TRUE][late]
    assert not found.reason
    assert rmse(found.value["conicity"][late], true) < 0.6 * true.std()
    assert np.all(found.std["conicity"] > 0)


# ---- the friction paper


@given(st.lists(st.floats(-10, 10), min_size=1, max_size=40), st.integers(1, 50))
def test_a_moving_mean_is_that_of_the_last_samples(values, samples):
    x = np.array(values)
    direct = [x[max(0, i + 1 - samples) : i + 1].mean() for i in range(len(x))]
    assert_allclose(moving_mean(x, samples), direct, atol=1e-9)


def test_the_moving_mean_comes_late_by_half_its_window():
    t = np.arange(0.0, 10.0, 0.1)
    assert_allclose((t - moving_mean(t, 21))[30:], 1.0, atol=1e-9)


def test_noise_that_is_declared_too_small_is_found_while_the_filter_runs():
    case = case_of("friction_tuning", "wet", duration=6.0)
    record, fmu = truth(case), native("wheelset")
    found = {way: tuning.followed(way, case, record, fmu) for way in (tuning.WRONG, tuning.WRONG_ADAPTIVE)}
    assert found[tuning.WRONG].nis > 50.0  # of 4
    assert found[tuning.WRONG_ADAPTIVE].nis < 15.0
    assert found[tuning.WRONG_ADAPTIVE].std["mu0"][-1] > 2 * found[tuning.WRONG].std["mu0"][-1]


@pytest.mark.slow
def test_noise_that_adapts_from_a_tenth_costs_next_to_nothing_in_the_whole_row(tmp_path):
    outcome = run_row("friction_tuning", tmp_path, truth, native("wheelset"))
    assert outcome.aimed == 3
    assert outcome.ok


def test_a_filter_without_adaptation_is_that_of_the_friction_row():
    case = case_of("friction_tuning", "wet", duration=1.0)
    record, fmu = truth(case), native("wheelset")
    found = tuning.followed(tuning.RIGHT, case, record, fmu)
    same = friction.task(case, fmu).known(record)
    assert_allclose(found.value["mu0"], same.value["mu0"], atol=0)
