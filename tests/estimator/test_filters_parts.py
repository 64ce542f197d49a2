"""What filters are made of: bounds, unknown inputs, consistency, identifiability, process noise, samples."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.filters.bounds import Transform, bounded
from estimator.filters.consistency import (
    mean_band,
    share_within,
    squares,
    whiteness,
)
from estimator.filters.history import samples
from estimator.filters.identifiability import afterwards, before, information
from estimator.filters.process_noise import likeliest, motion
from estimator.filters.unknown_input import Shaped, Wandering
from fmus.errors import BadInput

INF = float("inf")
BOUNDS = st.sampled_from([None, (0.0, INF), (-3.0, INF), (0.02, 0.8), (-1e6, 4e6), (-INF, INF)])


@given(BOUNDS, st.floats(-1e4, 1e4))
def test_no_coordinate_leaves_the_bounds(bounds, z):
    made = bounded(bounds)
    low, high = bounds or (-INF, INF)
    assert low <= float(made.theta(np.array([z]))[0]) <= high


@given(BOUNDS, st.floats(-8, 8))
def test_a_coordinate_is_that_of_its_value_and_the_slope_its_derivative(bounds, z):
    made = bounded(bounds)
    theta = made.theta(np.array([z - 1e-5, z, z + 1e-5]))
    assume(np.all(np.diff(theta) > 0))
    assert made.z(float(theta[1])) == pytest.approx(z, abs=1e-6)
    assert (theta[2] - theta[0]) / 2e-5 == pytest.approx(made.slope(z), rel=1e-4)
    assert float(made.spread(np.array([z]), np.array([1e-5]))[0]) == pytest.approx(
        1e-5 * made.slope(z), rel=1e-4
    )


@given(BOUNDS, st.floats(-8, 8), st.floats(-4, 3))
def test_a_prior_has_the_deviation_that_was_asked_for_also_beside_a_bound(bounds, z, decades):
    made = bounded(bounds)
    std = 10**decades * made.slope(z)
    found = made.deviation(z, std)
    assert float(made.spread(np.array([z]), np.array([found]))[0]) == pytest.approx(
        min(std, made.widest), rel=1e-4
    )
    if decades < -2:
        assert found == pytest.approx(10**decades, rel=1e-3)


def test_no_deviation_between_bounds_is_wider_than_even():
    made = bounded((0.0, 1.0))
    assert made.widest == pytest.approx(np.std(np.linspace(0, 1, 100_001)), rel=1e-4)
    assert made.deviation(0.3, 5.0) == made.deviation(0.3, made.widest)


def test_clipping_cuts_off_and_brings_the_coordinate_back():
    made = Transform("clip", 0.02, 0.8)
    z = np.array([-1.0, 0.5, 2.0])
    assert_allclose(made.theta(z), [0.02, 0.5, 0.8])
    assert_allclose(made.settled(z), [0.02, 0.5, 0.8])
    assert_allclose(bounded((0.0, 1.0)).settled(z), z)


@pytest.mark.parametrize(
    ("bounds", "words"),
    [((1.0, 0.0), "do not increase"), ((-INF, 2.0), "an upper bound 2 without a lower one")],
)
def test_bounds_that_make_no_sense(bounds, words):
    with pytest.raises(BadInput, match=words):
        bounded(bounds)


def test_a_start_on_its_bound_is_refused():
    with pytest.raises(BadInput, match="0 is not between its bounds 0 and inf; start within them"):
        bounded((0.0, INF)).z(0.0)


@given(st.floats(1e-4, 1e3), st.floats(0.01, 50.0), st.floats(0.1, 2.0), st.floats(1e-4, 1.0))
def test_a_shaped_input_keeps_its_variance_whatever_the_step(std, frequency, damping, dt):
    w = Shaped("w", std, frequency, damping=damping)
    F, Q = w.discrete(dt)
    P = np.diag(w.variance)
    scale = np.sqrt(np.outer(w.variance, w.variance))
    assert_allclose((F @ P @ F.T + Q) / scale, P / scale, atol=1e-8)
    assert np.linalg.eigvalsh(Q / scale).min() > -1e-12


def test_two_half_steps_are_one_step():
    w = Shaped("w", 2.0, 3.0)
    (F, Q), (f, q) = w.discrete(0.1), w.discrete(0.05)
    assert_allclose(F, f @ f, atol=1e-12)
    assert_allclose(Q, f @ q @ f.T + q, rtol=1e-9, atol=1e-12)


def test_a_shaped_input_has_its_power_up_to_its_frequency():
    """Damping 1/sqrt(2) is flat below; with less of it the power gathers about the frequency."""
    rng, dt, n = np.random.default_rng(1), 0.01, 2**16
    f = np.fft.rfftfreq(n, dt)
    for damping, share in ((np.sqrt(0.5), 0.15), (0.1, 0.7)):
        F, Q = Shaped("w", 1.0, 2.0, damping=damping).discrete(dt)
        noise = rng.multivariate_normal(np.zeros(2), Q, n)
        x, rows = np.zeros(2), np.empty(n)
        for k in range(n):
            x = F @ x + noise[k]
            rows[k] = x[0]
        power = np.abs(np.fft.rfft(rows)) ** 2
        near = (f > 1.6) & (f < 2.4)
        assert power[f < 4.0].sum() > 0.9 * power.sum()
        assert (power[near].sum() / power.sum() > 0.5) == (share > 0.5)


def test_names_and_feeds_of_unknown_inputs():
    w = Shaped("y_irr", 1e-3, 1.0, "y_irr_dot")
    assert (w.states, w.feeds) == (("y_irr", "y_irr_dot"), {"y_irr": 0, "y_irr_dot": 1})
    assert Shaped("F", 1.0, 1.0).states == ("F", "F_rate")
    F, Q = Wandering("F", 3.0).discrete(0.25)
    assert (F.item(), Q.item()) == (1.0, 9.0 / 4)
    assert Wandering("F", 3.0, 7.0).variance.item() == 49.0


def test_bands_hold_as_often_as_they_promise():
    rng = np.random.default_rng(2)
    L = rng.standard_normal((3, 3))
    P = L @ L.T
    held = []
    for _ in range(400):
        e = rng.multivariate_normal(np.zeros(3), P, 20)
        held.append(mean_band(squares(e, np.tile(P, (20, 1, 1))), np.full(20, 3)).within)
    assert 0.92 < np.mean(held) < 0.98
    all_of_them = squares(rng.multivariate_normal(np.zeros(3), P, 4000), np.tile(P, (4000, 1, 1)))
    assert share_within(all_of_them, np.full(4000, 3)) == pytest.approx(0.95, abs=0.015)
    assert not mean_band(1.2 * all_of_them, np.full(4000, 3)).within
    assert np.isnan(mean_band(np.empty(0), np.empty(0)).value)


def test_white_innovations_pass_and_coloured_ones_do_not():
    rng = np.random.default_rng(3)
    white = [whiteness(rng.standard_normal(500)).p_value for _ in range(200)]
    assert np.mean(np.array(white) < 0.05) == pytest.approx(0.05, abs=0.04)
    e = rng.standard_normal(501)
    coloured = whiteness(e[1:] + 0.5 * e[:-1])
    assert coloured.p_value < 1e-6
    assert coloured.correlation[0] == pytest.approx(0.4, abs=0.1)  # 0.5/(1 + 0.5^2)
    assert coloured.largest > coloured.limit
    assert np.isnan(whiteness(np.full(50, np.nan)).p_value)


def test_what_the_data_cannot_tell_is_named():
    """y = (a + b) t + 0 c: c is not informed, a and b only by their sum, d well."""
    t = np.linspace(0, 1, 200)

    def simulate(z):
        return np.column_stack([(z[0] + z[1]) * t, z[3] * np.sin(9 * t)])

    std = np.array([1.0, 1.0, 1.0, 1.0])
    F = information(simulate, np.zeros(4), std, np.array([1e-2, 1e-2]))
    found = before("abcd", F, std, 4)
    assert found.informed == (True, True, False, True)
    assert [pair[:2] for pair in found.alike] == [("b", "a")]
    assert found.left[0] == pytest.approx(np.sqrt(0.5), rel=1e-2)
    assert found.left[3] == pytest.approx(1e-2 / np.sqrt(np.sum(np.sin(9 * t) ** 2)), rel=1e-2)
    P = np.diag([0.04, 1.0])
    assert afterwards("ab", np.eye(2), P, 1).informed == (False,)
    assert afterwards("ba", np.eye(2), P[::-1, ::-1], 1).informed == (True,)


def test_missing_samples_bring_no_information():
    t = np.linspace(0, 1, 100)
    full = information(lambda z: (z[0] * t)[:, None], np.zeros(1), np.ones(1), np.ones(1))
    half = information(
        lambda z: np.where(t < 0.5, z[0] * t, np.nan)[:, None], np.zeros(1), np.ones(1), np.ones(1)
    )
    assert full.item() == pytest.approx(np.sum(t**2))
    assert half.item() == pytest.approx(np.sum(t[t < 0.5] ** 2))


def test_the_likeliest_noise_is_found_and_a_filter_that_fails_is_not():
    calls = []

    def log_likelihood(part):
        calls.append(part)
        return -((np.log10(part) + 2.3) ** 2) if part < 1 else -np.inf

    assert likeliest(log_likelihood) == pytest.approx(10**-2.3, rel=0.5)
    assert len(calls) < 14


def test_the_motion_of_a_walk_is_its_size():
    rng, dt = np.random.default_rng(4), 0.01
    x = np.cumsum(rng.standard_normal((20000, 2)) * [3.0, 0.0], axis=0) * np.sqrt(dt)
    assert_allclose(motion(dt * np.arange(20000), x, np.array([1.0, 5.0])), [3.0, 5e-6], rtol=0.03)


def test_fewer_samples_keep_the_work_that_inputs_do():
    t = np.cumsum(np.random.default_rng(5).uniform(0.5, 1.5, 101))
    u, y = np.sin(t)[:, None], np.cos(t)[:, None]
    for parts in (1, 3):
        s = samples(t, u, y, every=4, parts=parts)
        assert len(s.t) == 26
        assert s.held.shape == (25, parts, 1)
        assert_allclose(s.held.mean(axis=1)[:, 0] @ np.diff(s.t), np.trapezoid(u[:, 0], t))
        assert_allclose(s.y, y[::4])
        assert len(s.first(10).held) == 9


def test_inputs_run_linearly_between_samples():
    t = np.array([0.0, 1.0, 3.0])
    u, y = np.array([[0.0], [4.0], [0.0]]), np.zeros((3, 1))
    assert_allclose(samples(t, u, y, parts=2).held[:, :, 0], [[1.0, 3.0], [3.0, 1.0]])
    assert_allclose(samples(t, u, y, every=2, parts=3).held[:, :, 0], [[2.0, 3.0, 1.0]])
