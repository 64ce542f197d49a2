"""Errors that allow for what the form of the model lacks: they hold where effects nobody named act."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from estimator.closeloop.fitting.form_left import over_form
from estimator.closeloop.hypotheses.fitted import Fit, sandwich
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.changes import Screening
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import coulomb, looked_at, problem, record, to_and_fro

SAMPLES, RESPONSES = 1000, 40
UNKNOWNS = tuple(
    Unknown(name, 0.0, -1e6, 1e6, scale) for name, scale in (("a", 1.0), ("b", 30.0), ("c", 0.01))
)
SCALE = np.array([u.scale for u in UNKNOWNS])
seeds = st.integers(0, 2**32 - 1)


def smooth(rng: np.random.Generator, n: int) -> np.ndarray:
    """Columns (SAMPLES, n) like those of a resonant plant: a few sines of nearby frequencies each."""
    t, waves = np.arange(SAMPLES) / SAMPLES, rng.uniform(2, 12, (6, n))
    return sum(
        rng.standard_normal(n) * np.sin(2 * np.pi * w * t[:, None] + rng.uniform(0, 6, n)) for w in waves
    )


def fitted(lacking: float, rng: np.random.Generator) -> tuple[Fit, list[np.ndarray], np.ndarray]:
    """A linear fit, the responses of effects of which each acts a little, and the true values."""
    slopes, responses = smooth(rng, 3) / SCALE, smooth(rng, RESPONSES)
    responses /= np.linalg.norm(responses, axis=0)
    true = 10 * SCALE * rng.standard_normal(3)
    measured = slopes @ true + responses @ (lacking * rng.standard_normal(RESPONSES))
    measured += rng.standard_normal(SAMPLES)
    values = np.linalg.lstsq(slopes, measured, rcond=None)[0]
    residual = slopes @ values - measured
    covariance = sandwich(residual, slopes, SCALE, np.full(3, 2e6))
    fit = Fit(UNKNOWNS, values, covariance, residual, tuple(slopes.T))
    return (
        fit,
        [g[:, None] * f for g, f in zip(responses.T, rng.uniform(0.01, 100, RESPONSES), strict=True)],
        true,
    )


def covered(lacking: float, records: int = 120) -> tuple[float, float]:
    """Share of the true values in their 95 % intervals, without and with what the form lacks."""
    inside = []
    for seed in range(records):
        fit, responses, true = fitted(lacking, np.random.default_rng(seed))
        again = over_form(fit, fit, responses, declared=True, trusted=0.15)
        inside.append([abs(f.values - true) < 1.96 * np.sqrt(np.diag(f.covariance)) for f in (fit, again)])
    before, after = np.mean(inside, axis=(0, 2))
    return float(before), float(after)


@pytest.mark.parametrize("lacking", [3.0, 10.0, 100.0])
def test_intervals_hold_where_effects_that_nobody_named_act(lacking):
    before, after = covered(lacking)
    assert before < 0.82
    assert 0.93 < after < 0.99  # of 360 values; errors of residuals that are not white are in both


def test_without_such_effects_intervals_stay_as_they_are():
    before, after = covered(0.0)
    assert 0.93 < before < 0.98
    assert before <= after < 0.985


@settings(deadline=None, max_examples=20)
@given(seeds, st.sampled_from([0.0, 5.0]))
def test_it_depends_on_no_size_of_a_response_and_on_no_unit(seed, lacking):
    rng = np.random.default_rng(seed)
    fit, responses, _ = fitted(lacking, rng)
    found = over_form(fit, fit, responses, declared=True, trusted=0.15).covariance
    others = [g * f for g, f in zip(responses, rng.uniform(-9, 9, len(responses)), strict=True)]
    assert over_form(fit, fit, others, declared=True, trusted=0.15).covariance == pytest.approx(
        found, rel=1e-6
    )
    assert np.all(np.diag(found) >= np.diag(fit.covariance))


def test_a_fit_without_unknowns_or_without_responses_stays_as_it_is():
    fit, responses, _ = fitted(5.0, np.random.default_rng(1))
    nothing = Fit((), np.zeros(0), np.zeros((0, 0)), fit.residual, ())
    assert over_form(nothing, nothing, responses, declared=True, trusted=0.15) is nothing
    assert over_form(fit, fit, [], declared=True, trusted=0.15) is fit
    assert over_form(fit, fit, [0 * g for g in responses], declared=True, trusted=0.15) is fit


def test_the_responses_to_laws_are_not_made_of_the_noise_in_the_residual(tmp_path):
    """The motion that follows the record would be; that of the answer is nearly the true one without it."""
    here = problem(ModelBuilder("drive", tmp_path), record(to_and_fro(), coulomb(30.0), 4))
    o = looked_at("one", here, ("coulomb_friction",)).found
    [h] = o.singles
    rng = np.random.default_rng(5)
    noisy = [replace(m, motion=m.motion + 0.1 * rng.standard_normal(m.motion.shape)) for m in o.forces]
    found = []
    for forces in (o.forces, noisy):
        screening = Screening(here, o.base.fit, o.baseline.noise.weighting, forces)
        courses = screening.courses_with(built(here, h.candidates), h.theta)
        found.append((screening.changes(h.candidates)[0], screening.changes(h.candidates, courses)[0]))
    (along_record, along_answer), (along_noise, still) = found
    assert_array_equal(still, along_answer)
    assert np.linalg.norm(along_noise - along_record) > 0.01 * np.linalg.norm(along_record)
    alike = np.vdot(along_record, along_answer) / np.linalg.norm(along_record) / np.linalg.norm(along_answer)
    assert alike > 0.9
