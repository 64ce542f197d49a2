"""Errors of a record's times: an offset of the outputs' clock is fitted, jitter is noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.pipeline import trace
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question import clock
from estimator.closeloop.question.clock import CLOCK, jitter, read_later, times_said
from estimator.closeloop.search import clock_offset
from estimator.record import Record, Run
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import DT, NOISE, SAMPLES, T, coulomb, motion, problem, to_and_fro

CHANCE = DEFAULT.detection.chance
SEEDS = st.integers(0, 2**32 - 1)


def still(t, q, v):
    """No force beside those of the model."""
    return 0.0


def measured(resistance, offset, seed, scatter=0.0, noise=NOISE / 5):
    """A carriage whose outputs are of times that are later by an offset and scatter, both in samples."""
    rng, F = np.random.default_rng(seed), to_and_fro()
    at = np.clip(T + DT * (offset + scatter * rng.standard_normal(SAMPLES)), 0.0, T[-1])
    y = CubicSpline(T, motion(F, resistance, 0.0))(at) + noise * rng.standard_normal((SAMPLES, 2))
    unseen = T >= 10
    run = Run(T, F[:, None], y, (T < 10) & ~((T >= 4) & (T < 6)), (T >= 4) & (T < 6), unseen)
    return Record((run,), ("F",), ("q", "q_dot"), noise)


@given(st.floats(-1.0, 1.0), st.floats(0.001, 0.125), st.floats(0.0, 6.28), st.booleans())
def test_a_wave_is_read_as_it_is_at_later_times(offset, frequency, phase, even):
    t = np.arange(400.0) if even else np.delete(np.arange(401.0), 200)
    y = np.column_stack([np.sin(2 * np.pi * frequency * t + phase), t])
    found = read_later(y, t, 1, offset)
    inner = slice(8, 190)
    assert_allclose(found[inner, 0], np.sin(2 * np.pi * frequency * (t + offset) + phase)[inner], atol=2e-3)
    assert np.array_equal(found[:, 1], t)  # what is no output stays


def test_without_an_offset_nothing_is_touched():
    y = np.random.default_rng(0).standard_normal((50, 3))
    assert read_later(y, np.arange(50.0), 2, 0.0) is y


def seen_with(scatter, seed, samples=8000, shown=(1.0, 1.0)):
    """A record of waves whose times scatter, in samples, and its residual; shown: share in each output."""
    rng, t, std = np.random.default_rng(seed), np.arange(samples) * DT, np.array([0.01, 0.05])
    rate = 2 * np.pi * np.cos(2 * np.pi * t)[:, None] * [1.0, 3.0]
    late = DT * scatter * rng.standard_normal((samples, 1)) * shown
    residual = late * rate + std * rng.standard_normal((samples, 2))
    y, every = np.cumsum(rate, axis=0) * DT + residual, np.ones(samples, bool)
    return Record((Run(t, t[:, None], y, every, ~every, ~every),), ("u",), ("a", "b"), std), residual


@given(SEEDS, st.floats(0.2, 0.45))
def test_jitter_is_found_with_its_size(seed, scatter):
    record, residual = seen_with(scatter, seed)
    assert_allclose(jitter(record, [residual], CHANCE), DT * scatter, rtol=0.25)


def test_a_long_record_is_estimated_from_some_of_its_samples(monkeypatch):
    record, residual = seen_with(0.4, 2, samples=40000)
    monkeypatch.setattr(clock, "JITTER_SAMPLES", 9000)
    assert_allclose(jitter(record, [residual], CHANCE), 0.4 * DT, rtol=0.15)
    assert 8000 <= len(clock.rates(record.runs[0], residual)) <= 9000


@given(SEEDS)
def test_noise_alone_has_no_jitter(seed):
    record, residual = seen_with(0.0, seed)
    assert jitter(record, [residual], CHANCE) < 0.1 * DT


def test_an_output_that_shows_no_jitter_bounds_it():
    record, residual = seen_with(0.4, 1, shown=(1.0, 0.0))
    assert jitter(record, [residual], CHANCE) < 0.15 * DT


@pytest.fixture(scope="module")
def builder(tmp_path_factory):
    return ModelBuilder("drive", tmp_path_factory.mktemp("carriage"))


@pytest.mark.parametrize(("offset", "scatter"), [(0.7, 0.05), (-0.4, 0.3)])
def test_a_late_clock_is_no_effect(builder, offset, scatter):
    found = trace(problem(builder, measured(still, offset, 3, scatter)), jobs=1)
    assert found.judgement.verdict == "no_discrepancy"
    fit = found.base.fit
    assert abs(fit.theta[CLOCK] - offset * DT) < 4 * fit.std[CLOCK]


@pytest.mark.parametrize(("offset", "scatter"), [pytest.param(0.7, 0.0, marks=pytest.mark.slow), (-0.5, 0.1)])
def test_an_effect_is_found_beside_a_late_clock(builder, offset, scatter):
    found = trace(problem(builder, measured(coulomb(20.0), offset, 4, scatter)), jobs=1)
    assert "coulomb_friction@carriage" in [m.label for m in found.judgement.members]
    assert abs(found.chosen.theta[CLOCK] - offset * DT) < 4 * found.chosen.fit.std[CLOCK]


def test_a_right_clock_is_not_fitted(builder):
    found = trace(problem(builder, measured(coulomb(20.0), 0.0, 5)), jobs=1)
    assert "coulomb_friction@carriage" in [m.label for m in found.judgement.members]
    assert CLOCK not in found.base.fit.theta


def test_a_clock_is_held_where_a_part_is_simulated_with_the_values_before(builder):
    asked = problem(builder, measured(still, 0.7, 6))
    held = replace(asked, declared={**asked.declared, CLOCK: 0.7 * DT})
    [plain], [later] = asked.simulate({}), held.simulate({})
    assert_allclose(later, read_later(plain, T, 2, 0.7 * DT))


@pytest.mark.parametrize(
    ("pair", "member", "both", "shown"),
    [
        (None, 1010.0, None, False),  # nothing calls for an offset where one effect leaves noise
        (
            1030.0,
            1010.0,
            1010.0,
            True,
        ),  # what a second effect explains, an offset beside its partner does too
        (1000.0, 1100.0, 1000.0, False),  # a second effect explains clearly more
        (1030.0, 2000.0, 1030.0, False),  # an offset explains nothing beside either effect
        (1500.0, 1900.0, 1010.0, True),  # it explains nearly all that a better pair leaves
        (1500.0, 1900.0, 1400.0, False),  # what the pair leaves has another cause
    ],
)
def test_an_offset_takes_the_place_of_a_second_effect_unless_that_explains_more(
    monkeypatch, pair, member, both, shown
):
    """Sums of squares of the best pair, and of an offset beside its member and beside it; 2000 by one."""

    def fitted(squares, *kinds):
        left = np.full(1000, np.sqrt(squares / 1000))
        candidates = tuple(Candidate(kind, "wheel", ()) for kind in kinds)
        return Hypothesis(candidates, Fit((), np.zeros(0), np.zeros((0, 0)), left, ()), ())

    monkeypatch.setattr(clock_offset, "_open", lambda _: True)
    monkeypatch.setattr(clock_offset, "arrived", lambda fitter, h: pair is None)
    judging = SimpleNamespace(
        beats=lambda h, other: cost(h) < cost(other),
        policy=DEFAULT,
        problem=SimpleNamespace(record=SimpleNamespace(sample=DT)),
    )
    beside = {"viscous_damping": member, "constant_force": 1900.0, "step_force": 2000.0}

    def finished(promises, others):
        assert [u.name for u in others] == [CLOCK]
        kinds = [[c.kind for c in p.candidates] for p in promises]
        return [fitted(both if len(some) > 1 else beside[some[0]], *some) for some in kinds]

    fitter = SimpleNamespace(baseline=judging, alone=SimpleNamespace(finished=finished))
    two = fitted(pair, "viscous_damping", "constant_force") if pair else None
    found = clock_offset.clock_beside(fitter, fitted(2000.0, "step_force"), two)
    assert found == (DT if shown else 0.0)


def test_what_is_said_of_the_times():
    assert times_said(0.0, 0.0, 0.0) == []
    assert times_said(-2e-3, 1e-5, 1e-4) == [
        "the outputs were sampled 0.002 ± 1e-05 s earlier than their times say, if those of the inputs are "
        "right; this offset was fitted with the parameters",
        "the times of the samples scatter by 0.0001 s, which adds to the noise",
    ]
