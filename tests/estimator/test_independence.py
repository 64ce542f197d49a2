"""Independent noise is told from what several sensors see, whatever its correlation in time."""

import numpy as np
import pytest
from scipy.signal import lfilter

from estimator.closeloop.policy import DEFAULT
from estimator.independence import chance_of_independence

SAMPLES, LAGS = 4000, DEFAULT.detection.lags


def slow(rng, kept, outputs=3, samples=SAMPLES):
    """Noise (N, n_y) that forgets by a factor from sample to sample, independent between outputs."""
    return lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], rng.standard_normal((samples, outputs)), axis=0)


@pytest.mark.parametrize("kept", [0.0, 0.9, 0.99])
def test_of_independent_noise_one_in_a_hundred_is_called_dependent(kept):
    rng = np.random.default_rng(1)
    found = np.array([chance_of_independence([slow(rng, kept)], LAGS) for _ in range(300)])
    assert np.mean(found < 0.01) < 0.04
    assert np.mean(found < 0.5) == pytest.approx(0.5, abs=0.12)


@pytest.mark.parametrize("delay", [0, 5, LAGS])
@pytest.mark.parametrize("kept", [0.0, 0.9])
def test_what_two_sensors_see_is_found_also_if_one_sees_it_later(delay, kept):
    rng = np.random.default_rng(2)
    noise, common = slow(rng, kept), slow(rng, kept, 1, SAMPLES + delay)[:, 0]
    noise[:, 0] += 0.5 * common[delay:]
    noise[:, 2] += 0.5 * common[: len(noise)]
    assert chance_of_independence([noise], LAGS) < 1e-6


def test_stretches_count_together_and_a_single_output_says_nothing():
    rng = np.random.default_rng(3)
    noise = slow(rng, 0.5)
    noise[:, 1] += 0.1 * noise[:, 0]
    whole, half = (
        chance_of_independence([noise[:2000], noise[2000:]], LAGS),
        chance_of_independence([noise[:2000]], LAGS),
    )
    assert whole < half
    assert chance_of_independence([noise[:, :1]], LAGS) == 1.0
    assert chance_of_independence([noise[: 2 * LAGS]], LAGS) == 1.0
