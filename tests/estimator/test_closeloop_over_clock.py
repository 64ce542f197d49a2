"""An offset of the outputs' clock that a record neither shows nor excludes widens the errors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from estimator.closeloop.fitting.over_clock import offset_shows, over_clock
from estimator.closeloop.hypotheses.fitted import Fit, sandwich
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown
from estimator.record import Record, Run
from estimator.weighting import Weighting

DT, SAMPLES, STD = 0.01, 1000, np.array([0.05, 0.05])
T = np.arange(SAMPLES) * DT
DRAWS = 300
LAG = Unknown("lag", 0.0, -np.inf, np.inf, 1e-3)
SHOWN = np.column_stack([np.sin(2 * np.pi * T), np.cos(2 * np.pi * 3.1 * T)])
RATES = np.column_stack([2 * np.pi * np.cos(2 * np.pi * T), -2 * np.pi * 3.1 * np.sin(2 * np.pi * 3.1 * T)])


def fitted(offset, rng, seen):
    """A baseline and a lag of the first output, fitted to a record whose outputs are read `offset` s later.

    seen: share of its rate that the second output shows, which no lag moves.
    """
    late = RATES * [1.0, seen]
    slopes = (np.column_stack([RATES[:, 0], np.zeros(SAMPLES)]) / STD).ravel()
    measured = (late * offset + STD * rng.standard_normal((SAMPLES, 2))) / STD
    value = float(slopes @ measured.ravel()) / float(slopes @ slopes)
    left = measured.ravel() - value * slopes
    residual = left.reshape(-1, 2) * STD
    every = np.ones(SAMPLES, bool)
    run = Run(T, T[:, None], SHOWN * [1.0, seen] + residual, every, ~every, ~every)
    baseline = SimpleNamespace(
        problem=SimpleNamespace(record=Record((run,), ("u",), ("a", "b"), STD), clock=0.0),
        noise=SimpleNamespace(weighting=Weighting.white(STD), known=True),
        policy=DEFAULT,
    )
    errors = sandwich(left, slopes[:, None], np.array([LAG.scale]), np.array([np.inf]))
    return baseline, Hypothesis((), Fit((LAG,), np.array([value]), errors, left, (slopes,)), (residual,))


def within(offsets, seen, allowed):
    """Share of draws whose 95 % interval contains the true lag, which is zero."""
    rng = np.random.default_rng(1)
    found = 0
    for offset in offsets:
        baseline, h = fitted(offset, rng, seen)
        h = over_clock(baseline, h) if allowed else h
        found += abs(h.fit.values[0]) < 1.96 * h.fit.std["lag"]
    return found / len(offsets)


OFFSETS = np.random.default_rng(0).uniform(-DT, DT, DRAWS)


@pytest.mark.parametrize("seen", [0.0, 0.005, 1.0])
def test_intervals_hold_whatever_the_clock_is(seen):
    assert within(OFFSETS, seen, allowed=True) > 0.9
    assert within(OFFSETS, seen, allowed=False) < 0.3


def test_what_the_other_output_excludes_adds_nothing():
    baseline, h = fitted(0.0, np.random.default_rng(2), 1.0)
    alone, blind = fitted(0.0, np.random.default_rng(2), 0.0)
    own = h.fit.std["lag"]
    assert over_clock(baseline, h).fit.std["lag"] < 2 * own
    # nothing tells the lag from a late clock: the error is that of an offset within a sample
    assert over_clock(alone, blind).fit.std["lag"] == pytest.approx(DT / np.sqrt(3), rel=0.05)


def test_an_offset_shows_where_it_is_there_and_hardly_ever_else():
    rng = np.random.default_rng(3)
    assert all(offset_shows(*fitted(DT / 2, rng, 1.0)) for _ in range(20))
    assert sum(offset_shows(*fitted(0.0, rng, 1.0)) for _ in range(DRAWS)) <= 0.02 * DRAWS
    assert not any(offset_shows(*fitted(DT, rng, 0.0)) for _ in range(20))


def test_an_offset_that_is_fitted_counts_once():
    baseline, h = fitted(0.002, np.random.default_rng(4), 0.1)
    clocked = replace_problem(baseline, clock=DT)
    assert over_clock(clocked, h) is h
    nothing = replace(h, fit=replace(h.fit, unknowns=(), slopes=()))
    assert over_clock(baseline, nothing) is nothing


def replace_problem(baseline, **changes):
    problem = SimpleNamespace(**{**vars(baseline.problem), **changes})
    return SimpleNamespace(**{**vars(baseline), "problem": problem})
