"""What the test part, which neither fitting nor choosing has used, asks of an answer."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.closeloop.decision.verdict import confirmed_on_test
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array, Record, Run
from tests.helpers.baselines import NOTHING, baseline
from tests.helpers.verdicts import DETECTED

N = 3000  # samples of each part
T = np.arange(3.0 * N)
NOISE = np.ones(1)
ONE = np.where(np.arange(len(T)) % 2, 1.0, -1.0)
LAW = Candidate("viscous_damping", "here", (Unknown("c", 1.0, -np.inf, np.inf, 1.0),))

OTHER = replace(LAW, location="there")


def leaves(residual: Array, candidates: tuple[Candidate, ...] = ()) -> Hypothesis:
    return Hypothesis(candidates, replace(NOTHING.fit, residual=residual[:N]), (residual[:, None],))


def over_parts(fit: float, choose: float, test: float) -> Array:
    """A residual with these rms values on the parts to identify, to choose and to test."""
    return ONE * np.repeat([fit, choose, test], N)


def judged(base: Array, found: Array, effects: int = 1) -> tuple[Baseline, Judgement]:
    y = 5 * np.sin(T)[:, None]
    run = Run(T, y[:, :0], y, *(np.equal(T // N, i) for i in range(3)))
    problem = Problem(lambda _: None, Record((run,), (), ("y",), NOISE), {}, {})
    at = baseline(problem, leaves(base), NOISE)
    naming = Judgement.naming([leaves(found, (LAW, OTHER)[:effects])])
    return at, confirmed_on_test(at, naming).after(DETECTED)


@pytest.mark.parametrize(
    ("effects", "on_test", "verdict"),
    [
        (2, 1.0, "several"),
        (2, 1.06, "several"),
        (2, 1.8, "unexplained"),
        (2, 5.0, "unexplained"),
        (1, 1.0, "traced"),
        (1, 1.8, "traced"),  # a prediction has errors of its own
        (1, 6.1, "unexplained"),
    ],
)
def test_several_effects_account_for_the_test_part_as_for_the_part_to_choose(effects, on_test, verdict):
    _, found = judged(over_parts(6.0, 6.0, 6.0), over_parts(1.0, 1.0, on_test), effects)
    assert found.verdict == verdict
    assert ("times the noise" in found.reason) is (verdict == "unexplained" and on_test < 6.0)


def with_effect(size: float) -> Array:
    """Noise, and an effect that moves the output by `size` altogether over the test part."""
    rng = np.random.default_rng(1)
    away = np.repeat([5.0, 5.0, size / np.sqrt(N)], N)
    return rng.standard_normal(3 * N) + away


@pytest.mark.parametrize("size", [0.0, 1.0, 3.0])
def test_a_test_part_without_the_effect_neither_confirms_nor_denies_it(size):
    at, found = judged(with_effect(size), with_effect(size) - np.repeat([5.0, 5.0, size / np.sqrt(N)], N))
    assert not at.shows(found.members[0], "test")
    assert found.verdict == "traced"
    assert "cannot confirm or deny" in found.reason
    [check] = [c for c in found.checks if c.name == "no worse than without it on the test part"]
    assert check.limit == -DEFAULT.decision.telling


def test_a_test_part_with_the_effect_has_to_confirm_it():
    effect = np.repeat([5.0, 5.0, 100 / np.sqrt(N)], N)
    at, right = judged(with_effect(100.0), with_effect(100.0) - effect)
    assert at.shows(right.members[0], "test")
    assert right.verdict == "traced"
    assert "cannot confirm" not in right.reason
    _, wrong = judged(with_effect(0.0), with_effect(0.0) - effect)
    assert wrong.verdict == "unexplained"


@pytest.mark.parametrize(("size", "shown"), [(3.9, False), (4.1, True)])
def test_a_part_shows_what_leads_by_two_standard_errors_on_average_if_it_is_right(size, shown):
    rng, leads = np.random.default_rng(2), []
    effect = np.repeat([0.0, 0.0, size / np.sqrt(N)], N)
    for _ in range(200):
        noise = rng.standard_normal(3 * N)
        at, _ = judged(noise + effect, noise)
        right = leaves(noise)
        leads.append(at.lead(right, at.hypothesis, "test")[0])
        assert at.shows(right, "test") is shown
    assert np.mean(leads) == pytest.approx(size**2 / 2, abs=4 * size / np.sqrt(200))
    assert np.std(leads) == pytest.approx(size, rel=0.2)
