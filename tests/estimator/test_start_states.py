"""The first guess of a measured start state, from the first samples of a record."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import smooth_start
from estimator.closeloop.screening.candidates import fault_candidates
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import problem, record, to_and_fro, viscous

LIMITS = DEFAULT.start
T = np.arange(LIMITS.samples) * 0.01


@given(
    st.floats(0.0, 4.0), st.floats(0.0, 2 * np.pi), st.floats(1e-4, 0.1), st.integers(0, 1000),
    st.floats(-1e3, 1e3),
)  # fmt: skip
def test_the_guess_is_within_its_bounds_wherever_an_oscillation_begins(f, phase, noise, seed, offset):
    """Up to 0.8 of a turn within the samples, at any phase."""
    y = offset + np.sin(2 * np.pi * f * T + phase)
    noisy = y + noise * np.random.default_rng(seed).standard_normal(len(T))
    value, scatter = smooth_start(T, noisy, LIMITS)
    assert abs(value - y[0]) < 2 * LIMITS.error * max(scatter, noise)


@pytest.mark.parametrize("seed", range(20))
def test_a_line_stays_a_line(seed):
    """The guess keeps about the error of a line."""
    noisy = 1.0 + 2.0 * T + 0.01 * np.random.default_rng(seed).standard_normal(len(T))
    assert smooth_start(T, noisy, LIMITS)[0] == pytest.approx(1.0, abs=0.04)


def test_a_fast_oscillation_is_followed_by_few_samples():
    """2.2 turns within the samples: no polynomial follows them all."""
    y = np.sin(2 * np.pi * 11.0 * T + 0.3)
    assert smooth_start(T, y, LIMITS)[0] == pytest.approx(np.sin(0.3), abs=0.1)


def test_the_scatter_is_that_of_the_noise():
    rng = np.random.default_rng(0)
    scatter = [smooth_start(T, 1.0 + T + 0.01 * rng.standard_normal(len(T)), LIMITS)[1] for _ in range(200)]
    assert np.median(scatter) == pytest.approx(0.01, rel=0.25)  # the smallest error is also one by chance


@pytest.mark.parametrize("n", [1, 2, 5])
def test_few_samples_are_enough(n):
    value, scatter = smooth_start(T[:n], np.linspace(1.0, 2.0, n), LIMITS)
    assert value == pytest.approx(1.0)
    assert np.isfinite(scatter)


@pytest.mark.parametrize("bias", [0.05, -0.3])  # m/s: 5 and 30 times the noise
def test_the_sensor_of_a_start_state_may_be_wrong(tmp_path, bias):
    """The state starts where the right equations want it, although its first samples say something else."""
    truth = record(to_and_fro(), viscous(0.0), 3, speed=0.2)
    [run] = truth.runs
    biased = replace(truth, runs=(replace(run, y=run.y + np.array([0.0, bias])),))
    asked = replace(problem(ModelBuilder("drive", tmp_path), biased), free_states=("q", "q_dot"))
    asked = replace(asked, declared={"M": 95.0, "F_v": 200.0})
    _, base, noise = calibrate(asked)
    every = fault_candidates(biased, noise.std, asked.policy.candidates)
    [fault] = [c for c in every if c.label == "sensor_bias@q_dot"]
    [found] = Fitter(Baseline(asked, base, noise)).finished([Promise((fault,), 0.0, base.fit.theta)])
    fit = found.fit
    assert fit.cost / len(fit.residual) == pytest.approx(1.0, abs=0.15)  # noise alone
    for name, true in (("sensor_bias_q_dot", bias), ("q_dot", 0.2), ("q", 0.0)):
        assert abs(found.theta[name] - true) < 4 * fit.std[name]
