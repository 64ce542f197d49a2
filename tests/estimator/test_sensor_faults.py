"""What holds for every sensor fault."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.screening.candidates import fault_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.screen import screen
from estimator.sensor_faults import FAULTS, faulty
from fmus.export.builders.hypotheses import ModelBuilder
from fmus.units import base_exponents
from tests.helpers.carriage import T as TIMES
from tests.helpers.carriage import problem, record, viscous

T = 3.0 + np.linspace(0.0, 10.0, 2001)
Y = 0.3 + np.sin(2.0 * T)


@pytest.fixture(params=FAULTS)
def fault(request):
    return FAULTS[request.param]


def size(fault):
    return fault.size(float(np.std(Y)), float(T[-1] - T[0]), float(T[1] - T[0]))


def test_zero_is_off(fault):
    assert np.array_equal(fault.apply(Y, T, 0.0), Y)


def test_a_realistic_size_shows_and_a_part_of_it_in_proportion(fault):
    kept = Y.copy()
    change, part = (fault.apply(Y, T, share * size(fault)) - Y for share in (1.0, 0.1))
    assert np.array_equal(kept, Y)
    assert np.std(change) + abs(np.mean(change)) > 1e-3 * np.std(Y)
    # a late channel begins with its first value; 5 %: what a fault may depart from its first order
    assert_allclose(10 * part[10:], change[10:], atol=0.05 * np.abs(change).max())


def test_its_bounds_hold_zero_and_a_realistic_size(fault):
    assert fault.low <= 0.0 < size(fault) < fault.high


def test_it_acts_on_its_own_output_alone(fault):
    shown = faulty(np.column_stack([Y, Y]), T, ("a", "b"), {fault.name_at("b"): size(fault)})
    assert np.array_equal(shown[:, 0], Y)
    assert np.array_equal(shown[:, 1], fault.apply(Y, T, size(fault)))


def test_its_size_has_a_unit_of_the_output(fault):
    assert base_exponents(fault.unit.format("rad/s")).factor == 1.0  # SI


def test_it_says_what_causes_it_and_how_it_shows(fault):
    assert "In data: " in sys.modules[type(fault).__module__].__doc__


@pytest.mark.parametrize(("share", "negative"), [(1.0, 1.0), (0.5, 0.0)])
def test_a_lost_sign_shows_the_amount_or_nothing(share, negative):
    shown = FAULTS["sensor_rectification"].apply(Y, T, share)
    assert np.array_equal(shown, np.where(Y < 0, -negative * Y, Y))


@given(late=st.integers(1, 190), seed=st.integers(0, 99), level=st.floats(-50.0, 50.0))
def test_a_delay_of_many_periods_is_found_from_any_level(late, seed, level):
    """Of motion at 5 and 8.3 Hz, with its noise, of which a third is not to be used."""
    t = 0.005 * np.arange(2000)
    y = level + np.sin(10 * np.pi * t) + 0.7 * np.sin(16.6 * np.pi * t)
    rng = np.random.default_rng(seed)
    measured = FAULTS["sensor_delay"].apply(y, t, 0.005 * late) + 0.1 * rng.standard_normal(len(t))
    measured[rng.random(len(t)) < 1 / 3] = np.nan
    assert FAULTS["sensor_delay"].afar(y, measured, 0.005, 1.0) == pytest.approx(0.005 * late, abs=0.006)


@pytest.mark.parametrize("kind", [kind for kind in FAULTS if kind != "sensor_delay"])
def test_slopes_lead_to_every_other_fault(kind):
    assert FAULTS[kind].afar(Y, Y, 0.005, 1.0) is None


@pytest.mark.parametrize("late", [0.04, 0.45])  # s, within a period of 0.5 s and nearly one
def test_a_fit_starts_from_where_a_delay_explains_most(tmp_path, late):
    F = 90 * np.sin(2 * np.pi * TIMES / 0.7) + 60 * np.sin(2 * np.pi * TIMES / 0.5)
    made = record(F, viscous(0.0), 3)
    [run] = made.runs
    shifted = np.column_stack([run.y[:, 0], np.interp(run.t - late, run.t, run.y[:, 1])])
    asked = problem(ModelBuilder("drive", tmp_path), replace(made, runs=(replace(run, y=shifted),)))
    _, base, noise = calibrate(asked)
    screening = Screening(asked, base.fit, noise.weighting)
    faults = fault_candidates(asked.record, noise.std, asked.policy.candidates, screening.shown)
    delays = [c for c in faults if c.label == "sensor_delay@q_dot"]
    assert len(delays) == 2
    promises = screen(
        screening.fit, [((c,), g) for c, g in zip(faults, screening.changes(faults), strict=True)]
    )
    [best] = Fitter(Baseline(asked, base, noise)).finished(promises[:1])
    assert best.label == "sensor_delay@q_dot"
    assert abs(best.theta["sensor_delay_q_dot"] - late) < 4 * best.fit.std["sensor_delay_q_dot"] < 0.01
