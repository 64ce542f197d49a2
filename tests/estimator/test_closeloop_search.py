"""How close-loop finds its way: inputs, linear answers, smoothing, moments, lookalikes, onsets."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.hypotheses.relations import becomes
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.grouped import group_size, grouped
from estimator.closeloop.screening.linear import (
    Linearised,
    influences,
    responses,
    shows_its_state,
)
from estimator.closeloop.screening.onset_times import at_their_onsets
from estimator.closeloop.screening.regressors import Calibration
from estimator.closeloop.screening.screen import screen
from estimator.closeloop.screening.smoothing import WALKS, _first_guess, smooth
from estimator.closeloop.search import search
from estimator.closeloop.search.lookalikes import lookalikes, over_the_same
from estimator.closeloop.search.nomination import overlooked
from estimator.closeloop.search.onset import ONSET_BLOCKS, onset
from estimator.closeloop.search.simpler import from_the_start, in_groups
from estimator.plant import between
from estimator.record import Record, Run
from estimator.weighting import Weighting
from fmus.export.builders.hypotheses import ModelBuilder
from fmus.models import MODELS
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.foreign import GOOD
from tests.helpers.native import native
from tests.helpers.problems import Always, OneByOne, record_with

FREE = (-np.inf, np.inf)


def nothing_calibrated(residual):
    return fit_with((), np.zeros(0), np.zeros((0, 0)), residual, np.zeros((len(residual), 0)))


def candidate(kind, location, shape=(), amplitude="F_0"):
    prefix = f"{kind}_{location}_"
    unknowns = (Unknown(prefix + amplitude, 0.0, *FREE, 1.0),)
    return Candidate(
        kind, location, unknowns, tuple(Unknown(prefix + n, v, 0.0, np.inf, 1.0) for n, v in shape)
    )


# ---- what is fitted besides where nothing explains


def test_constant_changes_that_calibration_may_hide_are_tried_too():
    def promise(kind, location, gain):
        return Promise((candidate(kind, location),), gain, {})

    tried, more = [promise("viscous_damping", "contact", 900.0)], DEFAULT.search.overlooked_more
    others = [promise("hysteresis", f"place_{i}", 800.0 - i) for i in range(more + 3)]
    hidden = [promise("parameter_offset", "m_w", 90.0), promise("actuator_gain", "V", 70.0)]
    rest = [
        promise("parameter_offset", "m_w", 60.0),  # another shape of one that is there
        promise("parameter_offset", "mu0", 65.0),  # calibrated
        promise("sensor_gain", "y", 80.0),
        promise("parameter_offset", "A", 1.0),  # noise makes as much
    ]
    found = overlooked(DEFAULT, [*tried, *others, *hidden, *rest], tried, {"mu0"})
    assert found == [*hidden, *others[:more]]


# ---- inputs between samples


@given(st.floats(0.2, 12.0), st.floats(0.0, 6.0), st.integers(2, 8))
def test_an_input_with_its_rate_is_a_cubic_between_the_samples(frequency, phase, pieces):
    t, w = np.arange(0.0, 1.0, 0.01), 2 * np.pi * frequency
    u, rate = np.sin(w * t + phase), w * np.cos(w * t + phase)
    fine, found = between(t, {"u": u, "u_dot": rate, "v": u}, pieces)
    assert_allclose(fine[::pieces], t, atol=1e-15)
    assert_allclose(found["u"][::pieces], u, atol=1e-12)
    assert_allclose(found["u_dot"][::pieces], rate, atol=1e-9 * w)
    bound = (w * 0.01) ** 4 / 384  # of a cubic that has values and rates
    assert np.abs(found["u"] - np.sin(w * fine + phase)).max() <= bound + 1e-12
    assert_allclose(found["v"], np.interp(fine, t, u), atol=1e-12)


@pytest.mark.parametrize("hidden", [False, True])
def test_an_fmu_between_coarse_samples_shows_its_state(hidden):
    """10 Hz in samples of 5 ms: a restart has to see what the free run saw between them."""
    t, w = np.arange(0.0, 2.0, 0.005), 20 * np.pi
    u, rate = 1e-3 * np.sin(w * t), 1e-3 * w * np.cos(w * t)
    every, inputs = np.ones(len(t), bool), ("u_fl", "u_fl_dot")
    run = Run(t, np.column_stack([u, rate]), np.zeros((len(t), 1)), every, ~every, ~every)
    record = Record((run,), inputs, ("z1_ddot",), np.array([np.nan]))
    problem = Problem(Always(native("vehicle7dof")), record, {}, {})
    x = problem.simulate({}, problem.plant.states)[0][:, 1:]
    if hidden:
        x[:, 3] *= 1.01
    assert shows_its_state(problem, {}, x) is not hidden


# ---- linear answers


@pytest.mark.parametrize("lever", ["h_b2_fr", "h_k2_fr", "h_b1_rl", "m2"])
@pytest.mark.parametrize("share", [0.0, 0.6])
def test_what_a_parameter_changes_is_what_a_simulation_says(lever, share):
    """On a track as short-waved as axle boxes feel, much faster than the linearisations lie apart."""
    t = np.arange(0.0, 20.0, 0.005)
    inputs, columns = [], []
    for i, corner in enumerate(("fl", "fr", "rl", "rr")):
        w, phase = 2 * np.pi * np.array([0.9, 4.3, 7.9]), np.array([0.3, 1.1, 2.7]) * (i + 1)
        inputs += [f"u_{corner}", f"u_{corner}_dot"]
        columns += [1e-3 * np.sin(np.outer(t, w) + phase).sum(1)]
        columns += [1e-3 * (w * np.cos(np.outer(t, w) + phase)).sum(1)]
    outputs, every = ("z1_ddot", "z2_ddot", "phi_x2_dot"), np.ones(len(t), bool)
    run = Run(t, np.column_stack(columns), np.zeros((len(t), 3)), every, ~every, ~every)
    record = Record((run,), tuple(inputs), outputs, np.ones(3))
    problem = Problem(Always(native("vehicle7dof")), record, {}, {})
    plant, k = problem.plant, int(share * len(t))
    states = problem.simulate({}, plant.states)[0][:, 3:]
    local, found = influences(problem, {}, states, np.arange(len(t)), [lever])
    linear = responses(local, found, [{lever: 1.0 * (np.arange(len(t)) >= k)}], len(t))[0, k:]
    h, start, rest = 1e-4, dict(zip(plant.states, states[k], strict=True)), run.part(k, len(t))
    value = plant.fmu.description.variables[lever].start
    moved = plant.simulate(rest, {**start, lever: value * (1 - h)})
    exact = (plant.simulate(rest, start) - moved) / (h * value)
    assert np.linalg.norm(linear - exact) < 0.03 * np.linalg.norm(exact)


@pytest.mark.parametrize(("largest", "followed"), [(1e9, True), (0.5, True), (1e-4, False)])
def test_a_change_that_an_fmu_cannot_follow_is_told_by_a_small_share_of_it(foreign, largest, followed):
    """x' = -k x + u, which refuses inputs above a limit, pushed by 1; any share tells as it is linear."""
    step = f"if abs(self.u) > {largest}:\n    return False\n{GOOD}"
    t = np.arange(0.0, 4.0, 0.02)
    every = np.ones(len(t), bool)
    run = Run(t, np.zeros((len(t), 1)), np.zeros((len(t), 1)), every, ~every, ~every)
    record = Record((run,), ("u",), ("x",), np.ones(1))
    problem, weighting = Problem(Always(foreign(step)), record, {"x": 0.0}, {}), Weighting.white(np.ones(1))
    screening = Screening(problem, fit(problem, [Unknown("k", 2.0, 1.0, 3.0, 0.1)], weighting), weighting)
    change = screening._simulated({"u": np.ones(len(screening.samples))})
    expected = -(1 - 0.96 ** np.arange(len(t))) / 2 if followed else np.zeros(len(t))
    assert_allclose(change, expected, atol=1e-9)


def test_another_form_of_a_law_is_no_effect_that_is_looked_for():
    for name, model in MODELS.items():
        form = {*model.form, *model.form_alike}
        assert form <= model().variables.keys()
        assert not form & {location for _, location in ModelBuilder(name, Path()).offers}


# ---- the smoother


def test_the_smoothed_force_is_that_of_least_squares():
    rng = np.random.default_rng(5)
    n, n_w, steps, dt = 3, 2, 80, 0.02
    A = np.eye(n) + 0.05 * rng.standard_normal((n, n)) - 0.1 * np.eye(n)
    B, C, D = rng.standard_normal((n, n_w)), rng.standard_normal((2, n)), 0.1 * rng.standard_normal((2, n_w))
    local = Linearised(np.array([0]), A[None], B[None], C[None], D[None])
    residual, noise = np.cumsum(rng.standard_normal((steps, 2)), axis=0), np.array([0.3, 0.5])
    found = smooth(local, residual, noise, np.full(steps - 1, dt))
    for i in range(n_w):
        answers = np.zeros((steps, 2, steps))  # of the outputs to the force of each sample
        for j in range(steps):
            x = np.zeros(n)
            for k in range(steps):
                answers[k, :, j] = C @ x + D[:, i] * (k == j)
                x = A @ x + B[:, i] * (k == j)
        g = (answers / noise[None, :, None]).reshape(-1, steps)
        r = (residual / noise).ravel()
        changes = np.diff(np.eye(steps), axis=0)
        first = np.eye(steps)[:1]
        solved = [
            least_squares_force(g, r, changes, first, w, dt)
            for w in np.array(WALKS) * _first_guess(local, residual, np.full(steps - 1, dt))[i]
        ]
        force, std = min(solved, key=lambda s: np.abs(s[0] - found.force[i]).max())
        assert_allclose(found.force[i], force, rtol=1e-6, atol=1e-8 * np.abs(force).max())
        assert_allclose(found.std[i], std, rtol=1e-6)


def least_squares_force(g, r, changes, first, walk, dt):
    """A force whose changes have a variance walk² dt, that of the first sample walk²."""
    normal = g.T @ g + changes.T @ changes / (walk**2 * dt) + first.T @ first / walk**2
    covariance = np.linalg.inv(normal)
    return covariance @ (g.T @ r), np.sqrt(np.diag(covariance))


# ---- samples in groups


@given(st.sampled_from([1, 3, 5]), st.integers(1, 3), st.integers(0, 1000))
def test_groups_keep_noise_white_and_slow_squares(n, n_y, seed):
    rng = np.random.default_rng(seed)
    samples = 6000 * n
    slow = np.sin(np.linspace(0, 6, samples))[:, None] * rng.standard_normal(n_y)
    squares = np.sum(grouped(slow.ravel(), n_y, n) ** 2)
    assert_allclose(squares, np.sum(slow**2), rtol=1e-5)
    noise = grouped(rng.standard_normal((samples, n_y)).ravel(), n_y, n)
    assert np.mean(noise**2) == pytest.approx(1.0, abs=6 * np.sqrt(2 / len(noise)))
    assert_allclose(grouped(np.repeat(slow.ravel()[:, None], 2, axis=1), n_y, n)[:, 1],
                    grouped(slow.ravel(), n_y, n))  # fmt: skip


@pytest.mark.parametrize(("frequency", "group"), [(2.0, 5), (14.0, 3), (60.0, 1)])
def test_what_moves_fast_is_not_grouped(frequency, group):
    t = np.arange(0.0, 40.0, 1e-3)
    y, fit = np.sin(2 * np.pi * frequency * t)[:, None], t < 35.0
    record = Record((Run(t, y[:, :0], y, fit, ~fit, ~fit),), (), ("y",), np.ones(1))
    problem = Problem(lambda _: Path(), record, {}, {})
    assert group_size(problem, y) == group
    late = Record((Run(t, y[:, :0], y, t > 5.0, t <= 5.0, t <= 5.0),), (), ("y",), np.ones(1))
    assert group_size(replace(problem, record=late), y) == 1


# ---- moments


@dataclass
class Steps:
    """Answers a candidate with a step at its moment."""

    t: np.ndarray
    fit: Fit

    @property
    def length(self):
        return float(self.t[-1])

    def changes(self, candidates):
        return [(self.t >= c.onset).astype(float)[:, None] for c in candidates]


@settings(max_examples=25)
@given(st.floats(0.05, 0.95), st.floats(-5.0, 5.0).filter(lambda a: abs(a) > 0.1))
def test_the_moment_of_a_step_is_found(share, size):
    t = np.linspace(0.0, 20.0, 2001)
    true = 20.0 * share
    base = nothing_calibrated(-size * (t >= true))
    steps, c = Steps(t, base), candidate("step_force", "wheel", [("t0", 1.0)])
    tried = [c.with_onset(m) for m in np.linspace(0, 20, 12)[1:-1]]
    promises = screen(base, [((x,), g) for x, g in zip(tried, steps.changes(tried), strict=True)])
    found = at_their_onsets(steps, steps.fit, promises, 1)
    assert abs(found[0].candidates[0].onset - true) < 20.0 * 0.1 / 36 + 0.01
    assert found[0].gain >= promises[0].gain
    assert len(found) == len(promises)


def test_what_is_always_there_has_no_moment():
    c = candidate("coulomb_friction", "wheel", [("v_s", 0.1)])
    assert c.onset is None
    promise = Promise((c,), 1.0, {})
    steps = Steps(np.arange(3.0), nothing_calibrated(np.ones(3)))
    assert at_their_onsets(steps, steps.fit, [promise], 3) == [promise]


# ---- lookalikes


@dataclass
class Columns:
    """Answers a candidate with its column."""

    problem = SimpleNamespace(policy=DEFAULT)

    known: dict[str, np.ndarray]

    def changes(self, candidates):
        return [self.known[c.label][:, None] for c in candidates]


@given(st.integers(0, 10_000), st.floats(-30.0, 30.0).filter(lambda a: abs(a) > 0.1), st.floats(-5.0, 5.0))
def test_a_law_that_looks_like_the_best_one_starts_where_that_one_is(seed, ratio, taken_over):
    rng = np.random.default_rng(seed)
    calibrated, g, other, noise = rng.standard_normal((4, 400))
    best = candidate("parameter_offset", "b1")
    alike, near, far = (
        candidate(k, "secondary") for k in ("damping_change", "coulomb_friction", "step_force")
    )
    columns = {
        best.label: g,
        alike.label: ratio * g + taken_over * calibrated,
        near.label: g + 0.2 * noise,
        far.label: other,
    }
    screening, change = Columns(columns), [(c, columns[c.label][:, None]) for c in (best, far, near, alike)]
    calibration = Calibration(calibrated[:, None] / np.linalg.norm(calibrated))
    unknowns = (Unknown("mu0", 0.3, *FREE, 1.0), *best.unknowns)
    fit = replace(nothing_calibrated(np.ones(400)), unknowns=unknowns, values=np.array([0.4, 7.0]))
    stuck = Hypothesis((alike,), replace(fit, unknowns=alike.unknowns, residual=np.full(400, 2.0)), ())
    found = [Hypothesis((best,), fit, ()), stuck]
    [promise] = lookalikes(screening, calibration, found, change)
    assert promise.candidates == (alike,)
    assert promise.start["mu0"] == 0.4
    assert promise.start[alike.amplitudes[0].name] == pytest.approx(7.0 / ratio)
    two = replace(fit, unknowns=(*unknowns, *far.unknowns), values=np.array([0.4, 7.0, 2.0]))
    [pair] = lookalikes(screening, calibration, [Hypothesis((far, best), two, ())], change)
    assert pair.candidates == (far, alike)
    done = replace(stuck, fit=replace(fit, unknowns=alike.unknowns))  # as good as the best one
    assert lookalikes(screening, calibration, [found[0], done], change) == []
    elsewhere = replace(done, fit=replace(done.fit, residual=np.full(400, 1.1)))  # in another minimum
    assert lookalikes(screening, calibration, [found[0], elsewhere], change) == [promise]


def test_in_a_pair_each_law_is_replaced_by_those_over_its_motion_at_its_place():
    rng = np.random.default_rng(1)
    kinds = (("coulomb_friction", "a"), ("stribeck_friction", "a"), ("cubic_stiffness", "a"))
    friction, richer, stiff = (candidate(k, at) for k, at in kinds)
    elsewhere, step = candidate("stribeck_friction", "b"), candidate("parameter_step", "mu0")
    every = [friction, richer, stiff, elsewhere, step]
    columns = dict(zip((c.label for c in every), rng.standard_normal((5, 400)), strict=True))
    columns[richer.label] = 2 * columns[friction.label]
    change = [(c, columns[c.label][:, None]) for c in every]
    own = (*step.unknowns, *friction.unknowns)
    fit = replace(nothing_calibrated(np.ones(400)), unknowns=own, values=np.array([3.0, 7.0]))
    h, nothing = Hypothesis((step, friction), fit, ()), Calibration(np.zeros((400, 0)))
    [promise] = over_the_same(Columns(columns), nothing, h, change)
    assert promise.candidates == (step, richer)
    assert promise.start[richer.amplitudes[0].name] == pytest.approx(3.5)
    assert promise.start[step.amplitudes[0].name] == 3.0
    alone = replace(fit, unknowns=step.unknowns, values=np.array([3.0]))
    assert over_the_same(Columns(columns), nothing, Hypothesis((step,), alone, ()), change) == []


def test_in_a_pair_a_change_of_a_parameter_is_replaced_by_its_other_courses_in_time():
    rng = np.random.default_rng(2)
    kinds = (
        ("parameter_step", "k1"),
        ("parameter_drift", "k1"),
        ("parameter_drift", "k2"),
        ("constant_force", "k1"),
    )
    every = [candidate(k, at) for k, at in (*kinds, ("coulomb_friction", "a"))]
    columns = dict(zip((c.label for c in every), rng.standard_normal((5, 400)), strict=True))
    change = [(c, columns[c.label][:, None]) for c in every]
    step, drift, friction = every[0], every[1], every[4]
    own = (*friction.unknowns, *step.unknowns)
    fit = replace(nothing_calibrated(np.ones(400)), unknowns=own, values=np.array([7.0, 3.0]))
    h, nothing = Hypothesis((friction, step), fit, ()), Calibration(np.zeros((400, 0)))
    [promise] = over_the_same(Columns(columns), nothing, h, change)
    assert promise.candidates == (friction, drift)
    assert promise.start[friction.amplitudes[0].name] == 7.0


def test_at_another_place_a_law_is_looked_at_in_the_shape_that_it_has():
    here, there = (
        candidate("harmonic_excitation", at, [("f", f)]) for at, f in (("secondary", 1.0), ("body", 5.0))
    )

    class Asked:
        problem = SimpleNamespace(policy=DEFAULT)

        def changes(self, candidates):
            return [np.full((9, 1), c.shape[0].start) for c in candidates]

    fit = replace(nothing_calibrated(np.ones(9)), unknowns=here.unknowns, values=np.array([3.0, 1.7]))
    nothing = Calibration(np.zeros((9, 0)))
    change = [(here, np.ones((9, 1))), (there, np.ones((9, 1)))]
    [promise] = lookalikes(Asked(), nothing, [Hypothesis((here,), fit, ())], change)
    assert promise.label == "harmonic_excitation@body"
    assert promise.start["harmonic_excitation_body_f"] == 1.7
    assert promise.start["harmonic_excitation_body_F_0"] == pytest.approx(3.0)


# ---- laws that fall together


@pytest.mark.parametrize(
    ("kind", "simpler", "expected"),
    [
        ("free_play", "stiffness_change", True),
        ("free_play", "constant_force", True),
        ("stribeck_friction", "coulomb_friction", True),
        ("flexible_mode", "viscous_damping", True),
        ("coulomb_friction", "stribeck_friction", False),
        ("cubic_stiffness", "viscous_damping", False),
        ("sensor_gain", "sensor_bias", False),
    ],
)
def test_a_law_becomes_a_simpler_one_at_its_own_place_alone(kind, simpler, expected):
    fit = nothing_calibrated(np.ones(2))
    h = Hypothesis((candidate(kind, "secondary"),), fit, ())
    assert becomes(h, Hypothesis((candidate(simpler, "secondary"),), fit, ())) is expected
    assert not becomes(h, Hypothesis((candidate(simpler, "primary"),), fit, ()))
    assert not becomes(h, h)


# ---- onsets


@dataclass
class Line(OneByOne):
    """y = a t and, from a time on, another slope beside; asks for a."""

    t: np.ndarray
    y: np.ndarray
    builder: None = None
    record, free_states, policy = record_with(noise_declared=np.array([True])), (), DEFAULT

    def identify_residual(self, theta):
        return (self.y - theta["a"] * self.t)[:, None]

    def beginning(self, share):
        n = int(share * len(self.t))
        return Line(self.t[:n], self.y[:n])


@settings(max_examples=25, deadline=None)
@given(st.floats(0.15, 0.9), st.integers(0, 1000))
def test_what_sets_in_is_noticed_and_what_was_before_is_found(share, seed):
    t = np.linspace(0.0, 10.0, 5000)
    y = 2.0 * t + 0.1 * np.random.default_rng(seed).standard_normal(len(t))
    base = Hypothesis((), replace(nothing_calibrated(t), unknowns=(Unknown("a", 1.0, -9.0, 9.0, 1.0),)), ())
    assert onset(baseline(Line(t, y), base, 0.1), DEFAULT.search.sets_in_times) is None
    found = onset(baseline(Line(t, y + 3.0 * (t > 10.0 * share)), base, 0.1), DEFAULT.search.sets_in_times)
    assert found is not None
    assert abs(found[0] - share) <= 1.0 / ONSET_BLOCKS
    assert found[1].theta["a"] == pytest.approx(2.0, abs=0.1)


def changed_at(t0: float | None, gain: float = 0.0) -> Hypothesis:
    """A change of damping from a time on, or from the start, that leaves so much less than 100 squares."""
    size = Unknown("damping_change_secondary_change", 0.0, -1.0, 9.0, 0.1)
    onset = () if t0 is None else (Unknown("damping_change_secondary_t0", t0, 0.0, 60.0, 0.6),)
    residual = np.full(100, np.sqrt(1 - gain / 100))
    n = 1 + len(onset)
    fit = fit_with((size, *onset), np.full(n, 0.5), np.eye(n), residual, np.zeros((100, n)))
    return Hypothesis((Candidate("damping_change", "secondary", (size,), onset),), fit, ())


@pytest.mark.parametrize(("gain", "kept"), [(0.0, None), (1.9, None), (2.1, 0.4), (50.0, 0.4)])
def test_an_onset_has_to_be_worth_an_unknown(gain, kept):
    for found in ([changed_at(0.4, gain), changed_at(None)], [changed_at(None), changed_at(0.4, gain)]):
        [only] = best_by_label(found)
        assert only.candidates[0].onset == kept


def test_an_effect_that_sets_in_is_also_tried_from_the_start():
    late, always = changed_at(0.4), changed_at(None)
    [promise] = from_the_start([late, always], [*late.candidates, *always.candidates])
    assert promise.candidates == always.candidates
    assert promise.start["damping_change_secondary_change"] == 0.5
    assert from_the_start([late], late.candidates) == []


def step_of(location, *amplitudes, cost):
    """A hypothesis of a step at 20 s whose fit left so much; each amplitude is 0.3."""
    prefix = f"parameter_step_{location}_"
    sizes = tuple(Unknown(prefix + name, 0.0, -9.0, 9.0, 1.0) for name in amplitudes)
    onset = (Unknown(prefix + "t0", 20.0, 0.0, 40.0, 1.0),)
    k = Unknown("k", 1.0, 0.0, 2.0, 1.0)
    values = np.array([*(0.3 for _ in sizes), 20.0, 1.1])
    n = len(values)
    left = np.full(100, np.sqrt(cost / 100))
    fit = fit_with((*sizes, *onset, k), values, np.eye(n), left, np.zeros((100, n)))
    return Hypothesis((Candidate("parameter_step", location, sizes, onset),), fit, ())


def test_a_group_starts_where_the_best_of_its_parameters_has_arrived():
    one = step_of("mu0", "delta", cost=50.0)
    behind = step_of("friction", "delta_mu0", "delta_A", cost=80.0)
    another = step_of("axle", "delta_r0", "delta_s", cost=80.0)
    every = [h.candidates[0] for h in (one, behind, another)]
    [promise] = in_groups([one, behind], every)
    assert promise.candidates == behind.candidates
    prefix = "parameter_step_friction_"
    assert promise.start[prefix + "delta_mu0"] == 0.3
    assert promise.start[prefix + "delta_A"] == 0.0
    assert promise.start[prefix + "t0"] == 20.0
    assert promise.start["k"] == 1.1
    assert in_groups([one, step_of("friction", "delta_mu0", "delta_A", cost=50.0)], every) == []


@pytest.mark.parametrize(("mean_square", "grows"), [(1.0, False), (1.5, True)])
def test_an_answer_that_leaves_more_than_noise_does_not_end_the_search(monkeypatch, mean_square, grows):
    """It may have won only because the right fit has not arrived."""
    left = np.sqrt(mean_square) * np.ones(4000)
    answer = Hypothesis((), Fit((), np.zeros(0), np.zeros((0, 0)), left, ()), ())
    right = replace(answer, fit=replace(answer.fit, residual=0 * left))
    known = baseline(SimpleNamespace(policy=DEFAULT))
    fitter = SimpleNamespace(baseline=known, to_the_end=list)
    stages = SimpleNamespace(done=lambda _, work: work())
    screened = SimpleNamespace(baseline=known, stages=stages, explained=lambda _: True)
    monkeypatch.setattr(search, "dated", lambda _, found: found)
    asked = search.Search(screened, fitter, lambda *_: None)
    monkeypatch.setattr(search.Search, "_from_the_beginning", lambda _, found, __: ([right, *found], []))
    singles, pairs = asked._finished([answer], [])
    assert singles[0] is (right if grows else answer)
    assert pairs == []


@pytest.mark.parametrize(("form", "left_out"), [(0.0, set()), (0.02, {"parameter_step@friction"})])
def test_a_group_of_parameters_is_one_of_two_effects_only_if_the_form_is_right(form, left_out):
    step = candidate("parameter_step", "friction", amplitude="delta_mu0")
    group = replace(
        step, amplitudes=(*step.amplitudes, replace(step.amplitudes[0], name=f"{step.prefix}delta_A"))
    )
    every = [group, candidate("parameter_step", "mu0"), candidate("coulomb_friction", "wheel")]
    screened = SimpleNamespace(
        baseline=baseline(SimpleNamespace(policy=DEFAULT, form_error=form)),
        change=[(c, np.ones((4, 1))) for c in every],
        twins=SimpleNamespace(left_out=set()),
    )
    asked = search.Search(screened, SimpleNamespace(), lambda *_: None)
    assert {c.label for c in every} - {c.label for c, _ in asked._in_pairs} == left_out
