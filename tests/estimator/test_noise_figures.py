"""What noise alone would leave, drawn as a few numbers, against noise that is drawn sample by sample."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from estimator.noise_figures import SIZE, SLOW, figures_of, figures_of_noise

DRAWS = 2000


def sample_by_sample(
    n: int, n_y: int, late: np.ndarray, root: np.ndarray, pieces: int, rng: np.random.Generator
) -> dict[str, list[float]]:
    """The same figures of noise that is drawn as the definition says."""
    found: dict[str, list[float]] = {SIZE: [], SLOW: []}
    for _ in range(DRAWS):
        e = rng.standard_normal((n, n_y))
        e -= (late @ (root @ rng.standard_normal(root.shape[1]))).reshape(e.shape)
        for name, value in figures_of(e, pieces).items():
            found[name].append(value)
    return found


@settings(deadline=None, max_examples=12)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(3, 200),
    n_y=st.integers(1, 3),
    unknowns=st.integers(0, 4),
    size=st.sampled_from([0.0, 0.1, 1.0, 10.0]),
    slow=st.booleans(),
)
def test_the_figures_are_distributed_as_those_of_noise(seed, n, n_y, unknowns, size, slow):
    """Sensitivities: slow or fast ones, some of which are the same, for few samples or many."""
    rng = np.random.default_rng(seed)
    late = np.zeros((n * n_y, unknowns))
    for i in range(unknowns):
        rate = rng.uniform(0, 3 if slow else n)
        late[:, i] = np.cos(rate * np.arange(n * n_y) / (n * n_y) + rng.uniform(0, 6))
    if unknowns > 1:
        late[:, 1] = late[:, 0]
    root = size * rng.standard_normal((unknowns, unknowns)) / np.sqrt(n)
    few = figures_of_noise((n, n_y), late, root, 40, DRAWS, rng)
    every = sample_by_sample(n, n_y, late, root, 40, rng)
    for name in (SIZE, SLOW):
        assert len(few[name]) == DRAWS
        assert ks_2samp(few[name], every[name]).pvalue > 1e-5


def test_without_unknowns_the_size_is_a_chi_square():
    found = figures_of_noise(
        (1000, 1), np.empty((0, 0)), np.zeros((0, 0)), 40, DRAWS, np.random.default_rng(0)
    )
    assert np.mean(found[SIZE]) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 1000 / DRAWS))
    assert np.var(found[SIZE]) == pytest.approx(2 / 1000, rel=0.15)
    assert np.mean(found[SLOW]) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 40 / DRAWS))
