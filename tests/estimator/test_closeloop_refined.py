"""The end of a fit whose sum of squares is rugged, and errors that reach what it allows."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.closeloop.fitting import likelihood_profile as likelihood
from estimator.closeloop.fitting import refined
from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.slopes import FINE_STEP, STEP
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array, Run
from estimator.weighting import Weighting
from tests.helpers.baselines import baseline
from tests.helpers.problems import OneByOne, record_with

SIZE = np.array([0.1])
ROUNDS = 4  # largest number of fits that go on from one another
AMPLITUDE, STIFFNESS = Unknown("q", 1.0, 0.0, np.inf, 1.0), Unknown("k", 10.0, 0.0, np.inf, 10.0)

BESIDE = 0.25  # N/m too stiff a start, from which the usual differences do not arrive


class Swinging(OneByOne):
    """A spring that has swung so often that a difference of the usual step is turns of it away.

    Its noise is not declared, so that fits take no secants, which lead over the ripples by chance.
    """

    policy = DEFAULT

    free_states = ()

    def __init__(self, k: float, seed: int, noise: float = 0.1) -> None:
        t = np.arange(4000) * 0.02
        every = np.ones(len(t), bool)
        self.true = {"q": 1.0, "k": k}
        y = noise * np.random.default_rng(seed).standard_normal((len(t), 1)) + swing(t, self.true)
        self.record = record_with(
            runs=(Run(t, y, y, every, ~every, ~every),), noise_declared=np.array([False]), outputs=("y",)
        )

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        return run.y - swing(run.t, theta)


def swing(t: Array, theta: Mapping[str, float]) -> Array:
    """Free motion of a mass of 1 kg, (N, 1)."""
    return theta["q"] * np.cos(np.sqrt(theta["k"]) * t)[:, None]


class Refitter(Fitter):
    """Fits without an FMU."""

    def finished(
        self, promises: Sequence[Promise], unknowns: Sequence[Unknown] | None = None,
        guess: Mapping[str, Array] | None = None, step: float = STEP,
    ) -> list[Hypothesis]:  # fmt: skip
        """See Fitter; as there, a fit goes on from where it ends until it has converged."""
        return [self._finished(p, unknowns or (), step) for p in promises]

    def _finished(self, promise: Promise, others: Sequence[Unknown], step: float) -> Hypothesis:
        start = promise.start
        for _ in range(ROUNDS):
            h = at_rest(
                self.baseline.problem, promise.candidates[0], Weighting.white(SIZE), start, step, others
            )
            if h.fit.converged:
                break
            start = h.fit.theta
        return h


def fitter(asked: Problem) -> Refitter:
    return Refitter(baseline(asked, noise=SIZE))


def at_rest(
    problem: Problem, c: Candidate, weighting: Weighting, start: Mapping[str, float], step: float = STEP,
    others: Sequence[Unknown] = (),
) -> Hypothesis:  # fmt: skip
    """Where a fit from `start` ends."""
    return Hypothesis((c,), fit(problem, [*others, *c.unknowns], weighting, start, step=step), ())


def swung(seed: int, off: float) -> tuple[Swinging, Hypothesis]:
    """A record, and where a fit from a stiffness that is a little off ends."""
    asked = Swinging(10.0, seed)
    law = Candidate("stiffness_change", "spring", (AMPLITUDE,), (STIFFNESS,))
    return asked, at_rest(asked, law, Weighting.white(SIZE), {"q": 1.0, "k": 10.0 + off})


@settings(max_examples=20)
@given(seed=st.integers(0, 1000), off=st.floats(-0.25, 0.26))
def test_finer_differences_lead_on_where_the_usual_ones_come_to_rest(seed, off):
    asked, h = swung(seed, off)
    found = refined.refined(fitter(asked), h)
    assert cost(found) <= cost(h)
    assert found.fit.theta["k"] == pytest.approx(10.0, abs=5 * found.fit.std["k"])
    assert cost(found) < 1.1 * len(found.fit.residual)


def test_the_usual_differences_do_come_to_rest_beside():
    short = [swung(seed, BESIDE)[1] for seed in range(5)]
    assert all(cost(h) > 2 * len(h.fit.residual) for h in short)


def test_where_noise_alone_is_left_nothing_is_fitted_again():
    asked, h = swung(1, 0.0)
    assert cost(h) < refined.RUGGED * len(h.fit.residual)
    assert refined.refined(fitter(asked), h) is h


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_in_a_false_minimum_is_begun_at_the_declared_values(seed):
    """The stiffness is calibrated beside a law, and a calibration without the law had led it far away."""
    asked, law = Swinging(10.0, seed), Candidate("constant_force", "spring", (AMPLITUDE,))
    h = at_rest(asked, law, Weighting.white(SIZE), {"q": 1.0, "k": 11.5}, others=[STIFFNESS])
    assert abs(h.fit.theta["k"] - 10.0) > 0.5
    found = refined.from_declared(fitter(asked), h)
    assert found.fit.theta["k"] == pytest.approx(10.0, abs=5 * found.fit.std["k"])
    assert cost(found) < 1.1 * len(found.fit.residual)
    assert refined.from_declared(fitter(asked), found) is found


def test_what_fits_worse_is_not_taken_and_worth_is_kept():
    asked, h = swung(2, BESIDE)
    h = replace(h, worth={"stiffness_change@spring": 7.0})
    worse = replace(h, fit=replace(h.fit, residual=2 * h.fit.residual))
    assert refined.lower(h, [worse]) is h
    [better] = fitter(asked).finished([Promise(h.candidates, 0.0, h.theta)], step=FINE_STEP)
    assert refined.lower(h, [worse, better]).worth == h.worth


def test_errors_hold_the_true_values_where_the_fit_had_come_to_rest_beside(monkeypatch):
    """As often as they say, and they are narrower than beside."""
    monkeypatch.setattr(likelihood, "built", lambda problem, _: problem)
    held, narrower = [], []
    for seed in range(40):
        asked, h = swung(seed, BESIDE)
        found = likelihood.profiled(fitter(asked), h).fit
        held += [abs(found.theta[n] - v) < 1.96 * found.std[n] for n, v in asked.true.items()]
        narrower.append(found.std["k"] / h.fit.std["k"])
    assert np.mean(held) > 0.9
    assert np.median(narrower) < 0.1


def test_errors_reach_a_place_that_the_sum_of_squares_allows():
    _, h = swung(3, 0.0)
    moved = h.fit.values + np.array([0.0, 0.05])
    near = replace(h, fit=replace(h.fit, values=moved, residual=h.fit.residual * np.sqrt(1 + 1 / cost(h))))
    far = replace(near, fit=replace(near.fit, residual=1.1 * h.fit.residual))
    assert likelihood.reached(h, near) == pytest.approx([0.0, 0.05 / likelihood.WIDTH])
    assert likelihood.reached(h, far) == pytest.approx([0.0, 0.0])


def test_rivals_are_refined_as_the_best_one_is_and_what_is_far_off_is_left():
    asked, best = swung(3, BESIDE)
    rival = replace(best, candidates=(replace(best.candidates[0], location="elsewhere"),))
    far = replace(best, fit=replace(best.fit, residual=2 * best.fit.residual))
    found = refined.evenly(fitter(asked), [best, rival, far])
    assert [cost(h) for h in found[:2]] == pytest.approx([cost(found[0])] * 2)
    assert cost(found[0]) < 0.5 * cost(best)
    assert found[1].candidates == rival.candidates
    assert found[2] is far


def test_rivals_of_what_leaves_noise_alone_stay():
    asked, best = swung(1, 0.0)
    rival = replace(best, candidates=(replace(best.candidates[0], location="elsewhere"),))
    assert refined.evenly(fitter(asked), [best, rival]) == [best, rival]
