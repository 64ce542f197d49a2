"""A filter carried over pieces of a record gives, to the bit, what it gives over the whole."""

from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from estimator.filters.carried import KEPT, Carried, Rows, begun_again
from estimator.filters.estimator import Adaptation, Estimate, Gate
from estimator.filters.history import filtered, samples
from estimator.filters.ukf import Ukf
from fmus import codec
from tests.estimator.test_filters import DT, record, system

N = 61
FIELDS = ("t", "x", "std", "innovation", "nis", "freedom", "gated", "likelihoods")


def parts(seed=3):
    """A system, its start, noises, and a record with missing measurements and uneven steps."""
    rng = np.random.default_rng(seed)
    made, start, Q, R = system(rng)
    _, u, y = record(made, start, Q, R, rng, N, missing=0.2)
    t = DT * np.arange(N) + rng.uniform(-0.3, 0.3, N) * DT * (rng.random(N) < 0.3)
    return made, start, Q, R, Rows(np.sort(t), u, y)


def ukf(made, Q, R):
    return lambda start: Ukf(made, start, Q, R, DT, Gate(3.0), Adaptation(process=True))


def pieces(rows, cuts):
    edges = [0, *sorted(set(cuts)), N]
    return [rows.of(slice(a, b)) for a, b in pairwise(edges)]


@given(st.lists(st.integers(1, N - 1), max_size=12), st.integers(1, 4), st.integers(1, 3))
@settings(max_examples=60)
def test_where_the_record_is_cut_changes_no_bit(cuts, every, divided):
    made, start, Q, R, rows = parts()
    whole = filtered(
        ukf(made, Q, R)(start), samples(rows.t, rows.u, rows.y, every, divided), usual=every * DT
    )
    filter = Carried(ukf(made, Q, R), every * DT, every, divided)
    filter.anew(start)
    found = [filter.take(piece) for piece in pieces(rows, cuts)]
    for name in FIELDS:
        assert_array_equal(np.concatenate([getattr(h, name) for h, _ in found]), getattr(whole, name))
    assert_array_equal(np.concatenate([u for _, u in found]), rows.u[::every])
    assert filter.until == rows.t[-1]


@given(st.integers(1, N - 1), st.integers(1, 4))
@settings(max_examples=30)
def test_a_restart_from_what_was_kept_changes_no_bit(cut, every):
    made, start, Q, R, rows = parts()
    filter, other = (Carried(ukf(made, Q, R), every * DT, every) for _ in range(2))
    filter.anew(start)
    first, last = pieces(rows, [cut])
    filter.take(first)
    stream = BytesIO()
    codec.write(stream, filter.kept(), "key", KEPT)
    other.go_on(codec.read(stream, "key", KEPT))
    here, there = filter.take(last)[0], other.take(last)[0]
    for name in FIELDS:
        assert_array_equal(getattr(here, name), getattr(there, name))
    for one, two in zip(filter.now, other.now, strict=True):
        if isinstance(one, np.ndarray):
            assert_array_equal(one, two)


def test_means_of_inputs_are_those_of_their_lines():
    """Piecewise linear inputs over every third sample in two parts, against their integral by quadrature."""
    rng = np.random.default_rng(1)
    t, u = np.cumsum(rng.uniform(0.5, 1.5, 25)), rng.normal(size=(25, 2))
    s = samples(t, u, np.zeros((25, 1)), every=3, parts=2)
    for k in range(len(s.t) - 1):
        edges = np.linspace(s.t[k], s.t[k + 1], 3)
        for part in range(2):
            fine = np.linspace(edges[part], edges[part + 1], 20001)
            for j in range(2):
                exact = np.trapezoid(np.interp(fine, t, u[:, j]), fine) / (edges[part + 1] - edges[part])
                assert s.held[k, part, j] == pytest.approx(exact, abs=1e-6)


def test_after_a_gap_parameters_stay_and_wander_while_states_begin_anew():
    prior = Estimate(10.0, np.zeros(3), np.diag([1.0, 2.0, 3.0]))
    P = np.array([[0.1, 0.05, 0.0], [0.05, 0.2, 0.01], [0.0, 0.01, 0.3]])
    now = Estimate(4.0, np.array([5.0, 6.0, 7.0]), P, np.zeros(1))
    kept = np.array([False, True, False])
    found = begun_again(prior, now, kept, np.array([0.0, 0.5, 0.0]))
    assert_array_equal(found.x, [0.0, 6.0, 0.0])
    assert_array_equal(found.P, np.diag([1.0, 0.2 + 6 * 0.5, 3.0]))
    assert found.u is None
    assert found.t == 10.0


def test_a_filter_without_a_beginning_says_so():
    made, _, Q, R, rows = parts()
    filter = Carried(ukf(made, Q, R), DT)
    assert filter.kept() is None
    with pytest.raises(ValueError, match="anew"):
        filter.take(rows)
