"""Ends of intervals: exact where the residual is linear, elsewhere where the profile likelihood has them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from estimator.closeloop.fitting.fit import REFUSED, fit
from estimator.closeloop.fitting.profile_trace import WIDTH, ends
from estimator.closeloop.fitting.slopes import FINE_STEP
from estimator.closeloop.fitting.slopes_within_error import within_error
from estimator.closeloop.hypotheses.fitted import WIDE
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.record import Array, Run
from estimator.weighting import Weighting
from tests.helpers.baselines import fit_with
from tests.helpers.problems import OneByOne, record_with

WHITE = Weighting.white(np.array([1.0]))
Model = Callable[[Sequence[float]], Array]  # output (m,) in units of the noise, from the unknowns


class Written(OneByOne):
    """A model that is written on paper, with noise of size one; it counts its simulations."""

    policy = DEFAULT
    free_states = ()

    def __init__(self, model: Model, y: Array, at_once: int = 1) -> None:
        self.model, self.at_once, self.simulated = model, at_once, 0
        every = np.ones(len(y), bool)
        run = Run(np.arange(len(y)) * 1.0, y[:, None], y[:, None], every, ~every, ~every)
        self.record = record_with(runs=(run,), noise_declared=np.array([True]), outputs=("y",))

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        """See Problem."""
        self.simulated += 1
        return self.record.runs[0].y - self.model(list(theta.values()))[:, None]


def optimum(problem: Written, unknowns: Sequence[Unknown]) -> Hypothesis:
    """The fit with slopes that hold near it."""
    found = fit(problem, unknowns, WHITE, evaluations=200, gain=1e-12, step=FINE_STEP)
    return within_error(problem, Hypothesis((), found, ()), WHITE)


def reached(problem: Written, h: Hypothesis) -> Array:
    """Lower and upper end of the interval of each unknown, (2, n)."""
    places, _ = ends(problem, h, [u.name for u in h.fit.unknowns], WHITE, leave=False)
    return np.array([places.min(axis=0), places.max(axis=0)])


def free(n: int, start: float = 0.0) -> list[Unknown]:
    return [Unknown(f"p{i}", start, -np.inf, np.inf, 1.0) for i in range(n)]


def information(matrix: Array, i: int) -> float:
    """What a linear record says about an unknown, if the others are held by their wide prior alone."""
    gram, o = matrix.T @ matrix, np.arange(matrix.shape[1]) != i
    held = gram[np.ix_(o, o)] + 12 / WIDE**2 * np.eye(int(o.sum()))
    return float(gram[i, i] - gram[i, o] @ np.linalg.solve(held, gram[o, i]))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 5), at_once=st.integers(1, 8))
def test_intervals_of_a_linear_model_end_where_slopes_say_after_one_simulation_each(seed, n, at_once):
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((200, n)) @ rng.standard_normal((n, n))
    problem = Written(lambda p: matrix @ p, matrix @ np.ones(n) + rng.standard_normal(200), at_once)
    h = optimum(problem, free(n))
    before = problem.simulated
    low, high = reached(problem, h)
    assert problem.simulated - before == 2 * n
    units = np.sqrt(h.fit.inflation)
    alone = WIDTH * units / np.sqrt([information(matrix, i) for i in range(n)])
    # an end of another unknown's interval, whose noise may be more correlated, may lie further out
    widest = WIDTH * units.max() * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    for reach in (high - h.fit.values, h.fit.values - low):
        assert np.all(reach >= (1 - 1e-3) * alone)
        assert np.all(reach <= (1 + 1e-3) * widest)


# ---- friction that hardly falls with the slip velocity: only the product (1 - A) B shows

SLIP = np.linspace(0.0, 0.25, 400)
FRICTION = (  # A is the limit over the maximum, B the rate of the fall
    Unknown("A", 0.7, 0.0, 1.0, 0.1),
    Unknown("B", 1.2, 0.0, np.inf, 0.5),
)
TRUE = (0.4, 0.6)


def friction(p: Sequence[float]) -> Array:
    """The friction coefficient over the slip velocity, in units of noise."""
    return 600.0 * ((1 - p[0]) * np.exp(-p[1] * SLIP) + p[0])


def slid(seed: int, shown: float = 1.0) -> Written:
    """A record of the friction; shown: share of it that acts on the output."""

    def model(p: Sequence[float]) -> Array:
        return shown * friction(p)

    return Written(model, model(TRUE) + np.random.default_rng(seed).standard_normal(len(SLIP)))


def profiled_end(problem: Written, h: Hypothesis, i: int, side: int) -> float:
    """The end of an interval by fits of all other unknowns on a fine grid, without any of the code tested."""
    low, high = (np.array([getattr(u, key) for u in h.fit.unknowns]) for key in ("low", "high"))
    others = np.arange(len(low)) != i
    most = cost(h) + WIDTH**2 * float(h.fit.inflation[i])
    bound = (high if side > 0 else low)[i]
    far = bound if np.isfinite(bound) else h.fit.values[i] + 50.0 * h.fit.std[h.fit.unknowns[i].name]
    near, start = float(h.fit.values[i]), h.fit.values[others]
    for value in near + (far - near) * np.linspace(0.0, 1.0, 300)[1:] ** 1.5:

        def residual(z: Array, held: float = value) -> Array:
            p = np.insert(z, i, held)
            return problem.record.runs[0].y[:, 0] - problem.model(p)

        found = least_squares(residual, start, bounds=(low[others], high[others]), x_scale=0.1)
        if 2 * found.cost > most:
            return near
        near, start = float(value), found.x
    return near


@pytest.mark.parametrize("seed", range(3))
def test_intervals_along_a_curved_ridge_end_where_those_of_a_fine_grid_do(seed):
    problem = slid(seed)
    h = optimum(problem, FRICTION)
    found = reached(problem, h)
    for i in range(2):
        for side, end in zip((-1, 1), found[:, i], strict=True):
            true = profiled_end(problem, h, i, side)
            tolerance = 0.15 * abs(true - h.fit.values[i]) + 0.01
            assert end == pytest.approx(true, abs=tolerance), (i, side)


def errors_from(problem: Written, h: Hypothesis, i: int, true: float) -> float:
    """How many standard errors the optimum lies from a true value, by the likelihood ratio."""
    low, high = (np.delete([getattr(u, key) for u in h.fit.unknowns], i) for key in ("low", "high"))

    def residual(z: Array) -> Array:
        return problem.record.runs[0].y[:, 0] - problem.model(np.insert(z, i, true))

    found = least_squares(residual, np.delete(TRUE, i), bounds=(low, high), x_scale=0.1)
    return float(np.sqrt(max(2 * found.cost - cost(h), 0.0) / h.fit.inflation[i]))


def test_intervals_along_a_curved_ridge_hold_the_truth_as_the_likelihood_ratio_does_and_slopes_do_not():
    slopes, traces = [], []
    for seed in range(30):
        problem = slid(seed, 1 / 6)
        h = optimum(problem, FRICTION)
        found = reached(problem, h)
        for i, (u, true) in enumerate(zip(h.fit.unknowns, TRUE, strict=True)):
            away = errors_from(problem, h, i, true)
            if abs(away - WIDTH) > 0.15 * WIDTH:
                slopes.append((abs(h.fit.values[i] - true) < WIDTH * h.fit.std[u.name]) == (away < WIDTH))
                traces.append((found[0, i] <= true <= found[1, i]) == (away < WIDTH))
    assert len(traces) > 40
    assert all(traces)
    assert np.mean(slopes) < 0.95


def test_an_interval_that_the_record_does_not_end_reaches_the_bound():
    problem = slid(0, 1 / 100)
    assert reached(problem, optimum(problem, FRICTION))[0, 0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("start", [0.9, 0.96])
def test_the_end_is_found_along_a_ridge_that_secants_cannot_follow(start):
    """The optimum lies at A near 1 and large B; on the way to A = 0, B falls as 1 / (1 - A)."""

    def model(p: Sequence[float]) -> Array:
        return 2e4 * ((1 - p[0]) * np.expm1(-p[1] * SLIP / 100) + 1)

    p = np.array([start, 0.36 / (1 - start)])
    problem = Written(model, model(p.tolist()) + np.random.default_rng(0).standard_normal(len(SLIP)))
    there = fit_with(FRICTION, p, np.eye(2), SLIP, np.eye(len(SLIP), 2))
    there = replace(there, residual=problem.identify_residual(there.theta).ravel())
    h = within_error(problem, Hypothesis((), there, ()), WHITE)
    assert reached(problem, h)[0, 0] == pytest.approx(0.0, abs=1e-6)


# ---- laws of likelihood intervals


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), unit=st.floats(1e-3, 1e3))
def test_intervals_do_not_depend_on_the_unit_or_on_the_form_of_a_parameter(seed, unit):
    """A likelihood interval of log a holds the logarithms of that of a; slopes at the optimum do not."""
    q = np.sin(np.linspace(0.0, 60.0, 1000))
    y = 20 * np.tanh(0.6 * q) + np.random.default_rng(seed).standard_normal(len(q))
    plain = Written(lambda p: 20 * unit * p[0] * np.tanh(p[1] * q), y)
    logs = Written(lambda p: 20 * np.exp(p[0]) * np.tanh(np.exp(p[1]) * q), y)
    a, b = Unknown("a", 0.9 / unit, 0.0, np.inf, 1 / unit), Unknown("b", 0.7, 0.0, np.inf, 1.0)
    ours = reached(plain, optimum(plain, (a, b)))
    theirs = np.exp(reached(logs, optimum(logs, free(2))))
    assert ours[:, 0] * unit == pytest.approx(theirs[:, 0], rel=0.03)
    assert ours[:, 1] == pytest.approx(theirs[:, 1], rel=0.03)


def test_the_ends_are_the_same_however_many_are_simulated_at_once():
    alone, together = slid(1), slid(1)
    together.at_once = 4
    h = optimum(alone, FRICTION)
    assert reached(together, h) == pytest.approx(reached(alone, h), rel=1e-9)


def test_where_the_fmu_cannot_be_simulated_the_interval_ends_before():
    def model(p: Sequence[float]) -> Array:
        return np.full(len(SLIP), 2 * REFUSED) if p[0] > 0.55 else friction(p)

    problem, sound = slid(2), slid(2)
    problem.model = model
    h = optimum(sound, [Unknown("A", 0.45, 0.0, 1.0, 0.1), Unknown("B", 0.66, 0.0, np.inf, 0.5)])
    low, high = reached(problem, h)
    assert high[0] <= 0.55
    assert np.all(high >= h.fit.values)
    assert np.all(low <= h.fit.values)


def test_a_lower_sum_of_squares_within_an_interval_ends_the_search_with_its_values():
    def model(p: Sequence[float]) -> Array:  # what does not fit near the optimum does from 1 on
        return np.repeat([p[0], 3.0 if p[0] < 1 else 0.0], 30) / np.sqrt(30)

    problem = Written(model, np.zeros(60))
    slope = np.repeat([-1.0, 0.0], 30) / np.sqrt(30)
    found = fit_with(free(1), np.zeros(1), np.eye(1), -model([0.0]), slope[:, None])
    h = Hypothesis((), found, ())
    _, deeper = ends(problem, h, ["p0"], WHITE, leave=True)
    assert deeper["p0"] == pytest.approx(WIDTH * float(np.sqrt(found.inflation[0])))
    assert ends(problem, h, ["p0"], WHITE, leave=False)[1] == {}
