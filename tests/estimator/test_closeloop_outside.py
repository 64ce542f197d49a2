"""What the best answer leaves: undeclared noise, the form of a right model, or another mechanism."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.evidence import Verdict
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.probability import NO_DISCREPANCY, probabilities
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array, Record, Run
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.verdicts import judged

SAMPLES = 1000
T = np.arange(float(SAMPLES))
FIT = T % 100 < 60  # parts of the record: to identify, to choose, to test
LAW, OTHER = np.sin(0.05 * T), np.sign(np.sin(0.021 * T))
NAME = "constant_force@p"


def hypothesis(measured: Array, *laws: Array) -> Hypothesis:
    """The least-squares fit of laws that act on two outputs alike; measured: (SAMPLES, 2)."""
    shapes = np.reshape(laws, (-1, SAMPLES)).T
    on_both = np.repeat(shapes[FIT], 2, axis=0)
    covariance = np.linalg.inv(on_both.T @ on_both)
    sizes = covariance @ (on_both.T @ measured[FIT].ravel())
    left = measured - (shapes @ sizes)[:, None]
    unknowns = tuple(Unknown("constant_force_p_F_0", 0.0, -np.inf, np.inf, 1.0) for _ in laws)
    fit = fit_with(unknowns, sizes, covariance, left[FIT].ravel(), -on_both)
    return Hypothesis(tuple(Candidate("constant_force", "p", (u,)) for u in unknowns), fit, (left,))


def probability_of(label: str, measured: Array, declared: bool, verdict: Verdict = "traced") -> float:
    """Probability of the law of the library, or of none; 0 where it is less than a thousandth."""
    signal = 100 * np.sin(T)[:, None] * np.ones(2)
    choose = (T % 100 >= 60) & (T % 100 < 80)
    run = Run(T, signal[:, :0], signal, FIT, choose, T % 100 >= 80)
    problem = Problem(lambda _: Path(), Record((run,), (), ("y", "z"), np.ones(2)), {}, {})
    base, law = hypothesis(measured), hypothesis(measured, LAW)
    known = baseline(problem, base, np.ones(2))
    asked = replace(known, noise=replace(known.noise, declared=np.full(2, declared)))
    promised = [Promise(law.candidates, base.fit.cost - law.fit.cost, {})]
    found = probabilities(asked, Detection(0.01, 0.001, {}, 10.0), judged(verdict), promised, [law])
    return found.get(label, 0.0)


@given(st.floats(10.0, 30.0), st.floats(0.2, 0.5), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_a_small_remainder_in_all_outputs_rules_out_noise_and_not_the_law(size, left, seed):
    """The model's form leaves it where an answer is right, and several outputs see that too."""
    noise = np.random.default_rng(seed).standard_normal((SAMPLES, 2))
    measured = noise + (size * LAW + left * OTHER)[:, None]
    declared, undeclared = (probability_of(NAME, measured, said) for said in (True, False))
    odds = declared / (1 - declared) * (1 - DEFAULT.prior.coloured)  # white noise is as probable as coloured
    assert undeclared / (1 - undeclared) > 0.98 * odds
    assert undeclared > 0.7


@pytest.mark.parametrize("size", [3.0, 10.0])
def test_a_large_remainder_is_a_mechanism_if_outputs_share_it_and_noise_if_they_do_not(size):
    rng, said = np.random.default_rng(5), []
    for white, slow in rng.standard_normal((30, 2, SAMPLES, 2)):
        shared = white + (size * (LAW + OTHER))[:, None]
        apart = white + size * LAW[:, None] + lfilter([1.0], [1.0, -0.95], slow, axis=0)
        cases = ((shared, False), (apart, False), (apart, True))
        said.append([probability_of(NAME, measured, declared) for measured, declared in cases])
    of_shared, of_apart, of_declared = np.transpose(said)
    assert np.max(of_shared) < 0.05
    assert np.mean(of_apart > 0.9) > 0.9  # one in a hundred noises looks as if outputs shared it
    assert np.max(of_declared) < 0.1


@pytest.mark.parametrize(
    ("common", "declared", "none"), [(0.0, False, True), (1.0, False, False), (0.0, True, False)]
)
def test_what_no_effect_explains_is_noise_if_outputs_do_not_share_it_and_its_size_is_not_declared(
    common, declared, none
):
    rng, said = np.random.default_rng(6), []
    for white, slow in rng.standard_normal((20, 2, SAMPLES, 2)):
        slow[:, 1] += common * slow[:, 0]
        measured = white + 3 * lfilter([1.0], [1.0, -0.95], slow, axis=0)
        said.append(probability_of(NO_DISCREPANCY, measured, declared, "unexplained"))
    assert np.mean((np.array(said) > 0.5) == none) > 0.9
