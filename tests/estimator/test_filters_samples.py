"""The samples of a record as a filter takes them: lengths of the time steps and means of the inputs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.filters.history import samples
from fmus import aside


@given(
    step=st.sampled_from([0.001, 0.002, 0.005, 0.01, 0.0125, 0.1, 1.0]),
    begin=st.sampled_from([0.0, 0.03, 7.25, 1234.5, 1.7e9]),
    n=st.integers(10, 3000),
)
def test_the_rounding_of_times_does_not_show_in_their_step(step, begin, n):
    t = begin + step * np.arange(n)
    found = samples(t, np.zeros((n, 1)), np.zeros((n, 1)))
    if np.spacing(t[-1]) < 1e-6 * step:
        assert found.step == step
        assert np.all(found.steps == step)
    else:
        assert found.step == pytest.approx(step, rel=0.01)


@pytest.mark.parametrize("parts", [1, 3])
def test_means_in_blocks_are_those_of_the_whole_record(parts, monkeypatch):
    rng = np.random.default_rng(0)
    t, u = np.cumsum(rng.uniform(0.5, 1.5, 1000)), rng.standard_normal((1000, 2))
    whole = samples(t, u, u, 2, parts)
    monkeypatch.setattr(aside, "BLOCK", 1024)
    assert np.array_equal(samples(t, u, u, 2, parts).held, whole.held)
    assert whole.held.shape == (499, parts, 2)
