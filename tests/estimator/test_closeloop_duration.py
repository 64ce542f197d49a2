"""The progress line says how long the fits may take where that is long."""

from types import SimpleNamespace

import pytest

from estimator.closeloop.fitting.fitter import BRIEF, LONG
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.search import duration
from estimator.closeloop.search.duration import duration_said, simulations


def promise(unknowns):
    return SimpleNamespace(candidates=[SimpleNamespace(unknowns=["p"] * unknowns)])


def fitter(clock, takes=0.0, jobs=1):
    """A fitter with two calibrated unknowns, whose simulation moves the clock."""

    def simulate(theta):
        clock[0] += takes

    fit = SimpleNamespace(unknowns=["a", "b"], theta={"a": 1.0, "b": 2.0})
    problem = SimpleNamespace(simulate=simulate, forget=lambda: None, at_once=1)
    hypothesis = SimpleNamespace(fit=fit)
    baseline = SimpleNamespace(problem=problem, hypothesis=hypothesis, policy=DEFAULT)
    return SimpleNamespace(baseline=baseline, jobs=jobs)


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(duration, "monotonic", lambda: now[0])
    return now


def test_every_unknown_costs_a_simulation(clock):
    assert simulations(fitter(clock), [promise(1)]) == 2 * BRIEF + 4 * LONG
    assert simulations(fitter(clock), [promise(1), promise(3)]) == 6 * BRIEF + 10 * LONG


def test_only_the_finalists_are_fitted_to_convergence(clock):
    most = DEFAULT.search.finalists
    more = simulations(fitter(clock), [promise(1)] * (most + 7))
    assert more - simulations(fitter(clock), [promise(1)] * most) == 7 * 2 * BRIEF


def test_a_long_search_is_announced_and_a_short_one_is_not(clock):
    promises = [promise(1)]
    count = 2 * BRIEF + 4 * LONG
    assert duration_said(fitter(clock, takes=0.9 * duration.WORTH_SAYING / count), promises) == ""
    hour = fitter(clock, takes=3600 / count)
    assert "up to about 60 min" in duration_said(hour, promises)
    assert "up to about 15 min" in duration_said(fitter(clock, takes=3600 / count, jobs=4), promises)
