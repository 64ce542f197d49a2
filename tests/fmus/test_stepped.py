"""States through samples: sums where a step is linear, single steps elsewhere, both the same."""

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw, _compiled
from fmus.integrators.rk4 import runge_kutta
from fmus.stepped import Stepped

WITH_MEMORY = sorted(k for k, e in EFFECTS.items() if issubclass(e, ForceLaw) and e.states("translation"))


def one_by_one(step, x0, w, dt):
    """The definition: a call for each step."""
    found = [x0]
    for k in range(len(dt)):
        found.append(np.array(step(found[-1], w[:, k], w[:, k + 1], dt[k])).ravel())
    return np.array(found).T


def linear(n, k, p=0):
    """x' = A x + B w with the elements of A and B in p more rows, n states, k rows that drive."""
    x, w0, w1, dt = cs.SX.sym("x", n), cs.SX.sym("w0", k + p), cs.SX.sym("w1", k + p), cs.SX.sym("dt")

    def f(w, state):
        given = w[k:]
        A, B = cs.reshape(given[: n * n], n, n), cs.reshape(given[n * n :], n, k)
        return A @ state + B @ w[:k]

    after = runge_kutta(f, x, dt, (w0, (w0 + w1) / 2, w1))
    return cs.Function("step", [x, w0, w1, dt], [after])


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5), k=st.integers(1, 3), samples=st.integers(1, 70))
def test_sums_are_the_steps(seed, n, k, samples):
    rng = np.random.default_rng(seed)
    step = linear(n, k, n * n + n * k)
    A = rng.standard_normal((n, n)) - 2 * np.eye(n)
    constant = np.concatenate([A.T.ravel(), rng.standard_normal(n * k)])
    w = np.vstack([rng.standard_normal((k, samples)), np.tile(constant[:, None], samples)])
    x0, dt = rng.standard_normal(n), np.full(samples - 1, 0.1)
    stepped = Stepped(step)
    found, expected = stepped(x0, w, dt), one_by_one(step, x0, w, dt)
    assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    uneven = dt * rng.uniform(0.5, 1.5, samples - 1)
    assert_allclose(stepped(x0, w, uneven), one_by_one(step, x0, w, uneven), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", WITH_MEMORY)
def test_laws_with_a_memory_are_stepped_as_before(kind):
    law, rng, t = EFFECTS[kind], np.random.default_rng(3), np.linspace(0.0, 2.0, 401)
    q = 1e-3 * np.sin(9 * t) + 1e-4 * np.sin(40 * t)
    values = [p.start or rng.uniform(0.5, 2.0) for p in law.parameters("translation")]
    w = np.vstack([t, q, np.gradient(q, t), np.tile(np.array(values)[:, None], len(t))])
    x0 = np.array([s.start for s in law.states("translation")])
    steps = _compiled(law).steps
    expected = one_by_one(steps._step, x0, w, np.diff(t))
    assert_allclose(steps(x0, w, np.diff(t)), expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


def test_a_law_that_is_linear_is_seen_as_linear_and_another_one_is_not():
    assert _compiled(EFFECTS["flexible_mode"]).steps._linear((0, 1, 2)) is not None
    assert _compiled(EFFECTS["hysteresis"]).steps._linear((0, 1, 2)) is None


def test_a_coefficient_that_changes_is_not_linear():
    step, t = linear(1, 1, 2), np.linspace(0.0, 1.0, 50)
    w = np.vstack([np.sin(t), -1.0 - t, np.ones_like(t)])
    x0, dt = np.array([1.0]), np.diff(t)
    assert Stepped(step)._linear((0, 1)) is None
    assert_allclose(Stepped(step)(x0, w, dt), one_by_one(step, x0, w, dt), rtol=1e-12)


def test_what_grows_beyond_numbers_is_left_to_the_steps():
    step, w = linear(1, 1, 2), np.vstack([np.ones(3000), np.full(3000, 300.0), np.ones(3000)])
    w[0, ::2] = 0.5
    with np.errstate(all="ignore"):
        found = Stepped(step)(np.array([1.0]), w, np.full(2999, 0.1))
        expected = one_by_one(step, np.array([1.0]), w, np.full(2999, 0.1))
    assert np.array_equal(np.isfinite(found), np.isfinite(expected))
