"""The error of a recorded input: white at the samples, and linear between them as the input is."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.filters.ukf import Spread
from estimator.filters.unknown_input import NoisyInput

NUMBER = st.floats(-1e3, 1e3)


@given(NUMBER, NUMBER, st.integers(1, 16))
def test_it_is_linear_within_a_step_whose_end_is_the_begin_of_the_next(now, following, parts):
    """An input acts with the mean of both ends of a part."""
    state, ends = np.array([now, following]), [now]
    for F in NoisyInput("u", 1.0).within(parts):
        state = F @ state
        ends.append(state[0])
    assert_allclose(ends, np.linspace(now, following, parts + 1), atol=1e-9)
    assert_allclose(state, [following, 0.0], atol=1e-9)


@given(st.floats(0.1, 10.0), st.floats(1e-4, 10.0))
def test_it_is_as_large_at_all_times_and_new_at_each_sample(std, dt):
    error = NoisyInput("u", std)
    F, Q = error.discrete(dt)
    P = np.diag(error.variance)
    assert_allclose(F @ P @ F.T + Q, P)
    assert_allclose(F @ F, 0.0)


@given(st.integers(1, 9), st.integers(0, 9), st.floats(0.1, 1.0), st.floats(0.0, 3.0))
def test_noise_beside_the_states_moves_no_sigma_point_of_theirs(n, noises, alpha, kappa):
    spread = Spread(alpha, 2.0, kappa)
    assert_allclose(spread.beside(noises, n + noises).scale(n + noises), spread.scale(n))
