"""Filters of samples, factors, iterations and several models, on systems with a known exact answer."""

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from filterpy.monte_carlo import systematic_resample
from numpy.testing import assert_allclose
from scipy.linalg import block_diag

from estimator.filters.delayed import Delayed, punctual
from estimator.filters.ensemble import Ensemble
from estimator.filters.estimator import Estimate
from estimator.filters.imm import Imm
from estimator.filters.iterated import Iterated
from estimator.filters.kf import Kf
from estimator.filters.linear import Linear
from estimator.filters.modes import Entry, transitions
from estimator.filters.rbpf import Rbpf, systematic
from estimator.filters.sensor_noise import Correlated
from estimator.filters.square_root import SquareRoot, triangular
from estimator.filters.tuning import tuned
from estimator.filters.ukf import Ukf
from fmus.errors import BadInput
from tests.estimator.test_filters import DT, record, run, system

NOTHING = np.full(3, np.nan)


def made_of(seed, missing=0.0, n=60):
    rng = np.random.default_rng(seed)
    made, start, Q, R = system(rng)
    X, u, Y = record(made, start, Q, R, rng, n=n, missing=missing)
    return made, start, Q, R, X, u, Y


def likelihood(found):
    return sum(e.log_likelihood for e in found)


@pytest.mark.parametrize("kind", [SquareRoot, Iterated])
@pytest.mark.parametrize("seed", range(3))
def test_the_square_root_and_the_iterated_form_are_the_kalman_filter_where_all_is_linear(kind, seed):
    made, start, Q, R, _, u, Y = made_of(seed, missing=0.2)
    found, exact = (run(k(made, start, Q, R, DT), u, Y) for k in (kind, Kf))
    for a, b in zip(found, exact, strict=True):
        assert_allclose(a.x, b.x, atol=1e-8)
        assert_allclose(a.P, b.P, atol=1e-8)
        assert_allclose(a.C, b.C, atol=1e-8)
    assert likelihood(found) == pytest.approx(likelihood(exact), abs=1e-6)


def test_a_triangular_factor_is_one_of_the_same_matrix():
    A = np.random.default_rng(0).standard_normal((3, 7))
    assert_allclose(triangular(A) @ triangular(A).T, A @ A.T, atol=1e-12)
    assert_allclose(triangular(A[:, :2]) @ triangular(A[:, :2]).T, A[:, :2] @ A[:, :2].T, atol=1e-12)


def test_the_square_root_form_resolves_variances_that_rounding_hides_from_the_other():
    """A sum of three unknowns with variance 1e6 is measured twice with variance 1e-13, so S becomes 2e-13."""
    made = Linear(
        np.eye(3), np.zeros((3, 1)), np.ones((1, 3)), np.zeros((1, 1)), ("a", "b", "c"), ("sum",)
    )  # fmt: skip
    start, R = Estimate(0.0, np.zeros(3), np.diag([1e6, 2e6, 3e6])), np.array([[1e-13]])
    found = {}
    for kind in (SquareRoot, Ukf):
        filter = kind(made, start, np.zeros((3, 3)), R, DT)
        for _ in range(2):
            last = filter.step(np.zeros(1), np.array([6.0]))
        found[kind] = last.S[0, 0]
    assert found[SquareRoot] == pytest.approx(2e-13, rel=0.2)
    assert abs(found[Ukf] - 2e-13) > 1e-12


class Range:
    """Two coordinates at rest, and their distance from the origin as the output."""

    names, outputs = ("a", "b"), ("distance",)

    def f(self, X, u, t, dt, carried):
        return X.copy(), carried

    def h(self, X, u, t, carried):
        return np.hypot(X[:, 0], X[:, 1])[:, None]

    def settled(self, x):
        return x


def test_iterating_makes_an_accurate_nonlinear_measurement_count():
    """The distance is measured with 0.05 under a prior of 1: the estimate must lie near that circle."""
    rng = np.random.default_rng(1)
    start = Estimate(0.0, np.array([1.5, 1.0]), np.eye(2))
    off = {1: [], 10: []}
    for _ in range(30):
        y = np.hypot(*rng.multivariate_normal(start.x, start.P))[None] + 0.05 * rng.standard_normal(1)
        for most in off:
            filter = Iterated(Range(), start, np.zeros((2, 2)), np.array([[0.05**2]]), DT)
            filter.iterations = most
            off[most].append(np.hypot(*filter.step(np.zeros(1), y).x) - y[0])
    rms = {most: float(np.sqrt(np.mean(np.square(e)))) for most, e in off.items()}
    assert rms[10] < 0.85 * rms[1], rms  # measured: 0.23 against 0.32 m


@pytest.mark.parametrize("seed", range(3))
def test_an_ensemble_agrees_with_the_kalman_filter_within_its_sampling_error(seed):
    members = 4000
    made, start, Q, R, _, u, Y = made_of(seed, missing=0.2)
    found = run(Ensemble(made, start, Q, R, DT, members=members, seed=seed), u, Y)
    exact = run(Kf(made, start, Q, R, DT), u, Y)
    for a, b in zip(found, exact, strict=True):
        std = np.sqrt(np.diag(b.P))
        assert np.all(np.abs(a.x - b.x) < 8 * std / np.sqrt(members) + 0.02 * std)
        assert_allclose(a.P / np.outer(std, std), b.P / np.outer(std, std), atol=10 / np.sqrt(members))
    assert likelihood(found) == pytest.approx(likelihood(exact), abs=1.5)


def test_one_ensemble_correction_is_exact_in_its_own_sample_covariance():
    made, start, Q, R, _, u, Y = made_of(5, n=1)
    filter = Ensemble(made, start, Q, R, DT, members=40)
    x, off = filter._X.mean(axis=0), filter._X - filter._X.mean(axis=0)
    exact = Kf(made, Estimate(0.0, x, off.T @ off / 39), Q, R, DT).step(u[0], Y[0])
    found = filter.step(u[0], Y[0])
    assert_allclose(found.x, exact.x, atol=1e-10)
    assert_allclose(found.P, exact.P, atol=1e-10)
    assert_allclose(np.cov(filter._X.T), exact.P, atol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_particles_agree_with_the_kalman_filter_within_their_sampling_error(seed):
    """The third unknown, whose walk has noise, is a particle; the two others are not."""
    made, start, Q, R, _, u, Y = made_of(seed)
    F = made.F.copy()
    F[2] = [0.0, 0.0, 1.0]
    Q = block_diag(Q[:2, :2], 0.01)
    B = made.B.copy()
    B[2] = 0.0
    made = Linear(F, B, made.H, made.D, made.names, made.outputs)
    rng = np.random.default_rng(seed + 100)
    _, u, Y = record(made, start, Q, R, rng)
    drawn = np.array([False, False, True])
    found = run(Rbpf(made, drawn, start, Q, R, DT, particles=2000, seed=seed), u, Y)
    exact = run(Kf(made, start, Q, R, DT), u, Y)
    off = np.array([(a.x - b.x) / np.sqrt(np.diag(b.P)) for a, b in zip(found, exact, strict=True)])
    assert np.sqrt(np.mean(off**2)) < 0.12
    ratio = np.array([np.diag(a.P) / np.diag(b.P) for a, b in zip(found, exact, strict=True)])
    assert_allclose(ratio.mean(axis=0), 1.0, atol=0.12)
    assert likelihood(found) == pytest.approx(likelihood(exact), abs=2.5)


def test_particles_are_drawn_as_often_as_they_weigh():
    w = np.random.default_rng(2).dirichlet(np.ones(50))
    rng = np.random.default_rng(3)
    for draw in (lambda: systematic(w, rng), lambda: systematic_resample(w)):
        counts = np.mean([np.bincount(draw(), minlength=50) for _ in range(300)], axis=0)
        assert_allclose(counts, 50 * w, atol=0.2)


@pytest.mark.parametrize("kind", ["ensemble", "rbpf", "imm"])
def test_filters_of_samples_continue_exactly_from_an_estimate(kind):
    made, start, Q, R, _, u, Y = made_of(7)
    Q = block_diag(Q[:2, :2], 0.01)

    def new(begin):
        if kind == "ensemble":
            return Ensemble(made, begin, Q, R, DT)
        if kind == "imm":
            return bank(made, begin, (Q, 9 * Q), R)
        return Rbpf(made, np.array([False, False, True]), begin, Q, R, DT, particles=50)

    whole = run(new(start), u, Y)
    again = run(new(whole[29]), u[30:], Y[30:])
    assert_allclose(again[-1].x, whole[-1].x, atol=0)
    assert_allclose(again[-1].P, whole[-1].P, atol=0)


def bank(made, start, noises, R, stay=1.0, modes=None):
    """One Kalman filter for each process noise."""
    kept = start.memory.estimates if start.memory else [start] * len(noises)
    filters = [Kf(made, e, Q, R, DT) for e, Q in zip(kept, noises, strict=True)]
    same = Entry(NOTHING, NOTHING, np.zeros(3, np.bool_))
    return Imm(filters, modes or [same] * len(noises), start, DT, stay)


def test_equal_modes_are_one_kalman_filter():
    made, start, Q, R, _, u, Y = made_of(3, missing=0.2)
    for stay in (None, 0.5):
        found, exact = run(bank(made, start, (Q, Q, Q), R, stay), u, Y), run(Kf(made, start, Q, R, DT), u, Y)
        for a, b in zip(found, exact, strict=True):
            assert_allclose(a.x, b.x, atol=1e-9)
            assert_allclose(a.P, b.P, atol=1e-9)
            assert a.log_likelihood == pytest.approx(b.log_likelihood, abs=1e-9)
            assert a.nis == pytest.approx(b.nis, abs=1e-8)


def test_two_models_mix_as_those_of_filterpy():
    made, start, Q, R, _, u, Y = made_of(4)
    made = Linear(made.F, 0 * made.B, made.H, 0 * made.D, made.names, made.outputs)
    noises = (Q, 25 * Q)
    theirs = []
    for noise in noises:
        kf = KalmanFilter(3, 2)
        kf.x, kf.P, kf.F, kf.H, kf.Q, kf.R = start.x[:, None], start.P.copy(), made.F, made.H, noise, R
        theirs.append(kf)
    imm = IMMEstimator(theirs, np.array([0.5, 0.5]), transitions(2, 1.0, DT))
    ours = bank(made, start, noises, R)
    for k, y in enumerate(Y):
        if k:
            imm.predict()
        imm.update(y[:, None])
        found = ours.step(u[k], y)
        if k:  # filterpy changes the modes after the first measurement, as here before the second
            assert_allclose(ours.probabilities, imm.mu, atol=1e-8)
            assert_allclose(found.x, imm.x.ravel(), atol=1e-8)
            assert_allclose(found.P, imm.P, atol=1e-8)


def test_modes_that_change_the_start_are_weighed_by_the_exact_likelihood():
    """Without changes of mode, a bank is Bayes' rule over the likelihoods of separate Kalman filters."""
    made, start, Q, R, _, u, Y = made_of(6, n=8)
    moved = start._replace(x=start.x + np.array([0.5, -0.5, 0.3]))
    both = [run(Kf(made, s, Q, R, DT), u, Y) for s in (start, moved)]
    filters = [Kf(made, s, Q, R, DT) for s in (start, moved)]
    same = Entry(NOTHING, NOTHING, np.zeros(3, np.bool_))
    ours = Imm(filters, [same, same], start, DT, None)
    found = run(ours, u, Y)
    sums = np.array([likelihood(b) for b in both])
    assert_allclose(ours.probabilities, np.exp(sums - np.logaddexp(*sums)), atol=1e-10)
    assert likelihood(found) == pytest.approx(np.logaddexp(*sums) - np.log(2), abs=1e-9)


def test_transitions_are_those_of_a_markov_chain_in_continuous_time():
    assert_allclose(transitions(2, None, 1.0), np.eye(2))
    for n in (2, 3):
        assert_allclose(transitions(n, 4.0, 0.3).sum(axis=1), 1.0)
        assert transitions(n, 4.0, 0.3)[0, 0] == pytest.approx(np.exp(-0.3 / 4.0))


def augmented(made, Q, delay):
    """The system with its past states, and the second output of the state `delay` samples ago."""
    n = 3
    F = np.zeros((n * (delay + 1),) * 2)
    F[:n, :n], F[n:, :-n] = made.F, np.eye(n * delay)
    H = np.zeros((2, len(F)))
    H[0, :n], H[1, -n:] = made.H[0], made.H[1]
    big = np.zeros_like(F)
    big[:n, :n] = Q
    names = tuple(f"x{i}" for i in range(len(F)))
    return Linear(F, np.zeros((len(F), 1)), H, np.zeros((2, 1)), names, made.outputs), big


@pytest.mark.parametrize("kind", [Kf, Ukf])
def test_late_measurements_give_what_a_state_extended_by_its_past_gives(kind):
    delay = 4
    made, start, Q, R, _, u, Y = made_of(8)
    made = Linear(made.F, 0 * made.B, made.H, 0 * made.D, made.names, made.outputs)
    _, u, Y = record(made, start, Q, R, np.random.default_rng(9))
    seen = np.full(Y.shape, np.nan)
    seen[:, 0], seen[delay:, 1] = Y[:, 0], Y[:-delay, 1]
    big, noise = augmented(made, Q, delay)
    P = block_diag(start.P, 1e-30 * np.eye(3 * delay))  # no value before the start is ever measured
    exact = run(Kf(big, Estimate(0.0, np.pad(start.x, (0, 3 * delay)), P), noise, R, DT), u, seen)
    found = run(Delayed(kind(made, start, Q, R, DT), [0, delay]), u, seen)
    for a, b in zip(found, exact, strict=True):
        assert_allclose(a.x, b.x[:3], atol=1e-7)
        assert_allclose(a.P, b.P[:3, :3], atol=1e-7)
    ignored = run(Kf(made, start, Q, R, DT), u, seen)[-1]
    assert np.linalg.norm(ignored.x - exact[-1].x[:3]) > 1e-3  # a filter that takes them as new is wrong
    # what the filter of complete samples says is the same as of a record put in order
    whole = run(Kf(made, start, Q, R, DT), u, punctual(seen, [0, delay]))
    assert likelihood(found) == pytest.approx(likelihood(whole[:-delay]), abs=1e-7)


def test_delays_must_fit_the_outputs():
    made, start, Q, R, *_ = made_of(8)
    with pytest.raises(BadInput, match="2 numbers of samples"):
        Delayed(Kf(made, start, Q, R, DT), [1])


def coloured_record(seed, tau, n=150):
    """A walk seen through white and correlated noise; and its system with the noise as a state."""
    rng = np.random.default_rng(seed)
    c = Correlated("seen", 0.5, tau)
    F1, Q1 = c.discrete(DT)
    made = Linear(
        block_diag(1.0, F1),
        np.zeros((2, 1)),
        np.ones((1, 2)),
        np.zeros((1, 1)),
        ("x", "seen_noise"),
        ("seen",),
    )
    start, Q = Estimate(0.0, np.zeros(2), np.diag([1.0, c.variance[0]])), block_diag(0.02**2, Q1)
    x = np.linalg.cholesky(start.P) @ rng.standard_normal(2)
    X, Y = [], []
    for k in range(n):
        x = made.F @ x + np.sqrt(np.diag(Q)) * rng.standard_normal(2) if k else x
        X.append(x[0])
        Y.append([x.sum() + 0.1 * rng.standard_normal()])
    return made, start, Q, np.array([[0.01]]), np.array(X), np.array(Y)


def test_correlated_noise_as_a_state_gives_honest_errors_where_white_noise_does_not():
    """NEES of the last sample over 60 records: the square of the error over its variance."""
    right, wrong = [], []
    u = np.zeros((150, 1))
    for seed in range(60):
        made, start, Q, R, X, Y = coloured_record(seed, tau=2.0)
        last = run(Kf(made, start, Q, R, DT), u, Y)[-1]
        right.append((last.x[0] - X[-1]) ** 2 / last.P[0, 0])
        plain = Linear(np.eye(1), np.zeros((1, 1)), np.eye(1), np.zeros((1, 1)), ("x",), ("seen",))
        e = run(Kf(plain, Estimate(0.0, np.zeros(1), np.eye(1)), Q[:1, :1], R + 0.25, DT), u, Y)[-1]
        wrong.append((e.x[0] - X[-1]) ** 2 / e.P[0, 0])
    assert 0.6 < np.mean(right) < 1.5  # chi-square of 60 over 60: 95 % within 0.68 to 1.39
    assert np.mean(wrong) > 3.0


def test_a_gauss_markov_process_has_its_variance_and_its_memory():
    c = Correlated("y", 0.3, 2.0)
    F, Q = c.discrete(0.7)
    assert_allclose(F @ np.diag(c.variance) @ F.T + Q, np.diag(c.variance), rtol=1e-12)
    assert F[0, 0] == pytest.approx(np.exp(-0.35))


def test_the_noise_of_records_is_found_within_its_standard_error():
    """Q and R of a walk with measured position, over 12 records: the errors scatter as is said."""
    u, off = np.zeros((250, 1)), []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        x = np.cumsum(0.05 * rng.standard_normal(250))
        Y = (x + 0.2 * rng.standard_normal(250))[:, None]
        made = Linear(np.eye(1), np.zeros((1, 1)), np.eye(1), np.zeros((1, 1)), ("x",), ("y",))

        def log_likelihood(std, made=made, Y=Y):
            filter = Kf(
                made, Estimate(0.0, np.zeros(1), np.eye(1)), np.diag(std[:1] ** 2), np.diag(std[1:] ** 2), DT
            )
            return likelihood(run(filter, u, Y))

        found = tuned(log_likelihood, np.array([0.2, 0.05]))
        assert found.log_likelihood > found.before
        off.append((np.log(found.value) - np.log([0.05, 0.2])) * found.value / found.std_error)
    z = np.array(off)
    assert np.all(np.abs(z.mean(axis=0)) < 0.9)  # three standard errors of the mean
    assert np.all((z.std(axis=0) > 0.4) & (z.std(axis=0) < 1.7)), z.std(axis=0)


def test_a_noise_that_the_record_does_not_determine_has_no_standard_error():
    found = tuned(lambda std: -((np.log(std[0]) - 1) ** 2) * 50, np.ones(2))
    assert found.value[0] == pytest.approx(np.e, rel=1e-3)
    assert found.std_error[0] == pytest.approx(np.e * 0.1, rel=0.02)
    assert np.isnan(found.std_error[1])
