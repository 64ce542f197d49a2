"""The filters: against filterpy and each other where they must agree, else against their own covariance."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.filters import algebra, matching
from estimator.filters.consistency import mean_band, squares
from estimator.filters.dual import Dual
from estimator.filters.ekf import Ekf
from estimator.filters.estimator import (
    Adaptation,
    Diverged,
    Estimate,
    Gate,
)
from estimator.filters.history import filtered, samples
from estimator.filters.kf import Kf
from estimator.filters.linear import Linear, linearised
from estimator.filters.rls import Rls
from estimator.filters.smoother import smoothed
from estimator.filters.ukf import Spread, Ukf
from fmus import aside

NAMES, OUTPUTS = ("position", "speed", "load"), ("seen", "felt")
DT = 0.1
FILTERS = pytest.mark.parametrize("kind", [Ukf, Kf, Ekf])


def system(rng):
    """A stable linear system of three states, two outputs and an input, with its noise and its start."""
    A = rng.standard_normal((3, 3))
    F = 0.95 * A / np.abs(np.linalg.eigvals(A)).max()
    made = Linear(F, *(rng.standard_normal(s) for s in ((3, 1), (2, 3), (2, 1))), NAMES, OUTPUTS)
    L = rng.standard_normal((3, 3))
    Q, R = 0.01 * L @ L.T + 1e-4 * np.eye(3), np.diag(rng.uniform(0.01, 1.0, 2))
    return made, Estimate(0.0, rng.standard_normal(3), np.diag(rng.uniform(0.5, 2.0, 3))), Q, R


def record(made, start, Q, R, rng, n=60, missing=0.0):
    """True states (n, 3), inputs (n, 1) and outputs (n, 2) of the system, drawn with its noise."""
    x, rows = rng.multivariate_normal(start.x, start.P), []
    u = np.sin(0.3 * np.arange(n))[:, None]
    for k in range(n):
        if k:
            x = made.f(x[None], (u[k] + u[k - 1]) / 2, 0.0, DT, x)[0][0]
            x = x + rng.multivariate_normal(np.zeros(3), Q)
        y = made.h(x[None], u[k], 0.0, x)[0] + rng.multivariate_normal(np.zeros(2), R)
        rows.append((x, y))
    X, Y = (np.array(part) for part in zip(*rows, strict=True))
    Y[rng.random(Y.shape) < missing] = np.nan
    return X, u, Y


def run(made, u, y):
    return [made.step(*row) for row in zip(u, y, strict=True)]


def theirs(made, start, Q, R, u, Y):
    """The same by filterpy's linear filter, which knows no missing values and no direct feedthrough."""
    kf = KalmanFilter(3, 2, 1)
    kf.x, kf.P, kf.F, kf.H, kf.B, kf.Q, kf.R = start.x, start.P, made.F, made.H, made.B, Q, R
    means, covariances = [], []
    for k, y in enumerate(Y):
        if k:
            kf.predict(u=(u[k] + u[k - 1]) / 2)
        kf.update(y - made.D @ u[k])
        means.append(kf.x.copy())
        covariances.append(kf.P.copy())
    return np.array(means), np.array(covariances), kf


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.sampled_from([Spread(), Spread(0.5, 2.0, 0.0), Spread(1.0, 0.0, 1.0)]))
def test_on_a_linear_system_all_filters_and_smoothers_are_one(seed, spread):
    rng = np.random.default_rng(seed)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng)
    means, covariances, kf = theirs(made, start, Q, R, u, Y)
    back = kf.rts_smoother(means, covariances)
    for filter in (
        Ukf(made, start, Q, R, DT, spread=spread),
        Kf(made, start, Q, R, DT),
        Ekf(made, start, Q, R, DT),
    ):
        found = run(filter, u, Y)
        tight = 1e-6 if isinstance(filter, Ekf) else 1e-9  # the EKF takes its derivatives by differences
        assert_allclose([e.x for e in found], means, atol=tight)
        assert_allclose([e.P for e in found], covariances, atol=tight)
        whole = smoothed(found)
        # filterpy applies the input of the step in its smoother to the state alone
        assert_allclose(whole.P, back[1], atol=tight)


@settings(max_examples=10)
@given(st.integers(0, 10**6))
def test_ukf_is_kf_with_missing_and_multi_rate_measurements(seed):
    rng = np.random.default_rng(seed)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng, missing=0.3)
    Y[np.arange(len(Y)) % 5 != 0, 1] = np.nan
    Y[7] = np.nan
    one, other = (run(kind(made, start, Q, R, DT), u, Y) for kind in (Ukf, Kf))
    for a, b in zip(one, other, strict=True):
        assert_allclose(a.x, b.x, atol=1e-9)
        assert_allclose(a.P, b.P, atol=1e-9)
        assert a.log_likelihood == pytest.approx(b.log_likelihood, abs=1e-8)
        assert_array_equal(a.used, np.isfinite(b.innovation))
    s, t = smoothed(one), smoothed(other)
    assert_allclose(s.x, t.x, atol=1e-9)
    assert_allclose(s.P, t.P, atol=1e-9)


def test_smoothing_is_the_best_estimate_from_all_data():
    """Against the normal equations of the whole record, solved at once."""
    rng = np.random.default_rng(5)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng, n=12)
    n = len(Y)
    information, right = np.zeros((3 * n, 3 * n)), np.zeros(3 * n)
    information[:3, :3] += np.linalg.inv(start.P)
    right[:3] += np.linalg.solve(start.P, start.x)
    for k in range(n):
        here = slice(3 * k, 3 * k + 3)
        information[here, here] += made.H.T @ np.linalg.solve(R, made.H)
        right[here] += made.H.T @ np.linalg.solve(R, Y[k] - made.D @ u[k])
        if k:
            both = slice(3 * k - 3, 3 * k + 3)
            J = np.hstack([-made.F, np.eye(3)])
            b = made.B @ (u[k] + u[k - 1]) / 2
            information[both, both] += J.T @ np.linalg.solve(Q, J)
            right[both] += J.T @ np.linalg.solve(Q, b)
    found = smoothed(run(Ukf(made, start, Q, R, DT), u, Y))
    assert_allclose(found.x.ravel(), np.linalg.solve(information, right), atol=1e-9)
    covariance = np.linalg.inv(information)
    assert_allclose(found.P[4], covariance[12:15, 12:15], atol=1e-9)


@FILTERS
def test_nees_and_nis_lie_within_their_bands_over_50_seeds(kind):
    made, start, Q, R = system(np.random.default_rng(2))
    errors, innovations = [], []
    for seed in range(50):
        X, u, Y = record(made, start, Q, R, np.random.default_rng(100 + seed), n=40)
        found = run(kind(made, start, Q, R, DT), u, Y)
        errors.append([squares(e.x - x, e.P) for e, x in zip(found, X, strict=True)])
        innovations += [e.nis for e in found]
    # one sample of each run: the errors of neighbouring samples are not independent
    for k in (0, 10, 20, 39):
        last = np.array(errors)[:, k]
        assert mean_band(last, np.full(50, 3.0), 0.9975).within  # four looks at 99.75 % are one at 99 %
    assert mean_band(np.array(errors)[:, -1], np.full(50, 3.0)).within
    assert mean_band(np.array(innovations), np.full(len(innovations), 2.0)).within


@FILTERS
@pytest.mark.parametrize("options", [{}, {"gate": Gate(2.0, 3), "adapt": Adaptation(20.0, True, True)}])
def test_a_filter_restarted_from_a_saved_estimate_goes_on_exactly(kind, options):
    rng = np.random.default_rng(4)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng, missing=0.1)
    whole = run(kind(made, start, Q, R, DT, **options), u, Y)
    again = kind(made, whole[29], Q, R, DT, **options)
    for e, expected in zip(run(again, u[30:], Y[30:]), whole[30:], strict=True):
        assert e.t == expected.t
        for part in ("x", "P", "innovation", "S", "gated", "log_likelihood", "x_prior", "P_prior", "C"):
            assert_array_equal(getattr(e, part), getattr(expected, part))


def test_before_the_first_sample_no_time_passes():
    made, start, Q, R = system(np.random.default_rng(1))
    filter = Ukf(made, start, Q, R, DT)
    blind = filter.step(np.zeros(1), np.full(2, np.nan))
    assert blind.t == 0.0
    assert_array_equal(blind.x, start.x)
    assert_array_equal(blind.P, start.P)
    assert (blind.nis, blind.log_likelihood) == (0.0, 0.0)
    assert filter.step(np.zeros(1), np.full(2, np.nan), dt=0.25).t == 0.25


@pytest.mark.parametrize(
    ("P", "words"),
    [
        (np.diag([1.0, -1.0, 1.0]), "variance of 'speed' is -1"),
        (np.diag([1.0, 1.0, np.nan]), "variance of 'load' is nan"),
        (
            np.array([[1, 2, 0], [2, 1, 0], [0, 0, 1.0]]),
            "not positive definite, mostly in '(position|speed)'",
        ),
    ],
)
def test_a_broken_covariance_is_never_carried_on(P, words):
    made, start, Q, R = system(np.random.default_rng(1))
    with pytest.raises(Diverged, match=words):
        Ukf(made, Estimate(0.0, start.x, P), Q, R, DT)


def test_outputs_without_any_scatter_are_named():
    made, start, _, R = system(np.random.default_rng(1))
    blind = Linear(made.F, made.B, 0 * made.H, made.D, NAMES, OUTPUTS)
    with pytest.raises(Diverged, match="at t = 0 s the variance of 'seen' is 0"):
        Ukf(blind, start, np.eye(3), 0 * R, DT).step(np.zeros(1), np.array([3.0, 3.0]))
    with pytest.raises(Diverged, match="variance of 'felt' is -"):
        Ukf(made, start, np.eye(3), np.diag([1.0, -1e3]), DT).step(np.zeros(1), np.zeros(2))


def test_a_state_that_leaves_the_numbers_ends_the_filter_with_what_it_has():
    made, start, Q, R = system(np.random.default_rng(1))
    wild = Linear(made.F * 1e200, made.B, made.H, made.D, NAMES, OUTPUTS)
    y = np.full((5, 2), np.nan)
    with np.errstate(all="ignore"):
        found = filtered(Kf(wild, start, Q, R, DT), samples(DT * np.arange(5), np.zeros((5, 1)), y))
    assert found.broken.startswith("at t = 0.")
    assert len(found.t) < 5
    assert np.isfinite(found.x).all()


def test_an_exactly_known_state_breaks_nothing():
    """Without process noise correlations go to one: semidefinite to rounding is not broken."""
    still = Linear(np.eye(3), np.zeros((3, 1)), np.ones((2, 3)), np.zeros((2, 1)), NAMES, OUTPUTS)
    start = Estimate(0.0, np.zeros(3), np.eye(3))
    for kind in (Ukf, Kf):
        filter = kind(still, start, np.zeros((3, 3)), 1e-10 * np.eye(2), DT)
        for _ in range(2000):
            found = filter.step(np.zeros(1), np.array([3.0, 3.0]))
        assert_allclose(found.x, np.ones(3), atol=1e-6)
        assert found.P.diagonal().min() > 0


def test_a_gate_keeps_outliers_out_and_reports_them_until_they_are_the_rule():
    rng = np.random.default_rng(6)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng)
    spoilt = Y.copy()
    spoilt[20, 0] += 1e3
    clean = run(Ukf(made, start, Q, R, DT, gate=Gate(6.0)), u, Y)
    found = run(Ukf(made, start, Q, R, DT, gate=Gate(6.0)), u, spoilt)
    without = Y.copy()
    without[20, 0] = np.nan
    missing = run(Ukf(made, start, Q, R, DT, gate=Gate(6.0)), u, without)
    assert not any(e.gated.any() for e in clean)
    assert [k for k, e in enumerate(found) if e.gated.any()] == [20]
    assert_array_equal(found[20].gated, [True, False])
    assert_array_equal(found[-1].x, missing[-1].x)
    spoilt[20:, 0] += 1e3
    stubborn = run(Ukf(made, start, Q, R, DT, gate=Gate(6.0, patience=5)), u, spoilt)
    assert [bool(e.gated[0]) for e in stubborn[20:27]] == [True] * 5 + [False] * 2


def test_noise_that_was_declared_wrong_is_found():
    rng = np.random.default_rng(7)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng, n=4000)
    filter = Ukf(made, start, Q, R / 16, DT, adapt=Adaptation(samples=500.0))
    run(filter, u, Y)
    assert_allclose(filter.now.memory.R, [16.0, 16.0], rtol=0.3)
    right = Ukf(made, start, Q / 25, R, DT, adapt=Adaptation(500.0, measurement=False, process=True))
    run(right, u, Y)
    assert pytest.approx(25.0, rel=0.4) == right.now.memory.Q


@pytest.mark.parametrize("process", [False, True])
def test_what_is_not_known_at_the_start_is_not_taken_for_noise(process):
    rng = np.random.default_rng(10)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng, n=200)
    unsure = Estimate(0.0, start.x, 1e4 * start.P)
    adapt = Adaptation(samples=500.0, measurement=not process, process=process)
    for found in run(Ukf(made, unsure, Q, R, DT, adapt=adapt), u, Y):
        assert_allclose([*found.memory.R, found.memory.Q], 1.0, atol=0.7)  # 0.16 is a standard deviation


def test_an_outlier_is_not_taken_for_noise():
    rng = np.random.default_rng(11)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng, n=400)
    Y[200, 0] += 1e3 * np.sqrt(R[0, 0])
    found = run(Ukf(made, start, Q, R, DT, adapt=Adaptation(samples=500.0)), u, Y)
    assert found[200].memory.R[0] < 2.5
    assert_allclose(found[199].memory.R, 1.0, atol=0.4)


def test_least_squares_are_least_squares():
    rng = np.random.default_rng(8)
    phi, theta = rng.standard_normal((400, 1, 2)), np.array([1.5, -0.7])
    y = phi @ theta + 0.1 * rng.standard_normal((400, 1))
    found = run(Rls(("a", "b"), Estimate(0.0, np.zeros(2), 1e8 * np.eye(2)), [[0.01]]), phi, y)
    expected = np.linalg.lstsq(phi[:, 0], y[:, 0], rcond=None)[0]
    assert_allclose(found[-1].x, expected, atol=1e-8)
    assert_allclose(found[-1].P, 0.01 * np.linalg.inv(phi[:, 0].T @ phi[:, 0]), rtol=1e-6)
    y[7] = np.nan
    assert np.isfinite(run(Rls(("a", "b"), found[0], [[0.01]]), phi, y)[-1].x).all()


def test_forgetting_follows_a_change_and_does_not_wind_up_at_rest():
    rng = np.random.default_rng(9)
    phi = np.ones((6000, 1, 2))
    phi[:3000, 0, 1] = rng.standard_normal(3000)  # then nothing tells the two apart
    theta = np.where(np.arange(6000)[:, None] < 1500, [1.0, 2.0], [1.0, 3.0])
    y = np.einsum("kij,kj->ki", phi, theta) + 0.1 * rng.standard_normal((6000, 1))
    start = Estimate(0.0, np.zeros(2), 100 * np.eye(2))
    found = run(Rls(("a", "b"), start, [[0.01]], forgetting=0.99), phi, y)
    assert_allclose(found[2900].x, [1.0, 3.0], atol=0.1)
    assert np.linalg.eigvalsh(found[-1].P).max() <= 100.0 * (1 + 1e-9)
    with pytest.raises(ValueError, match=r"forgetting = 1\.5 is not in"):
        Rls(("a", "b"), start, [[0.01]], forgetting=1.5)


def test_a_linear_system_is_its_own_linearisation():
    made, start, _, _ = system(np.random.default_rng(3))
    found = linearised(made, start.x, np.array([0.7]), DT, np.ones(3))
    for part in "FBHD":
        assert_allclose(getattr(found, part), getattr(made, part), atol=1e-8)
    X = np.random.default_rng(4).standard_normal((4, 3))
    assert_allclose(found.f(X, np.ones(1), 0, DT, X[0])[0], made.f(X, np.ones(1), 0, DT, X[0])[0], atol=1e-7)


class Gain:
    """x+ = a x + u with an unknown a: a joint system of a state and a parameter."""

    names, outputs = ("x", "a"), ("x",)

    def f(self, X, u, t, dt, carried):
        return np.column_stack([X[:, 1] * X[:, 0] + u[0], X[:, 1]]), carried

    def h(self, X, u, t, carried):
        return X[:, :1]

    def settled(self, x):
        return x


def test_on_a_nonlinear_system_it_is_filterpys_unscented_filter():
    rng = np.random.default_rng(12)
    start = Estimate(0.0, np.array([0.5, 0.6]), np.diag([1.0, 0.09]))
    Q, R = np.diag([0.01, 1e-4]), np.array([[0.04]])
    points = MerweScaledSigmaPoints(2, 0.8, 2.0, 0.5)
    theirs = UnscentedKalmanFilter(
        2, 1, DT, lambda x: x[:1], lambda x, _: np.array([x[1] * x[0] + 1.0, x[1]]), points
    )
    theirs.x, theirs.P, theirs.Q, theirs.R = start.x, start.P, Q, R
    ours = Ukf(Gain(), start, Q, R, DT, spread=Spread(0.8, 2.0, 0.5))
    ours.step(np.ones(1), np.full(1, np.nan))
    for y in rng.standard_normal((50, 1)) + 2.5:
        theirs.predict()
        theirs.update(y)
        found = ours.step(np.ones(1), y)
        assert_allclose(found.x, theirs.x, atol=1e-11)
        assert_allclose(found.P, theirs.P, atol=1e-11)
        assert found.log_likelihood == pytest.approx(theirs.log_likelihood, abs=1e-9)


def test_the_dual_filter_finds_what_the_joint_one_finds():
    rng = np.random.default_rng(10)
    n, x, y = 3000, 0.0, []
    u = rng.standard_normal((n, 1))
    for k in range(n):
        if k:
            x = 0.8 * x + (u[k, 0] + u[k - 1, 0]) / 2 + 0.05 * rng.standard_normal()
        y.append([x + 0.1 * rng.standard_normal()])
    Q, R = np.diag([0.05**2, 1e-12]), np.array([[0.01]])
    start = Estimate(0.0, np.array([0.0, 0.3]), np.diag([1.0, 0.25]))
    joint = run(Ukf(Gain(), start, Q, R, DT), u, np.array(y))[-1]
    dual = run(Dual(Gain(), 1, start, Q, R, DT), u, np.array(y))[-1]
    assert joint.x[1] == pytest.approx(0.8, abs=4 * np.sqrt(joint.P[1, 1]))
    assert dual.x[1] == pytest.approx(joint.x[1], abs=0.03)
    assert dual.P[0, 1] == 0.0


@pytest.mark.skipif(not hasattr(algebra.mean, "py_func"), reason="numba is not installed")
def test_compiled_and_plain_algebra_agree():
    rng = np.random.default_rng(11)
    L, X, Y = rng.standard_normal((3, 3)), rng.standard_normal((7, 3)), rng.standard_normal((7, 2))
    P, w = L @ L.T + np.eye(3), rng.random(7)
    H, S = rng.standard_normal((2, 3)), np.array([[2.0, 0.3], [0.3, 1.0]])
    n, m, nn, nm, mm = (np.zeros(shape) for shape in (3, 2, (3, 3), (3, 2), (2, 2)))
    one, both, counts = np.array([True, False]), np.ones(2, bool), np.array([3.0, 0.0])
    correction = (X, X[0], Y, Y[0], S), (Y[1], 0.1 * S, w, 1.3, n, nn, nn.copy())
    weighed = (Y[0], Y[1], S, 0.1 * S), (m, both, both, counts)
    for name, arguments in {
        "symmetric": (L,), "factorise": (P, nn), "finite": (X[0],), "there": (Y[0], np.zeros(2, bool)),
        "draw": (X[0], L, 1.3, X.copy()), "mean": (X, w, n), "cross": (X, X[0], Y, Y[0], w, nm),
        "covariance": (X, X[0], w, nn), "drawn": (X[0], P, 1.3, nn, X.copy()),
        "predict": (X[::-1].copy(), w, w, P, 1.3, L, X, n, nn, nn.copy()),
        "expect": (X[:, :2], w, w, Y, m, mm), "solve": (np.tril(P), L),
        "correct": (*correction[0], both, *correction[1]),
        "correct by one": (*correction[0], one, *correction[1]),
        "joseph": (X[0], P, H, Y[0], S), "log_density": (Y[0], S),
        "weigh": (*weighed[0], np.inf, 0, *weighed[1]),
        "weigh with a gate": (*weighed[0], 0.9, 2, *weighed[1]),
        "matched": (Y[0], S, 0.1 * S, one, 0.01, np.ones(2), np.ones(2), np.ones(2)),
    }.items():  # fmt: skip
        function = getattr(matching if name == "matched" else algebra, name.split(" ")[0])
        for a, b in zip(_made(function, arguments), _made(function.py_func, arguments), strict=True):
            assert_allclose(a, b, rtol=1e-12, atol=1e-13)


def _made(function, arguments):
    """What a function returns, and what becomes of its arguments."""
    given = [np.copy(a) if isinstance(a, np.ndarray) else a for a in arguments]
    result = function(*given)
    return [*(result if isinstance(result, tuple) else (0.0 if result is None else result,)), *given]


@pytest.mark.parametrize("n", [37, 60])  # the last block is full or not
def test_the_history_of_a_long_record_is_that_of_a_short_one(n, monkeypatch):
    rng = np.random.default_rng(3)
    made, start, Q, R = system(rng)
    _, u, Y = record(made, start, Q, R, rng, n, missing=0.2)
    s = samples(DT * np.arange(n), u, Y)
    whole = filtered(Kf(made, start, Q, R, DT), s)
    monkeypatch.setattr(aside, "LONG", 1)
    monkeypatch.setattr(aside, "BLOCK", 20 * 8 * 14)  # twenty rows of three states and two outputs
    parts = filtered(Kf(made, start, Q, R, DT), s)
    assert not parts.x.flags.writeable
    for name in ("t", "x", "std", "innovation", "nis", "freedom", "gated", "log_likelihood"):
        assert_array_equal(getattr(parts, name), getattr(whole, name))
