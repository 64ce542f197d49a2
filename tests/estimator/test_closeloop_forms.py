"""Errors that hold over the forms of a model that are as plausible as the chosen one."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from estimator.closeloop.fitting.other_forms import over_forms
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.record import Array, Run
from tests.helpers.baselines import baseline
from tests.helpers.fitters import SIZE, Refitter
from tests.helpers.problems import OneByOne, record_with

LAW = Candidate("viscous_damping", "here", (Unknown("c", 1.0, -np.inf, np.inf, 1.0),))
GAIN = Unknown("g", 1.0, -np.inf, np.inf, 1.0)
T = np.arange(2000) * 0.01


@dataclass(frozen=True)
class Formed(OneByOne):
    """An output g sin t + c (1 + 0.3 form) cos t, whose true form is between those of the model."""

    seed: int
    other_forms: tuple[dict[str, float], ...] = ({"form": 1.0},)
    declared: Mapping[str, float] = field(default_factory=lambda: {"form": 0.0})
    true_form: float = 0.5
    bend: float = 0.0  # what the other form also adds, which no unknown can compensate
    policy = DEFAULT
    free_states = ()

    @property
    def record(self):
        every = np.ones(len(T), bool)
        y = np.sin(T) + (1 + 0.3 * self.true_form) * np.cos(T)
        y = y[:, None] + SIZE * np.random.default_rng(self.seed).standard_normal((len(T), 1))
        return record_with(
            runs=(Run(T, y, y, every, ~every, ~every),), noise_declared=np.array([True]), outputs=("y",)
        )

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        [run], form = self.record.runs, self.declared["form"]
        y = theta["g"] * np.sin(T) + theta["c"] * (1 + 0.3 * form) * np.cos(T) + self.bend * form * T
        return run.y - y[:, None]


def found_by(problem: Formed) -> tuple[Refitter, Hypothesis]:
    fitter = Refitter(baseline(problem, noise=SIZE))
    [h] = fitter.finished([Promise((LAW,), 0.0, {})], [GAIN])
    return fitter, h


def test_without_another_form_nothing_changes():
    fitter, h = found_by(Formed(0, other_forms=()))
    assert over_forms(fitter, h) is h


@pytest.mark.parametrize("seed", range(3))
def test_the_variance_grows_by_that_of_the_values_between_the_forms(seed):
    fitter, h = found_by(Formed(seed))
    other = found_by(replace(Formed(seed), declared={"form": 1.0}))[1]
    grown = over_forms(fitter, h).fit.covariance - h.fit.covariance
    apart = h.fit.values - other.fit.values
    assert grown == pytest.approx(np.outer(apart, apart) / 2, abs=1e-9)
    assert over_forms(fitter, h).fit.theta == h.fit.theta


def test_errors_hold_the_truth_of_a_form_in_between_only_with_that():
    alone, over = [], []
    for seed in range(20):
        fitter, h = found_by(Formed(seed))
        alone.append(abs(h.fit.theta["c"] - 1.0) < 1.96 * h.fit.std["c"])
        over.append(abs(h.fit.theta["c"] - 1.0) < 1.96 * over_forms(fitter, h).fit.std["c"])
    assert np.mean(alone) < 0.2
    assert np.mean(over) > 0.9


def test_a_form_that_the_record_rejects_is_no_alternative():
    fitter, h = found_by(Formed(0, bend=0.05))
    assert fitter.baseline.leaves_noise(h)
    assert over_forms(fitter, h) is h
