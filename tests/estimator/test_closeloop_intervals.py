"""Errors that allow for the duration of a change, for the shape of the sum of squares, and for the steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.likelihood_profile import WIDTH, _reach
from estimator.closeloop.fitting.resolution import (
    error_of_steps,
    in_fine_steps,
    in_halved_steps,
    in_long_steps,
    long_steps_hold,
    resolved,
)
from estimator.closeloop.fitting.slopes import FINE_STEP, STEP
from estimator.closeloop.fitting.slopes_within_error import within_error
from estimator.closeloop.fitting.transition import unresolved, with_duration
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.search.profiles import finer
from estimator.closeloop.search.screened import Screened
from estimator.noise import Noise
from estimator.plant import JOINED, USUAL, Steps
from estimator.record import Array, Run
from estimator.weighting import Weighting
from fmus.effects.timing import RISE
from tests.helpers.baselines import baseline
from tests.helpers.problems import OneByOne, record_with

SIZE = np.array([0.05])
AT = "parameter_step_m_"
DELTA = Unknown(f"{AT}delta", 0.5, -10.0, 10.0, 1.0)
STEPPED = Candidate("parameter_step", "m", (DELTA,), (Unknown(f"{AT}t0", 4.8, 0.0, 10.0, 0.1),))


@given(
    error=st.floats(1e-3, 1.0), points=st.lists(st.floats(0.01, 10.0), min_size=3, max_size=20, unique=True)
)
def test_the_reach_of_a_parabola_is_its_95_percent_width(error, points):
    away = np.array(points)
    found = _reach(away, (away / error) ** 2)
    assert found == pytest.approx(min(WIDTH * error, away.max()))


def test_the_reach_includes_the_farthest_of_several_minima():
    away = np.array([4.0, 1.0, 2.0, 3.0])
    assert _reach(away, np.array([100.0, 9.0, 1.0, 25.0])) > 2.0


@dataclass(frozen=True)
class Changing(OneByOne):
    """An output that follows a change with a lag of 0.2 s; the true change is linear over `lasts` s."""

    lasts: float
    sample: float
    seed: int
    declared: Mapping[str, float] = field(default_factory=dict)
    effects: tuple[tuple[str, str], ...] = ()
    free_states = ()

    @property
    def record(self):
        t = np.arange(0.0, 10.0, self.sample)
        every = np.ones(len(t), bool)
        y = followed(np.clip((t - 5.0) / self.lasts + 0.5, 0, 1), self.sample)
        y += SIZE * np.random.default_rng(self.seed).standard_normal((len(t), 1))
        return record_with(
            runs=(Run(t, y, y, every, ~every, ~every),), noise_declared=np.array([True]), outputs=("y",)
        )

    def with_effects(self, effects):
        return replace(self, effects=tuple(effects))

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        s = np.clip((run.t - theta[f"{AT}t0"]) / theta.get(f"{AT}T_r", RISE) + 0.5, 0, 1)
        return run.y - theta[f"{AT}delta"] * followed(s**2 * (3 - 2 * s), self.sample)


def followed(u: Array, sample: float) -> Array:
    """The lag's response (N, 1) to u (N,)."""
    y, keep = np.zeros((len(u), 1)), np.exp(-sample / 0.2)
    for k in range(1, len(u)):
        y[k] = keep * y[k - 1] + (1 - keep) * (u[k] + u[k - 1]) / 2
    return y


class Refitter(Fitter):
    """Fits without an FMU."""

    def finished(
        self, promises: Sequence[Promise], unknowns: Sequence[Unknown] | None = None,
        guess: Mapping[str, Array] | None = None, step: float = STEP,
    ) -> list[Hypothesis]:  # fmt: skip
        """See Fitter."""
        [p] = promises
        own = p.candidates[0].unknowns
        return [
            Hypothesis(
                p.candidates, fit(self.baseline.problem, own, Weighting.white(SIZE), p.start, step=step), ()
            )
        ]


def stepped(problem: Changing) -> tuple[Refitter, Hypothesis]:
    """A fitter, and the step fitted with the duration that the library assumes."""
    fitter = Refitter(baseline(problem, noise=SIZE))
    [found] = fitter.finished([Promise((STEPPED,), 0.0, {})])
    return fitter, found


@pytest.mark.parametrize("seed", range(4))
def test_a_change_that_lasts_longer_than_assumed_gets_its_duration(seed):
    fitter, found = stepped(Changing(0.6, 0.01, seed))
    lasting = with_duration(fitter, found)
    assert f"{AT}T_r" in lasting.theta
    assert lasting.theta[f"{AT}T_r"] == pytest.approx(0.7, abs=0.25)  # a cubic as wide as the straight line
    for name, true in (("delta", 1.0), ("t0", 5.0)):
        error = np.hypot(lasting.fit.std[AT + name], unresolved(lasting).get(AT + name, 0.0))
        assert abs(lasting.theta[AT + name] - true) < 3 * error


@pytest.mark.parametrize("seed", range(4))
def test_a_duration_that_hardly_shows_is_kept_as_assumed_unless_it_is_worth_an_unknown(seed):
    fitter, found = stepped(Changing(RISE, 0.1, seed))
    kept = with_duration(fitter, found)
    if kept.own == found.own:
        assert unresolved(kept) == {f"{AT}t0": pytest.approx(RISE / np.sqrt(12))}
    else:
        assert cost(found) - cost(kept) > 2
        assert unresolved(kept)[f"{AT}t0"] == pytest.approx(kept.theta[f"{AT}T_r"] / np.sqrt(12))


def test_what_acts_from_the_start_has_no_duration():
    always = Candidate("parameter_offset", "m", (DELTA,))
    h = Hypothesis((always,), stepped(Changing(0.02, 0.1, 0))[1].fit, ())
    fitter = Refitter(baseline(Changing(0.02, 0.1, 0), noise=SIZE))
    assert with_duration(fitter, h) is h
    assert unresolved(h) == {}


@dataclass(frozen=True)
class Stiff(OneByOne):
    """A line over time, with an integration error of second order that looks like a slope."""

    error: float  # slope of the error at the first step
    steps: Steps = USUAL
    policy = DEFAULT
    declared: Mapping[str, float] = field(default_factory=dict)
    effects: tuple[tuple[str, str], ...] = ()
    free_states = ()

    @property
    def record(self):
        t = np.linspace(0.0, 1.0, 400)
        every = np.ones(len(t), bool)
        return record_with(
            runs=(Run(t, t[:, None], t[:, None], every, ~every, ~every),),
            noise_declared=np.array([True]), outputs=("y",), sample=1 / 399,
        )  # fmt: skip

    def with_effects(self, effects):
        return replace(self, effects=tuple(effects))

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        return run.y - (theta["slope"] + self.error / self.steps.parts**2) * run.t[:, None]


@settings(deadline=None, max_examples=30)
@given(size=st.floats(0.0, 20.0))
def test_steps_are_halved_until_no_unknown_moves_by_half_its_error(size):
    weighting, slope = Weighting.white(SIZE), Unknown("slope", 1.0, -10.0, 10.0, 1.0)
    exact = fit(Stiff(0.0), [slope], weighting)
    problem = Stiff(size * exact.std["slope"])
    h = Hypothesis((), fit(problem, [slope], weighting), ())
    limits = problem.policy.search
    finer = resolved(problem, [h], weighting).steps.parts
    moves = [0.75 * size / n**2 for n in (1, 2)]  # by halving the steps, in standard errors
    if min(abs(m - 0.5) for m in moves) > 0.01:
        assert finer == (1 if moves[0] < 0.5 else 2 if moves[1] < 0.5 else limits.parts_of_a_step)


@dataclass(frozen=True)
class Valley(Stiff):
    """The same with unknowns that are hardly told from the slope, one of them by slow noise alone."""

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        slow, fast = (run.t + 1e-3 * np.sin(w * run.t) for w in (9.0, 300.0))
        noise = 0.05 * np.sin(np.outer(run.t, [13.0, 16.0, 19.0]) ** 1.1).sum(axis=1)
        slope = theta["slope"] + self.error / self.steps.parts**2
        line = slope * run.t + theta["slow"] * slow + theta["fast"] * fast
        return (run.y.ravel() + noise - line)[:, None]


def test_steps_that_hardly_move_the_residual_move_no_unknown():
    """However alike the unknowns are, and however unlike the inflation of their errors."""
    weighting = Weighting.white(SIZE)
    unknowns = [Unknown(name, 0.3, -1e3, 1e3, 1.0) for name in ("slope", "slow", "fast")]
    length = float(np.linalg.norm(Stiff(0.0).record.runs[0].t)) / SIZE[0]
    problem = Valley(0.4 / length)  # the residual moves by 0.3 units of the noise
    h = Hypothesis((), fit(problem, unknowns, weighting), ())
    assert h.fit.inflation.max() > 2 * h.fit.inflation.min()
    assert resolved(problem, [h], weighting).steps == problem.steps


@dataclass(frozen=True)
class Rarely(Stiff):
    """The same with an error of first order, also from how rarely the FMU is coupled."""

    coupling = 0.03

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        error = self.error * (100 * self.steps.coupled or 1 / self.steps.parts)
        return run.y - (theta["slope"] + error) * run.t[:, None]


@settings(deadline=None, max_examples=30)
@given(size=st.floats(-20.0, 20.0), parts=st.integers(1, 4))
def test_the_error_that_the_steps_leave_is_part_of_the_error(size, parts):
    """It is exact for an error of first order, and the truth is one such error away."""
    weighting, slope = Weighting.white(SIZE), Unknown("slope", 1.0, -10.0, 10.0, 1.0)
    [alone] = fit(Rarely(0.0), [slope], weighting).std.values()
    problem = Rarely(size * alone, steps=Steps(parts))
    h = Hypothesis((), fit(problem, [slope], weighting), ())
    error = error_of_steps(problem, in_halved_steps(problem), h, weighting)
    assert error == pytest.approx([h.theta["slope"] - 1.0], abs=1e-3 * alone)


def test_an_fmu_that_was_coupled_rarely_is_first_coupled_more_often():
    weighting, slope = Weighting.white(SIZE), Unknown("slope", 1.0, -10.0, 10.0, 1.0)
    problem = Rarely(0.02 * fit(Rarely(0.0), [slope], weighting).std["slope"], steps=Steps(coupled=0.1))
    for times, steps in ((4, Steps(coupled=0.1)), (6, Steps(coupled=0.05)), (10, USUAL), (60, Steps(2))):
        more = replace(problem, error=times * problem.error)
        h = Hypothesis((), fit(more, [slope], weighting), ())
        assert resolved(more, [h], weighting).steps == steps
        if steps.parts == 1:  # else it is fitted again
            assert in_fine_steps(Fitter(baseline(more, h, SIZE)), [h]).steps == steps


@dataclass(frozen=True)
class Held(Stiff):
    """A line with a wave that an interpolated input adds or a held one: which of them is true is given."""

    seed: int = 0
    true_finer: int = 1

    @property
    def record(self):
        record = super().record
        [run] = record.runs
        noise = 0.05 * np.random.default_rng(self.seed).standard_normal(run.y.shape)
        y = run.y + self.wave(run.t, self.true_finer) + noise
        return record_with(runs=(replace(run, y=y),), noise_declared=np.array([True]), outputs=("y",))

    def wave(self, t: Array, finer: int) -> Array:
        return (0.02 if finer > 1 else -0.02) * np.cos(40 * t)[:, None]

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        finer = self.steps.parts
        error = self.error / finer**2 - self.error / self.true_finer**2
        return run.y - self.wave(run.t, finer) - (theta["slope"] + error) * run.t[:, None]


@pytest.mark.parametrize("true", [1, 4])
@pytest.mark.parametrize("seed", range(5))
def test_finer_steps_are_not_taken_if_the_record_was_made_with_the_coarse_ones(true, seed):
    """Between samples, finer steps change the inputs, which can be further from the truth."""
    slope = Unknown("slope", 1.0, -10.0, 10.0, 1.0)
    problem = Held(0.1, seed=seed, true_finer=true)
    c = Candidate("viscous_damping", "here", (slope,))
    fitter = Refitter(baseline(problem, noise=SIZE))
    [h] = fitter.finished([Promise((c,), 0.0, {})])
    assert resolved(problem, [h], Weighting.white(SIZE)).steps.parts > 1  # by the movement of the slope alone
    assert in_fine_steps(fitter, [h]).steps.parts == (1 if true == 1 else 4)


@dataclass(frozen=True)
class Joining(Stiff):
    """A line over time whose integration error is of fourth order in steps over several samples.

    usual: the error in steps of one sample.
    """

    usual: float = 0.0
    fmu_joins: bool = True
    searched: Steps = USUAL
    coupling: float = 0.0

    @property
    def plant(self):
        return SimpleNamespace(joins=lambda runs: self.fmu_joins)

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        error = self.error / self.steps.parts**4 if self.steps.joined else self.usual
        return run.y - (theta["slope"] + error) * run.t[:, None]


def noise_of(unit: Array) -> Noise:
    """Noise of the usual size; unit: (n_y,) of residuals, another one where it is not declared."""
    return Noise(SIZE, Weighting.white(unit), unit == SIZE)


def hold(problem: Joining) -> bool:
    """Whether steps over several samples hold on the record of a problem, once it is fitted in them."""
    noise, joined = noise_of(SIZE), in_long_steps(problem)
    assert (joined.steps, joined.searched) == (JOINED, JOINED)
    found = fit(joined, [Unknown("slope", 1.0, -10.0, 10.0, 1.0)], noise.weighting)
    return long_steps_hold(joined, Hypothesis((), found, ()), noise)


def test_an_fmu_that_cannot_join_samples_keeps_its_steps():
    problem = Joining(0.0, fmu_joins=False)
    assert in_long_steps(problem) is problem


def test_a_foreign_fmu_is_coupled_a_few_times_in_a_sample_if_it_would_be_coupled_more_often():
    often = 1 / 399 / DEFAULT.candidates.readings
    few = Steps(coupled=pytest.approx(often))
    long = in_long_steps(Joining(0.0, fmu_joins=False, coupling=often / 2))
    assert (long.steps, long.searched) == (few, few)
    often = Joining(0.0, fmu_joins=False, coupling=2 * often)
    assert in_long_steps(often) is often


@settings(deadline=None, max_examples=30)
@given(size=st.floats(0.0, 2.0))
def test_steps_go_over_several_samples_if_their_error_moves_no_unknown_by_half_its_error(size):
    exact = fit(Stiff(0.0), [Unknown("slope", 1.0, -10.0, 10.0, 1.0)], Weighting.white(SIZE))
    seen = 15 / 16 * size  # by halving them: the slope alone makes up the residual here
    if abs(seen - 0.5) > 0.01:
        assert hold(Joining(size * exact.std["slope"])) == (seen < 0.5)


@settings(deadline=None, max_examples=30)
@given(size=st.floats(0.6, 3.0), usual=st.floats(-6.0, 6.0))
def test_steps_of_one_sample_are_taken_only_if_they_are_nearer_to_shorter_ones(size, usual):
    exact = fit(Stiff(0.0), [Unknown("slope", 1.0, -10.0, 10.0, 1.0)], Weighting.white(SIZE))
    problem = Joining(size * exact.std["slope"], usual=usual * exact.std["slope"])
    halved = size / 16
    if abs(abs(usual - halved) - abs(size - halved)) > 0.01:
        assert hold(problem) == (abs(size - halved) < abs(usual - halved))


@dataclass(frozen=True)
class Interpolating(Joining):
    """What acts within samples makes a wave of a size in noises altogether, where steps know of it.

    recorded: whether the record was made so, or with inputs that were held. lacking: times the same wave that
    the model lacks, unless its effect is built in.
    """

    size: float = 0.0
    recorded: bool = True
    lacking: float = 0.0

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        wave = np.sin(7.0 * run.t)
        wave *= self.size * SIZE / np.linalg.norm(wave)
        waves = self.steps.joined - self.recorded + (0.0 if self.effects else self.lacking)
        return run.y - (theta["slope"] * run.t + waves * wave)[:, None]


@pytest.mark.parametrize("size", [0.0, 2.0, 30.0])
def test_steps_go_over_several_samples_unless_the_record_was_clearly_made_with_held_inputs(size):
    assert hold(Interpolating(0.0, size=size, recorded=True))
    assert hold(Interpolating(0.0, size=size, recorded=False)) == (size < 10.0)


@pytest.mark.parametrize("recorded", [True, False])
@pytest.mark.parametrize("unit", [1.0, 16.0])  # of residuals, in noises: 1, or their own size
def test_what_a_model_lacks_does_not_decide_about_the_steps_but_its_answer_does(recorded, unit):
    """What is lacking looks as if inputs were held, and is much larger than what these make."""
    problem = in_long_steps(Interpolating(0.0, size=30.0, recorded=recorded, lacking=10.0))
    noise = noise_of(unit * SIZE)
    fitter, weighting = Refitter(replace(baseline(problem), noise=noise)), noise.weighting
    c = Candidate("viscous_damping", "here", (Unknown("slope", 1.0, -10.0, 10.0, 1.0),))
    without, found = (
        Hypothesis(some, fit(built(problem, some), c.unknowns, weighting), ()) for some in ((), (c,))
    )
    assert long_steps_hold(problem, without, noise)
    assert in_fine_steps(fitter, [without]).steps == JOINED
    assert in_fine_steps(fitter, [found]).steps == (JOINED if recorded else USUAL)


# ---- slopes of unknowns that make up for each other


class Compensating(OneByOne):
    """A force that hardly saturates, a tanh(b q): only the product a b is determined well."""

    free_states = ()
    true: ClassVar = {"a": 1.0, "b": 0.6}

    def __init__(self, seed: int) -> None:
        t = np.linspace(0.0, 10.0, 4000)
        self.q = np.sin(2 * np.pi * t)
        y = np.tanh(0.6 * self.q) + SIZE * np.random.default_rng(seed).standard_normal(len(t))
        every = np.ones(len(t), bool)
        run = Run(t, t[:, None], y[:, None], every, ~every, ~every)
        self.record = record_with(runs=(run,), noise_declared=np.array([True]), outputs=("y",))

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        return run.y - theta["a"] * np.tanh(theta["b"] * self.q)[:, None]

    def jacobian(self, a: float, b: float) -> Array:
        """Derivatives of the weighted residual, (m, 2), on paper."""
        return -np.column_stack([np.tanh(b * self.q), a * self.q / np.cosh(b * self.q) ** 2]) / SIZE


def compensated(seed: int, wrong: float) -> tuple[Compensating, Hypothesis]:
    """A fit whose slope of a is wrong by a share of the residual, as secants leave it."""
    asked = Compensating(seed)
    unknowns = Unknown("a", 0.9, 0.0, np.inf, 1.0), Unknown("b", 0.7, 0.0, np.inf, 1.0)
    found = fit(asked, unknowns, Weighting.white(SIZE), step=FINE_STEP)
    slopes = found.slopes[0] + wrong * found.residual, found.slopes[1]
    return asked, Hypothesis((), replace(found, slopes=slopes), ())


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 1000), wrong=st.floats(-1.0, 1.0))
def test_slopes_within_the_errors_are_those_on_paper_whatever_the_search_left(seed, wrong):
    asked, h = compensated(seed, wrong)
    exact = asked.jacobian(*h.fit.values)
    found = within_error(asked, h, Weighting.white(SIZE)).fit
    assert np.all(np.linalg.norm(found.jacobian - exact, axis=0) < 1e-4 * np.linalg.norm(exact, axis=0))


def test_errors_of_what_compensates_hold_the_true_values_only_with_such_slopes():
    before, after = [], []
    for seed in range(60):
        asked, h = compensated(seed, 2.0)
        here = replace(h, fit=replace(h.fit, covariance=np.linalg.inv(h.fit.jacobian.T @ h.fit.jacobian)))
        found = within_error(asked, here, Weighting.white(SIZE)).fit
        for some, fitted in ((before, here.fit), (after, found)):
            some += [abs(fitted.theta[n] - v) < WIDTH * fitted.std[n] for n, v in asked.true.items()]
    assert np.mean(before) < 0.7
    assert np.mean(after) > 0.9


def test_a_slope_at_a_bound_is_taken_to_one_side():
    asked, h = compensated(1, 0.0)
    a, b = h.fit.unknowns
    held = replace(h, fit=replace(h.fit, unknowns=(replace(a, high=float(h.fit.values[0])), b)))
    found = within_error(asked, held, Weighting.white(SIZE)).fit.jacobian
    assert found[:, 0] == pytest.approx(asked.jacobian(*h.fit.values)[:, 0], rel=1e-6)


@pytest.mark.parametrize("true", [1, 4])
def test_a_screening_is_done_again_only_if_the_steps_become_finer(true):
    """The onset that was found with it stays all the same, as it does where it is read from a checkpoint."""
    slope = Unknown("slope", 1.0, -10.0, 10.0, 1.0)
    c = Candidate("viscous_damping", "here", (slope,))
    fitter = Refitter(baseline(Held(0.1, true_finer=true), noise=SIZE))
    [h] = fitter.finished([Promise((c,), 0.0, {})])
    shown = Screened(fitter.baseline, None, h.fit, [], [], Stages(), lambda: None)
    after, again = finer(fitter, shown, [h], [h, h])
    assert (after is shown) == (true == 1)
    assert after.came is shown.came
    assert after.problem.steps.parts == true
    assert len(again) == (1 if true == 1 else 2)
