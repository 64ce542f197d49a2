"""Noise of the inputs: found where there is some, smoothed, and carried to the outputs."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from estimator.closeloop.fitting.calibrate import without_input_noise
from estimator.closeloop.fitting.noise_left import caused, caused_rms, noise_left
from estimator.closeloop.fitting.reweighted import noise_of_best
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.policy import DEFAULT, Policy
from estimator.closeloop.question.input_noise import InputNoise, smoothed, white_part
from estimator.noise import Noise
from estimator.record import Record, Run
from estimator.weighting import Weighting
from tests.helpers.baselines import NOTHING

N = 12000
T = np.arange(N) * 0.005
LIMITS = DEFAULT.inputs
SEEDS = st.integers(0, 2**32 - 1)


def ramps(rng):
    """Levels with ramps of any steepness between them."""
    times = np.sort(rng.uniform(T[0], T[-1], 16))
    return np.interp(T, times, 10 * np.repeat(rng.standard_normal(8), 2))


def record_of(u, y=None, std=np.nan):
    y = np.zeros((len(u), 1)) if y is None else y
    every = np.ones(len(u), bool)
    run = Run(T[: len(u)], u, y, every, ~every, ~every)
    names = tuple(f"u{j}" for j in range(u.shape[1]))
    return Record((run,), names, tuple("ab"[: y.shape[1]]), np.full(y.shape[1], std))


@pytest.mark.parametrize("seed", range(8))
def test_white_noise_is_found_in_its_size(seed):
    rng = np.random.default_rng(seed)
    std = 10 ** rng.uniform(-3, 0)
    for signal in (ramps(rng), np.full(N, 3.0), np.sin(2 * np.pi * 0.4 * T)):
        assert white_part(signal + std * rng.standard_normal(N), LIMITS) == pytest.approx(std, rel=0.1)


@pytest.mark.parametrize("seed", range(8))
def test_what_has_no_flat_end_of_the_spectrum_is_not_noise(seed):
    rng = np.random.default_rng(seed)
    rough = np.cumsum(rng.standard_normal(N))
    assert white_part(rough, LIMITS) == 0.0
    assert white_part(np.full(N, 3.0), LIMITS) == 0.0
    assert white_part(rng.standard_normal(500), LIMITS) == 0.0  # too short to tell


def test_a_record_with_clean_inputs_has_no_noise():
    u = np.column_stack([np.sin(T), gaussian_filter1d(np.random.default_rng(1).standard_normal(N), 40)])
    assert InputNoise.of(record_of(u), LIMITS) is None


@given(st.floats(-10, 10), st.floats(-3, 3), st.floats(1e-3, 1.0))
def test_a_straight_line_is_not_changed_inside_the_record(level, slope, std):
    line = level + slope * T
    assert_allclose(smoothed(line, std, LIMITS.levels)[4000:-4000], line[4000:-4000], atol=1e-9)


@pytest.mark.slow
@given(SEEDS, st.floats(0.01, 100.0))
def test_smoothing_knows_no_units(seed, factor):
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.standard_normal(3000))
    one, other = (smoothed(f * u, f, LIMITS.levels) for f in (1.0, factor))
    assert_allclose(other, factor * one, rtol=1e-9, atol=1e-9 * factor)


@pytest.mark.parametrize("seed", range(6))
def test_most_of_the_noise_goes_and_corners_stay(seed):
    rng = np.random.default_rng(seed)
    clean, std = ramps(rng), 0.1
    error = smoothed(clean + std * rng.standard_normal(N), std, LIMITS.levels) - clean
    assert np.sqrt(np.mean(error**2)) < 0.3 * std
    corner = np.argmax(np.abs(np.diff(clean, 2))) + 1
    assert np.abs(error[corner - 20 : corner + 20]).max() < 4 * std


@pytest.mark.parametrize("seed", range(6))
def test_draws_of_what_is_left_are_as_large_as_what_is_left(seed):
    rng = np.random.default_rng(seed)
    std = 0.2
    clean = ramps(rng) + np.sin(2 * np.pi * 0.15 * T)
    noise = InputNoise(np.array([std]), LIMITS.levels)
    record = noise.smoothed(record_of((clean + std * rng.standard_normal(N))[:, None]))
    [run] = record.runs
    true = run.u[:, 0] - clean
    draws = [d[:, 0] for d in noise.left(run.u, rng, 4)]
    for sigma in (1, 60):  # also of their slow part, to which a machine answers
        sizes = [np.std(gaussian_filter1d(d, sigma)) for d in draws]
        assert 0.6 < np.mean(sizes) / np.std(gaussian_filter1d(true, sigma)) < 1.5
    assert "u0: white noise" in record.notes[-1].sentence


@pytest.mark.parametrize("share", [0.005, 0.02])
def test_draws_have_no_bias_where_details_are_lost(share):
    """Of a signal with power at every frequency, smoothing takes away details that a smoothed one lacks."""
    rng, found = np.random.default_rng(7), []
    for _ in range(12):
        clean = np.cumsum(gaussian_filter1d(rng.standard_normal(N), 8))
        std = share * clean.std()
        noise = InputNoise(np.array([std]), LIMITS.levels)
        seen = smoothed(clean + std * rng.standard_normal(N), std, LIMITS.levels)
        draws = [np.std(d) for d in noise.left(seen[:, None], rng, 4)]
        found.append(np.mean(draws) / np.std(seen - clean))
    assert np.mean(found) == pytest.approx(1.0, abs=0.06)


def shared_noise(rng, sensors):
    """Slow noise that two outputs share in unequal parts, and white noise of their sensors, (N, 2)."""
    slow = gaussian_filter1d(rng.standard_normal(N), 30)
    slow /= slow.std()
    caused = np.column_stack([slow, 0.8 * slow])
    return caused, caused + sensors * rng.standard_normal((N, 2))


def test_weights_of_shared_noise_are_independent_and_can_be_turned_back():
    rng, sensors = np.random.default_rng(2), np.array([0.05, 0.05])
    draws = [shared_noise(rng, sensors)[0] for _ in range(4)]
    _, seen = shared_noise(rng, sensors)
    record = replace(record_of(np.zeros((N, 1)), seen), noise_std=sensors)
    noise = Noise.of(record, [seen], 3.0, draws)
    assert_allclose(noise.std, np.sqrt(sensors**2 + [1.0, 0.64]), rtol=0.1)
    e = noise.weighting.of(seen, [N])
    assert_allclose(noise.weighting.back(e, [N]), seen, atol=1e-6)
    assert_allclose(np.mean(e**2, axis=0), 1.0, atol=0.25)
    assert abs(np.mean(e[:, 0] * e[:, 1])) < 0.2
    assert abs(np.corrcoef(seen.T)[0, 1]) > 0.99


def test_an_offset_of_one_output_is_seen_beside_noise_that_both_share():
    rng, sensors = np.random.default_rng(3), np.array([0.05, 0.05])
    draws = [shared_noise(rng, sensors)[0] for _ in range(4)]
    record = replace(record_of(np.zeros((N, 1)), draws[0]), noise_std=sensors)
    weighting = Noise.of(record, [draws[0]], 3.0, draws).weighting
    offset = np.tile([0.0, 0.1], (N, 1))
    alone = Weighting(weighting.size, weighting.correlation)  # as if each had noise of its own
    assert np.sum(weighting.of(offset, [N]) ** 2) > 100 * np.sum(alone.of(offset, [N]) ** 2)


@dataclass(frozen=True)
class LowPass:
    """A problem whose plant is a delay of first order of its input, with a time constant of 0.5 s."""

    record: Record
    policy: Policy = DEFAULT
    input_noise: InputNoise | None = None

    def simulate(self, theta):
        """See Problem."""
        return [theta.get("gain", 1.0) * slow(run.u) for run in self.record.runs]

    def residuals(self, theta):
        """See Problem."""
        return [run.y - y for run, y in zip(self.record.runs, self.simulate(theta), strict=True)]


def slow(u):
    kept = np.exp(-0.005 / 0.5)
    return lfilter([1 - kept], [1.0, -kept], u - u[0], axis=0) + u[0]


def measured(rng, sensor, driven_by_noise=False):
    """A plant that is driven by a clean input, or by what looks like one with noise; and its error of 0.2."""
    clean = ramps(rng)[:, None]
    recorded = clean + 0.2 * rng.standard_normal(clean.shape)
    y = slow(recorded if driven_by_noise else clean) + sensor * rng.standard_normal(clean.shape)
    return LowPass(record_of(recorded, y, sensor))


def calibrated(problem):
    """The plant without unknowns, as a fit has it."""
    return SimpleNamespace(theta={}, residuals=tuple(problem.residuals({})))


def smooth(problem):
    """The problem with smoothed inputs."""
    return without_input_noise(problem, calibrated(problem))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("gain", [1.0, 1.05, 2.0])
def test_the_record_decides_whether_the_noise_drove_the_machine(gain, seed):
    """A wrong sensor hides what the noise does from the sum of squares, but not if that is whitened."""
    for driven in (False, True):
        raw = measured(np.random.default_rng(seed), 0.002, driven)
        [run] = raw.record.runs
        raw = replace(raw, record=replace(raw.record, runs=(replace(run, y=gain * run.y),)))
        other = without_input_noise(raw, calibrated(raw))
        assert (other is None) is driven


@pytest.mark.parametrize("seed", range(4))
def test_draws_of_one_input_are_alike_in_size(seed):
    """The error of a constant has few degrees of freedom, and its correction must not add to its scatter."""
    rng = np.random.default_rng(seed)
    sizes = [np.mean(d**2) for d in InputNoise(np.ones(1), LIMITS.levels).left(np.zeros((N, 1)), rng, 16)]
    assert np.std(sizes) < 0.6 * np.mean(sizes)


def test_declared_noise_counts_where_the_record_does_not_say_so():
    """For instance if it is too short for a spectrum, or if the noise did drive the machine."""
    short = record_of(np.zeros((500, 2)))
    assert InputNoise.of(short, LIMITS) is None
    assert InputNoise.of(replace(short, input_std={"u1": 0.3}), LIMITS).std.tolist() == [0.0, 0.3]
    raw = measured(np.random.default_rng(0), 0.002, True)
    assert without_input_noise(raw, calibrated(raw)) is None
    said = replace(raw, record=replace(raw.record, input_std={raw.record.inputs[0]: 0.05}))
    found = without_input_noise(said, calibrated(said))
    assert found.input_noise.std[0] == 0.05
    assert "was declared and smoothed away" in found.record.notes[-1].sentence


def test_noise_that_the_sensors_do_not_show_is_left_alone():
    raw = measured(np.random.default_rng(0), 1000.0)
    assert without_input_noise(raw, calibrated(raw)) is None


@pytest.mark.parametrize("seed", range(5))
def test_the_noise_that_stays_in_the_inputs_is_found_at_the_outputs(seed):
    sensor = 0.002
    problem = smooth(measured(np.random.default_rng(seed), sensor))
    left = problem.residuals({})
    noise = noise_left(problem, {}, left, "noise")
    assert 0.6 < np.std(left[0]) / noise.std[0] < 1.5
    assert noise.std[0] > 3 * sensor
    weighed = noise.weighting.of(left[0], [N])
    assert 0.6 < np.std(weighed) < 1.5
    blocks = weighed.reshape(60, -1).mean(axis=1) * np.sqrt(N / 60)
    assert np.mean(blocks**2) < 6.0  # as it is, they would have some hundred times their size
    assert np.mean((left[0] / noise.std).reshape(60, -1).mean(axis=1) ** 2) * N / 60 > 30


def test_an_effect_that_holds_an_input_back_does_not_hide_its_noise():
    """A saturation would, and all that do not saturate would then leave more than noise."""
    problem = smooth(measured(np.random.default_rng(0), 0.002))
    left = tuple(problem.residuals({}))
    base = SimpleNamespace(theta={}, residuals=left)
    noise = noise_left(problem, {}, left, "noise")
    found = [
        SimpleNamespace(theta={"gain": gain}, residuals=left, fit=SimpleNamespace(cost=1.0))
        for gain in (1.0, 0.0)
    ]
    said = [noise_of_best(Baseline(problem, base, noise), [[h]]).std for h in found]
    assert_allclose(said[1], said[0])
    assert_allclose(said[1], noise.std)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("gain", [0.5, 3.0])
def test_what_an_effect_leaves_is_compared_with_the_noise_that_it_lets_through(gain, seed):
    raw = measured(np.random.default_rng(seed), 0.002)
    [run] = raw.record.runs
    changed = replace(run, y=run.y + (gain - 1) * slow(ramps(np.random.default_rng(seed))[:, None]))
    problem = smooth(replace(raw, record=replace(raw.record, runs=(changed,))))
    left = tuple(problem.residuals({}))
    noise = noise_left(problem, {}, left, "effect")
    theta = {"gain": gain}
    right = Hypothesis((), NOTHING.fit, tuple(problem.residuals(theta)))
    right = replace(right, caused=caused_rms(problem, theta, right.residuals))
    asked = Baseline(problem, Hypothesis((), NOTHING.fit, left), noise)
    assert_allclose(right.caused, gain * noise.caused, rtol=0.01)  # the base may see some jitter too
    assert 0.6 < np.std(right.residuals[0]) / asked.noise_of(right)[0] < 1.5
    assert_allclose(asked.noise_of(asked.hypothesis), noise.std)


def test_noise_of_inputs_and_of_times_adds_up():
    rng = np.random.default_rng(6)
    plain = smooth(measured(rng, 0.002))
    [run] = plain.record.runs
    late = 0.4 * 0.005 * rng.standard_normal((N, 1)) * np.gradient(slow(run.u), T, axis=0)
    both = replace(plain, record=replace(plain.record, runs=(replace(run, y=run.y + late),)))
    alone, together = (np.mean(np.square(caused(p, {}, p.residuals({})))) for p in (plain, both))
    assert_allclose(together - alone, np.mean(late**2), rtol=0.2)
