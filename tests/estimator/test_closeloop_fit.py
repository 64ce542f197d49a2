"""Fits: derivatives along secants, unknowns at bounds, unknowns of two fits."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from estimator.closeloop.fitting import likelihood_profile as likelihood
from estimator.closeloop.fitting.fit import compressed, fit
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.slopes import (
    FADED,
    FINE_STEP,
    PARTS,
    STEP,
    Slopes,
)
from estimator.closeloop.fitting.slopes_within_error import within_error
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit, loose, sandwich
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.record import Run
from estimator.weighting import Weighting
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.problems import OneByOne, record_with

# ---- derivatives along secants


class Curved(OneByOne):
    """An oscillation with unknown size, damping and frequency, and how often it was simulated."""

    policy = DEFAULT

    def __init__(self, truth: np.ndarray, noise: np.ndarray) -> None:
        self.t, self.count = np.linspace(0.0, 10.0, len(noise)), 0
        self.y = self.simulate(truth) + noise

    def simulate(self, x: np.ndarray) -> np.ndarray:
        return x[0] * np.exp(-x[1] * self.t) * np.sin(x[2] * self.t)

    record, free_states = record_with(noise_declared=np.array([True])), ()

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        self.count += 1
        return (self.y - self.simulate(np.array(list(theta.values()))))[:, None]


NAMES = (
    Unknown("A", 1.0, 0.0, 9.0, 0.1),
    Unknown("d", 0.1, 0.0, 1.0, 0.02),
    Unknown("w", 3.0, 2.0, 4.0, 0.1),
)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.8, 1.3), st.floats(0.05, 0.2), st.floats(2.9, 3.1), st.integers(0, 99))
def test_a_fit_along_secants_ends_where_no_direction_gains(size, damping, speed, seed):
    noise = 0.1 * np.random.default_rng(seed).standard_normal(2000)
    asked = Curved(np.array([size, damping, speed]), noise)
    found = fit(asked, NAMES, Weighting.white(np.array([0.1])))
    assert found.converged
    score = found.jacobian.T @ found.residual
    assert np.all(np.abs(score) * np.sqrt(np.diag(found.covariance)) < 0.2)  # of a standard error
    h = 1e-6 * np.eye(3)
    exact = -np.column_stack([asked.simulate(found.values + d) - asked.simulate(found.values - d) for d in h])
    exact /= 2e-6 * 0.1
    assert_allclose(found.jacobian, exact, atol=0.03 * np.abs(exact).max())


def test_secants_spare_simulations():
    asked = Curved(np.array([1.2, 0.12, 3.05]), 0.1 * np.random.default_rng(0).standard_normal(2000))
    fit(asked, NAMES, Weighting.white(np.array([0.1])), gain=1e-9)
    assert asked.count < 20  # with differences at every step of the same way 6 times 4


# ---- rugged valleys


@dataclass
class Rugged(OneByOne):
    """A valley in x with ripples shorter than the usual step, and a step of the output at a sample."""

    policy = DEFAULT

    phase: float
    record, free_states = record_with(noise_declared=np.array([False])), ()  # no secants

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        x, t0 = theta["x"], theta["step_force_wheel_t0"]
        t = np.arange(0.0, 1.0, 0.01)
        ripple = 1e-3 * np.cos(x / 0.004 + self.phase)
        return np.concatenate([x + 0 * t, 1 + ripple + 0 * t, 1.0 * (t >= t0) - (t >= 0.5)])[:, None]


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 6.0), st.floats(0.3, 0.8))
def test_finer_differences_see_the_slopes_of_a_rugged_valley(phase, t0):
    asked = Rugged(phase)
    x, moment = Unknown("x", 0.5, -9.0, 9.0, 1.0), Unknown("step_force_wheel_t0", t0, 0.0, 1.0, 1.0)
    unit = Weighting.white(np.ones(1))
    valley = fit(asked, (x,), unit, fixed={moment.name: 0.5})
    found = fit(asked, (x,), unit, valley.theta, fixed={moment.name: 0.5}, step=FINE_STEP)
    assert found.residual @ found.residual <= valley.residual @ valley.residual < 0.45**2 * 100 + 101
    slope = -1e-3 / 0.004 * np.sin(found.values[0] / 0.004 + phase)
    assert_allclose(found.jacobian[100:200, 0], slope, atol=1e-3)
    timed = fit(asked, (x, moment), unit, step=FINE_STEP)
    assert np.any(timed.jacobian[:, 1])  # a moment is not moved less than a sample


def each(residual):
    """The residuals of several x, on a first share."""
    return lambda xs, share: [residual(x)[: int(share * len(residual(x)))] for x in xs]


MOVE = st.one_of(st.just(0.0), st.floats(0.05, 2.0), st.floats(-2.0, -0.05))


@given(st.lists(MOVE, min_size=6, max_size=6))
def test_a_carried_jacobian_keeps_to_the_last_step(moves):
    a = np.arange(12.0).reshape(4, 3) - 5.0

    def residual(x):
        return a @ x + 0.1 * (a @ x) ** 2

    slopes = Slopes(each(residual), np.array([1.0, 2.0, 0.5]), np.full(3, np.inf), [None] * 3)
    x = np.zeros(3)
    slopes.by_differences(x)
    for step in np.array(moves).reshape(2, 3):
        before, x = x, x + step
        jacobian = slopes.at(x)
        assert_allclose(jacobian @ step, residual(x) - residual(before), atol=1e-6, rtol=1e-6)
        assert not (slopes.exact and step.any())
    slopes.by_differences(x)
    assert slopes.exact


@given(st.integers(0, 2**32 - 1))
def test_differences_beside_a_residual_replace_secants(seed):
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((6, 5))

    def residual(x):
        return a @ x + 0.3 * (a @ x) ** 2

    slopes = Slopes(each(residual), np.ones(5), np.full(5, np.inf), [None] * 5, at_once=3)
    exact = Slopes(each(residual), np.ones(5), np.full(5, np.inf), [None] * 5)
    x, renewed = np.zeros(5), set()
    slopes.by_differences(x)
    for _ in range(3):  # two columns each time, of five
        x = x + rng.uniform(0.1, 1.0, 5)
        carried, wanted = slopes.at(x), exact.by_differences(x)
        right = {i for i in range(5) if np.allclose(carried[:, i], wanted[:, i], rtol=1e-9, atol=1e-9)}
        assert len(right) >= 2
        renewed |= right
    assert renewed == set(range(5))


def test_known_columns_stay():
    given_column = np.full(4, 7.0)

    def residual(x):
        return np.full(4, x.sum())

    slopes = Slopes(each(residual), np.ones(2), np.full(2, np.inf), [given_column, None])
    assert_allclose(slopes.by_differences(np.zeros(2)), [[7.0, 1.0]] * 4)


@given(st.integers(0, 99), st.booleans())
def test_a_compressed_problem_takes_the_same_steps(seed, bounded):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((200, 3)), rng.standard_normal(200)

    def residual(x):
        return a @ x + 0.2 * (a @ x) ** 2 - b

    def jacobian(x):
        return a * (1 + 0.4 * (a @ x))[:, None]

    bounds = (-0.3, 0.3) if bounded else (-np.inf, np.inf)
    how = {"bounds": bounds, "max_nfev": 4, "x_scale": np.array([1.0, 2.0, 0.5])}
    expected = least_squares(residual, np.full(3, 0.1), jacobian, **how)
    found = least_squares(*compressed(residual, jacobian, np.full(3, 0.1)), **how)
    assert_allclose(found.x, expected.x, rtol=1e-9, atol=1e-12)
    assert_allclose(found.cost, expected.cost)
    assert found.nfev == expected.nfev


class Fading:
    """A residual of two unknowns, the second of which fades at a rate that the first one sets."""

    policy = DEFAULT

    def __init__(self) -> None:
        self.t, self.samples = np.linspace(0.0, 1.0, 2400), 0

    def begun(self, xs, share):
        return [self(x, share) for x in xs]

    def __call__(self, x, share=1.0):
        t = self.t[: int(share * len(self.t))]
        self.samples += len(t)
        return x[0] * t + x[1] * np.exp(-x[0] * t)


@given(st.lists(st.floats(5.0, 400.0), min_size=1, max_size=9), st.integers(1, 5))
def test_columns_are_the_same_however_many_are_simulated_at_once(rates, at_once):
    t = np.linspace(0.0, 1.0, 480)

    def residual(x):
        return x**2 @ np.exp(-np.outer(rates, t))

    high, x = np.full(len(rates), np.inf), np.linspace(0.5, 1.5, len(rates))
    fading = range(0, len(rates), 2)
    one, some = (
        Slopes(each(residual), np.ones(len(rates)), high, [None] * len(rates), fading, at_once=n)
        for n in (1, at_once)
    )
    for _ in range(2):  # the second time with columns that are known to end
        expected, found = one.by_differences(x), some.by_differences(x)
        assert_allclose(found, expected, atol=2 * np.sqrt(FADED * np.max(np.sum(expected**2, axis=0))))


@given(st.floats(5.0, 400.0), st.floats(5.0, 400.0))
def test_what_fades_is_not_simulated_to_the_end(before, now):
    assume(before != now)  # what was simulated is not simulated again
    asked, whole = Fading(), Fading()
    ones, high = np.ones(2), np.full(2, np.inf)
    slopes, plain = (
        Slopes(asked.begun, ones, high, [None] * 2, (1,)),
        Slopes(whole.begun, ones, high, [None] * 2),
    )
    for rate in (before, now):
        x = np.array([rate, 0.3])
        found, expected = slopes.by_differences(x), plain.by_differences(x)
        assert_allclose(found, expected, atol=2 * np.sqrt(FADED * np.sum(expected[:, 1] ** 2)))
    length = int(np.ceil(PARTS * min(1.0, 7.0 / before)) + 1) / PARTS
    short = now >= before and length < 1.0
    assert (asked.samples < whole.samples) or not short
    assert asked.samples <= whole.samples + length * len(whole.t)


# ---- bounds


def at_a_bound(value: float) -> Fit:
    unknowns = (Unknown("held", 0.0, 0.0, 1.0, 0.1), Unknown("free", 0.0, -np.inf, np.inf, 1.0))
    j = np.random.default_rng(0).standard_normal((300, 2))
    return fit_with(unknowns, np.array([value, 3.0]), np.eye(2), j @ np.array([2.0, 0.0]), j)


def test_what_a_bound_holds_back_is_no_more_free():
    assert [u.name for u in loose(at_a_bound(1.0)).unknowns] == ["free"]
    left = loose(at_a_bound(0.0))
    assert left.jacobian.shape == (300, 1)
    assert left.theta == {"free": 3.0}
    assert loose(at_a_bound(0.5)).theta == at_a_bound(0.5).theta


@dataclass
class Summed(OneByOne):
    """An output that shows the sum of two unknowns, a + 2 b, and how often it was simulated."""

    policy = DEFAULT

    a: float
    b: float
    record, free_states = record_with(noise_declared=np.array([True])), ()

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        t = np.linspace(0.0, 1.0, 400)
        noise = np.random.default_rng(3).standard_normal(400)
        return (0.01 * noise + (self.a + 2 * self.b - theta["a"] - 2 * theta["b"]) * t)[:, None]


@settings(max_examples=25, deadline=None)
@given(st.floats(1.0, 3.0), st.floats(0.0, 8.0), st.floats(1.0, 3.0))
def test_of_two_that_tell_their_sum_the_bounded_one_ends_in_the_middle(true_b, begin_a, begin_b):
    unknowns = Unknown("a", begin_a, -np.inf, np.inf, 1.0), Unknown("b", begin_b, 1.0, 3.0, 0.2)
    found = fit(Summed(5.0, true_b), unknowns, Weighting.white(np.array([0.01])))
    assert found.theta["b"] == pytest.approx(2.0, abs=0.06)
    assert found.theta["a"] + 2 * found.theta["b"] == pytest.approx(5.0 + 2 * true_b, abs=0.01)
    assert found.std["b"] == pytest.approx(2 / np.sqrt(12), rel=0.02)
    assert abs(found.theta["a"] - 5.0) < 1.9 * found.std["a"]  # of a uniform distribution all of it
    assert found.residual @ found.residual < 1.2 * 400


@given(st.floats(0.0, 50.0))
def test_what_a_bound_holds_back_counts_as_an_error(pull):
    """Two unknowns that act alike, one held by a bound: the other one is off by what that one lacks."""
    rng = np.random.default_rng(1)
    a, noise = rng.standard_normal(3000), rng.standard_normal(3000)
    j = np.column_stack([a, 0.8 * a + 0.6 * rng.standard_normal(3000)])
    best = noise - j @ np.linalg.lstsq(j, noise, rcond=None)[0]
    covariance = sandwich(best + j @ np.array([pull, 0.0]), j, np.ones(2), np.full(2, np.inf))
    assert np.sqrt(covariance[0, 0]) >= 0.99 * pull
    assert np.sqrt(covariance[1, 1]) < 0.1 + 0.05 * pull


# ---- two fits


def test_a_fit_extended_by_another_has_the_unknowns_of_both():
    whole, part = at_a_bound(0.5), replace(at_a_bound(0.5), unknowns=(Unknown("own", 0, -1, 1, 1), NAMES[0]))
    found = part.extended(whole, {"free"})
    assert [u.name for u in found.unknowns] == ["own", "A", "free"]
    assert found.theta["free"] == whole.theta["free"]
    assert_allclose(found.jacobian[:, 2], whole.jacobian[:, 1])
    assert found.covariance.shape == (3, 3)
    assert found.std["free"] == whole.std["free"]
    assert found.slopes[2] is whole.slopes[1]  # not a copy


def test_a_fit_holds_the_derivatives_that_were_known_and_no_copies_of_them():
    unknowns = Unknown("a", 1.0, -np.inf, np.inf, 1.0), Unknown("b", 2.0, 1.0, 3.0, 0.2)
    known = {"b": np.linspace(0.0, -200.0, 400)}
    found = fit(Summed(5.0, 2.0), unknowns, Weighting.white(np.array([0.01])), known=known)
    assert found.slopes[1] is known["b"]
    assert found.columns["b"] is known["b"]
    copied = replace(found, slopes=tuple(column.copy() for column in found.slopes))
    again = copied.sharing(known)
    assert again.slopes[1] is known["b"]
    assert again.slopes[0] is copied.slopes[0]


# ---- errors where the sum of squares is a bent valley


class Playing(OneByOne):
    """A spring with play, over a motion some times wider: stiffness and play make up for each other."""

    policy = DEFAULT

    free_states = ()

    def __init__(self, seed: int) -> None:
        t = np.arange(400) * 0.01
        self.q = np.sin(2 * np.pi * t) + 0.4 * np.sin(2 * np.pi * 2.7 * t)
        y = np.clip(self.q, -0.2, 0.2) + 0.2 * np.random.default_rng(seed).standard_normal(len(t))
        every = np.ones(len(t), bool)
        run = Run(t, t[:, None], y[:, None], every, ~every, ~every)
        self.record = record_with(runs=(run,), noise_declared=np.array([True]), outputs=("y",))

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        [run] = self.record.runs
        return run.y - (theta["k"] * np.clip(self.q, -theta["gap"], theta["gap"]))[:, None]


def played(seed: int) -> tuple[Playing, Hypothesis]:
    asked = Playing(seed)
    k, gap = Unknown("k", 0.0, 0.0, np.inf, 1.0), Unknown("gap", 0.2, 0.0, np.inf, 0.02)
    found = fit(asked, (k, gap), Weighting.white(np.array([0.2])), {"k": 0.8, "gap": 0.25})
    return asked, Hypothesis((Candidate("free_play", "spring", (k,), (gap,)),), found, ())


def test_errors_reach_as_far_as_the_valley_does(monkeypatch):
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    true, held, wider = {"k": 1.0, "gap": 0.2}, [], []
    for seed in range(40):
        asked, h = played(seed)
        found = likelihood.profiled(Fitter(baseline(asked, noise=0.2)), h).fit
        assert found.theta == h.fit.theta
        held += [abs(found.theta[n] - v) < 1.96 * found.std[n] for n, v in true.items()]
        at_minimum = within_error(asked, h, Weighting.white(np.array([0.2]))).fit
        wider += [found.std[n] / at_minimum.std[n] for n in true]
    assert np.mean(held) > 0.9
    assert min(wider) > 1 - 1e-9
    assert max(wider) > 1.3


def test_errors_of_a_law_that_is_linear_in_what_is_fitted_stay(monkeypatch):
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    asked, bent = played(1)
    size, white = bent.candidates[0].amplitudes, Weighting.white(np.array([0.2]))
    law = Candidate("free_play", "spring", size, fixed={"gap": bent.fit.theta["gap"]})
    found = fit(asked, size, white, bent.fit.theta, {"gap": bent.fit.theta["gap"]})
    fitter = Fitter(baseline(asked, noise=0.2))
    at_minimum = within_error(asked, Hypothesis((law,), found, ()), white)
    again = likelihood.profiled(fitter, Hypothesis((law,), found, ())).fit
    assert_allclose(again.covariance, at_minimum.fit.covariance, rtol=1e-2)


def test_errors_of_a_bent_law_do_not_depend_on_whether_its_noise_is_declared(monkeypatch):
    """Weights then come from what the best fit leaves, and serve as well."""
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    asked, h = played(1)
    declared = likelihood.profiled(Fitter(baseline(asked, noise=0.2)), h).fit.std
    asked.record.noise_declared = np.array([False])
    assert likelihood.profiled(Fitter(baseline(asked, noise=0.2)), h).fit.std == declared


class Beginning(Playing):
    """A force in proportion to a motion that rests for a while, from a moment on."""

    def __init__(self, moment: float, seed: int) -> None:
        t = np.arange(800) * 0.01
        self.q = np.where((t > 3.0) & (t < 3.3), 0.0, np.sin(2 * np.pi * 3.0 * t))
        every = np.ones(len(t), bool)
        self.record = record_with(
            runs=(Run(t, t[:, None], t[:, None], every, ~every, ~every),), noise_declared=np.array([True])
        )
        y = 0.1 * np.random.default_rng(seed).standard_normal((len(t), 1))
        y -= self.identify_residual({"d": 1.0, "d_t0": moment}) - t[:, None]
        self.record.runs = (Run(t, t[:, None], y, every, ~every, ~every),)

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        [run] = self.record.runs
        acts = (1 + np.tanh((run.t - theta["d_t0"]) / 0.02)) / 2
        return run.y - (theta["d"] * acts * self.q)[:, None]


def begun(moment: float, start: float, seed: int) -> tuple[Beginning, Hypothesis]:
    asked = Beginning(moment, seed)
    d, t0 = Unknown("d", 0.0, -np.inf, np.inf, 1.0), Unknown("d_t0", start, 0.0, 8.0, 0.05)
    found = fit(asked, (d, t0), Weighting.white(np.array([0.1])), {"d": 0.9, "d_t0": start})
    return asked, Hypothesis((Candidate("damping_change", "spring", (d,), (t0,)),), found, ())


def test_errors_of_a_moment_reach_over_a_rest(monkeypatch):
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    monkeypatch.setattr(likelihood, "with_duration", lambda _, h: h)
    before, after = [], []
    for seed in range(40):
        true, start = np.random.default_rng(seed).uniform(3.05, 3.25, 2)
        asked, h = begun(true, start, seed)
        found = likelihood.profiled(Fitter(baseline(asked, noise=0.1)), h).fit
        before.append(abs(h.fit.theta["d_t0"] - true) < 1.96 * h.fit.std["d_t0"])
        after.append(abs(found.theta["d_t0"] - true) < 1.96 * found.std["d_t0"])
        assert found.std["d_t0"] < 3.0
    assert np.mean(before) < 0.8
    assert np.mean(after) > 0.9


class Sliding(Playing):
    """Friction of a body that never slows down enough to show how its friction is rounded about zero."""

    def __init__(self, seed: int) -> None:
        t = np.arange(400) * 0.01
        self.v = 0.5 + 0.3 * np.sin(2 * np.pi * t)
        y = np.tanh(self.v / 1e-3) + 0.05 * np.random.default_rng(seed).standard_normal(len(t))
        every = np.ones(len(t), bool)
        run = Run(t, t[:, None], y[:, None], every, ~every, ~every)
        self.record = record_with(runs=(run,), noise_declared=np.array([True]), outputs=("y",))

    sharpest = np.inf  # least rounding that was simulated

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        [run] = self.record.runs
        self.sharpest = min(self.sharpest, theta["v_s"])
        return run.y - (theta["F_c"] * np.tanh(self.v / theta["v_s"]))[:, None]


def test_an_interval_reaches_the_bound_of_a_shape_on_which_the_record_does_not_depend(monkeypatch):
    """Slopes are zero from some rounding on, so that none of them leads there."""
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    force = Unknown("F_c", 1.0, 0.0, np.inf, 1.0)
    rounding = Unknown("v_s", 0.15, 1e-6, np.inf, 0.02)
    before, after = [], []
    for seed in range(120):
        asked = Sliding(seed)
        found = fit(asked, (force, rounding), Weighting.white(np.array([0.05])), {"F_c": 1.0, "v_s": 0.15})
        h = Hypothesis((Candidate("coulomb_friction", "rail", (force,), (rounding,)),), found, ())
        whole = likelihood.profiled(Fitter(baseline(asked, noise=0.05)), h)
        before.append(abs(h.theta["v_s"] - 1e-3) < 1.96 * h.fit.std["v_s"])
        after.append(abs(whole.theta["v_s"] - 1e-3) < 1.96 * whole.fit.std["v_s"])
        assert (likelihood.reaching_a_bound(whole) == ["v_s"]) == after[-1]
    assert np.mean(after) > 0.9
    assert np.mean(before) < 0.8


def test_an_interval_that_reaches_what_the_record_cannot_show_is_as_wide_without_simulating_it(monkeypatch):
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    monkeypatch.setattr(likelihood, "carefully", lambda _, h: h)  # a fit may go there,
    monkeypatch.setattr(likelihood, "DEEPER_ROUNDS", 0)  # and so may one from a place of the profile
    force = Unknown("F_c", 1.0, 0.0, np.inf, 1.0)
    rounding = Unknown("v_s", 0.15, 1e-6, np.inf, 0.02)
    reached = 0
    for seed in range(20):
        asked = Sliding(seed)
        found = fit(asked, (force, rounding), Weighting.white(np.array([0.05])), {"F_c": 1.0, "v_s": 0.15})
        widths, sharpest = [], []
        for visible in ({}, {"v_s": 1e-5}):
            c = Candidate("coulomb_friction", "rail", (force,), (rounding,), visible=visible)
            asked.sharpest = np.inf
            fitter = Fitter(baseline(asked, noise=0.05))
            widths.append(likelihood.profiled(fitter, Hypothesis((c,), found, ())).fit.std["v_s"])
            sharpest.append(asked.sharpest)
        assert widths[1] == pytest.approx(widths[0], rel=0.01)
        assert sharpest[1] >= min(1e-5, found.theta["v_s"]) * (1 - 1e-9)
        reached += sharpest[0] < 1e-5
    assert reached > 10  # without it, they are simulated


class Swinging(Playing):
    """A harmonic force of any frequency, which is a constant one at the lowest."""

    def __init__(self, f: float, seed: int) -> None:
        self.t = np.arange(400) * 0.01
        y = np.sin(2 * np.pi * f * self.t) + 0.2 * np.random.default_rng(seed).standard_normal(400)
        every = np.ones(len(y), bool)
        run = Run(self.t, self.t[:, None], y[:, None], every, ~every, ~every)
        self.record = record_with(runs=(run,), noise_declared=np.array([True]), outputs=("y",))

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        [run] = self.record.runs
        phase = 2 * np.pi * theta["f"] * self.t
        return run.y - (theta["F_sin"] * np.sin(phase) + theta["F_cos"] * np.cos(phase))[:, None]


@given(st.floats(0.8, 8.0), st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_an_interval_does_not_reach_a_bound_at_which_the_law_is_another_one(f, seed):
    """At no frequency the two amplitudes cannot make up for the line, as they do at its own."""
    asked = Swinging(f, seed)
    size = [Unknown(n, 0.0, -np.inf, np.inf, 1.0) for n in ("F_sin", "F_cos")]
    shape = Unknown("f", f, 0.0, np.inf, 0.1)
    found = fit(asked, (*size, shape), Weighting.white(np.array([0.2])), {"F_sin": 1.0, "F_cos": 0.0, "f": f})
    h = Hypothesis((Candidate("harmonic_excitation", "rail", tuple(size), (shape,)),), found, ())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(likelihood, "built", lambda problem, _: problem)
        whole = likelihood.profiled(Fitter(baseline(asked, noise=0.2)), h)
    assert whole.fit.std["f"] < 2 * found.std["f"]
    assert not likelihood.reaching_a_bound(whole)


class Refitter(Fitter):
    """Fits without an FMU."""

    def finished(self, promises, unknowns=None, guess=None, step=STEP):
        """See Fitter."""
        problem, weighting = self.baseline.problem, self.baseline.noise.weighting
        fits = [fit(problem, p.candidates[0].unknowns, weighting, p.start) for p in promises]
        return [Hypothesis(p.candidates, found, ()) for p, found in zip(promises, fits, strict=True)]


def test_a_moment_a_swing_off_is_fitted_again(monkeypatch):
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    monkeypatch.setattr(likelihood, "with_duration", lambda _, h: h)
    monkeypatch.setattr(likelihood, "refined", lambda _, h: h)
    asked, h = begun(5.0, 5.0, 0)
    off = asked.identify_residual({"d": 1.0, "d_t0": 5.35}).ravel() / 0.1
    stayed = replace(h, fit=replace(h.fit, values=np.array([1.0, 5.35]), residual=off))
    found = likelihood.profiled(Refitter(baseline(asked, noise=0.1)), stayed).fit
    assert found.theta["d_t0"] == pytest.approx(5.0, abs=0.03)


@dataclass(frozen=True)
class Saturating(OneByOne):
    """A motion whose size saturates with a calibrated parameter, and a sensor with a bias."""

    q: np.ndarray
    record: Any
    declared: Mapping[str, float]
    free_states = ()

    def identify_residual(self, theta: Mapping[str, float]) -> np.ndarray:
        [run] = self.record.runs
        return run.y - (np.tanh(4 * theta["mu"]) * self.q + theta.get("bias", 0.0))[:, None]


class Briefly(Fitter):
    """Fits without an FMU."""

    def fitted(self, promises, evaluations, unknowns=None, known=None, guess=None, step=STEP):
        """See Fitter."""
        asked, noise = self.baseline.problem, self.baseline.noise.weighting
        found = []
        for p in promises:
            every = [*unknowns, *(u for c in p.candidates for u in c.unknowns)]
            made = fit(asked, every, noise, p.start, None, evaluations, known)
            found.append(Hypothesis(p.candidates, made, ()))
        return best_by_label(found)


@given(st.floats(0.1, 0.4), st.floats(1.5, 3.0), st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_a_brief_fit_that_is_worse_than_without_its_effect_begins_there(mu, begin, seed):
    """The linearisation begins where the motion is saturated, so that no slope leads back."""
    t = np.arange(500) * 0.01
    q = np.sin(2 * np.pi * t)
    y = np.tanh(4 * mu) * q + 0.05 + 0.01 * np.random.default_rng(seed).standard_normal(len(t))
    every = np.ones(len(t), bool)
    run = Run(t, t[:, None], y[:, None], every, ~every, ~every)
    record = record_with(runs=(run,), noise_declared=np.array([True]), outputs=("y",))
    asked = Saturating(q, record, {})
    calibrated = Unknown("mu", 0.3, 0.0, 5.0, 0.1)
    base = fit(asked, [calibrated], Weighting.white(np.array([0.01])))
    fitter = Briefly(baseline(asked, Hypothesis((), base, ()), noise=0.01))
    bias = Candidate("sensor_bias", "y", (Unknown("bias", 0.0, -np.inf, np.inf, 0.1),), ())
    [found] = fitter.briefly([Promise((bias,), 0.0, {"mu": begin, "bias": 0.0})])
    assert cost(found) < 1.3 * len(t)
    assert found.theta["bias"] == pytest.approx(0.05, abs=0.005)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 2**32 - 1), apart=st.floats(1e-5, 1.0), slow=st.integers(1, 50))
def test_no_value_moves_by_more_errors_than_the_residual_by_units_of_noise(seed, apart, slow):
    """However alike two unknowns are, and however correlated the residual that sizes their errors."""
    rng = np.random.default_rng(seed)
    first, second, change = rng.standard_normal((3, 600))
    jacobian = np.column_stack([first, first + apart * second])
    residual = np.convolve(rng.standard_normal(600 + slow - 1), np.ones(slow), "valid")
    scale, width = np.ones(2), np.full(2, 2e3)
    covariance = sandwich(residual, jacobian, scale, width)
    unknowns = [Unknown(n, 0.0, -1e3, 1e3, 1.0) for n in "ab"]
    found = fit_with(unknowns, np.zeros(2), covariance, residual, jacobian)
    moved = np.abs(found.moved_by(change)) / np.sqrt(np.diag(covariance))
    assert np.all(moved <= np.linalg.norm(change) * (1 + 1e-6))
