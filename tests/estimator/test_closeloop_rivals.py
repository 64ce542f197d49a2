"""Rivals of an answer are fitted from its values and as carefully as it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.likelihood_profile import carefully
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.search.rivals import as_carefully, from_its_values
from estimator.record import Array, Run
from tests.helpers.baselines import NOTHING, baseline
from tests.helpers.fitters import SIZE, Refitter
from tests.helpers.problems import OneByOne, record_with

STIFFNESS = Unknown("k", 13.0, 0.0, np.inf, 10.0)  # declared several turns of the motion away
TURNS_OFF = 3.0  # N/m too stiff, as declared


def law(kind: str) -> Candidate:
    return Candidate(kind, "spring", (Unknown(f"{kind}_spring_q", 1.0, 0.0, np.inf, 1.0),))


class Swinging(OneByOne):
    """A spring of calibrated stiffness k, with an amplitude that several laws give alike."""

    policy = DEFAULT
    free_states = ()

    def __init__(self, seed: int) -> None:
        t = np.arange(4000) * 0.02
        every = np.ones(len(t), bool)
        y = (
            SIZE * np.random.default_rng(seed).standard_normal((len(t), 1))
            + np.cos(np.sqrt(10.0) * t)[:, None]
        )
        self.record = record_with(
            runs=(Run(t, y, y, every, ~every, ~every),), noise_declared=np.array([True]), outputs=("y",)
        )

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run] = self.record.runs
        [q] = (v for n, v in theta.items() if n.endswith("_q"))
        return run.y - q * np.cos(np.sqrt(theta["k"]) * run.t)[:, None]


def fitted(fitter: Fitter, kind: str, k: float) -> Hypothesis:
    c = law(kind)
    [h] = fitter.finished([Promise((c,), 0.0, {"k": k, c.amplitudes[0].name: 1.0})], [STIFFNESS])
    return h


@pytest.mark.parametrize("seed", range(3))
def test_a_rival_that_has_not_arrived_arrives_from_the_values_of_the_answer(seed):
    fitter = Refitter(baseline(Swinging(seed), noise=SIZE))
    answer, beside = fitted(fitter, "a", 10.0), fitted(fitter, "b", 10.0 + TURNS_OFF)
    assert cost(beside) > 10 * cost(answer)
    assert cost(carefully(fitter, beside)) > 10 * cost(answer)  # its own values do not lead there
    near = replace(beside, fit=replace(beside.fit, residual=1.2 * answer.fit.residual))
    [found] = as_carefully(fitter, answer, [near])
    assert found.candidates == beside.candidates
    assert cost(found) == pytest.approx(cost(answer), abs=0.1)  # far within what noise decides


def test_rivals_far_behind_and_the_calibrated_fmu_are_left_out():
    fitter = Refitter(baseline(Swinging(0), noise=SIZE))
    answer, beside = fitted(fitter, "a", 10.0), fitted(fitter, "b", 10.0 + TURNS_OFF)
    assert as_carefully(fitter, answer, [beside, NOTHING]) == []


def test_a_rival_keeps_its_own_values_and_takes_those_it_shares():
    fitter = Refitter(baseline(Swinging(1), noise=SIZE))
    answer, rival = fitted(fitter, "a", 10.0), fitted(fitter, "b", 10.2)
    [promise] = from_its_values([answer, rival], DEFAULT.search)
    assert promise.start["k"] == answer.theta["k"]
    assert promise.start["b_spring_q"] == rival.theta["b_spring_q"]
    assert "a_spring_q" not in promise.start
