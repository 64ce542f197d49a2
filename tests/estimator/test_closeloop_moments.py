"""The moment at which an effect sets in lies in the part to identify, and the parts keep their sizes."""

from typing import Any, cast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from estimator.closeloop.question.moments import chosen_where_seen, identified_at
from estimator.closeloop.question.problem import Problem
from estimator.record import Record, Run
from scenarios.experiment.parts import spread

DT = 0.01


def asked(choose: np.ndarray, identify: int, begin: float = 0.0) -> Problem:
    """A problem with these samples to choose among the first ones, to identify; the rest is to test."""
    n = len(choose)
    used = np.arange(n) < identify
    run = Run(begin + DT * np.arange(n), np.zeros((n, 1)), np.zeros((n, 1)), used & ~choose, choose, ~used)
    return Problem(cast(Any, None), Record((run,), ("u",), ("y",), np.array([0.1])), {}, {})


def usual(samples: int, begin: float = 0.0) -> Problem:
    """A problem with the parts that a record has if none is declared."""
    identify = np.arange(samples) < int(0.6 * samples)
    return asked(spread(identify), int(identify.sum()), begin)


@given(st.integers(2000, 9000), st.floats(0.0, 1.0), st.floats(-100.0, 2000.0))
def test_a_moment_within_the_part_to_choose_is_identified(samples: int, share: float, begin: float) -> None:
    problem = usual(samples, begin)
    [before] = problem.record.runs
    moment = share * DT * (samples - 1)
    moved = identified_at(problem, moment)
    at = round(moment / DT)
    if moved is None:
        last = np.flatnonzero(before.choose)[-1]  # the last stretch ends with the part to identify
        assert not before.choose[at] or at > last - before.choose.sum() / 5
        return
    [after] = moved.record.runs
    assert after.fit[at]
    assert (after.fit.sum(), after.choose.sum()) == (before.fit.sum(), before.choose.sum())
    assert not (after.fit & after.choose).any()
    np.testing.assert_array_equal(after.test, before.test)
    assert sorted(moved.record.stretches("choose")) == sorted(problem.record.stretches("choose"))
    assert identified_at(moved, moment) is None
    assert "within the part to choose" in moved.record.notes[-1].sentence


@given(st.integers(2600, 9000))
def test_the_moved_part_is_averaged_in_the_same_groups(samples: int) -> None:
    """All stretches of the part to identify remain multiples of the 15 samples of screening."""
    problem = usual(samples)
    first = int(np.flatnonzero(problem.record.runs[0].choose)[0])
    moved = identified_at(problem, DT * (first + 5))
    assert moved is not None
    lengths = moved.record.stretches("fit")[:-1]
    assert all(length % 15 == 0 for length in lengths)


def test_a_moment_that_the_fits_do_not_see_on_both_sides_stays() -> None:
    """A part to choose that was declared behind the part to identify is left alone."""
    choose = np.zeros(1000, dtype=bool)
    choose[400:600] = True
    assert identified_at(asked(choose, 600), 5.0) is None


def test_the_following_samples_are_taken_where_those_before_are_too_few() -> None:
    choose = np.zeros(1000, dtype=bool)
    choose[50:150] = True
    moved = identified_at(asked(choose, 800), 1.0)
    assert moved is not None
    [run] = moved.record.runs
    assert run.fit[:200].all()
    assert run.choose.sum() == 100


def left_at(problem: Problem, *moments: int) -> np.ndarray:
    """A residual of noise alone, but for 20 samples from each of some samples on."""
    left = np.random.default_rng(0).standard_normal((len(problem.record.runs[0].t), 1))
    for at in moments:
        left[at : at + 20] += 30.0
    return left


@given(st.integers(2000, 9000), st.lists(st.floats(0.0, 1.0), min_size=3, max_size=6, unique=True))
def test_what_only_the_fits_see_comes_into_the_part_to_choose(samples: int, shares: list[float]) -> None:
    problem = usual(samples)
    [before] = problem.record.runs
    fitted = np.flatnonzero(before.fit)
    left = left_at(problem, *(int(fitted[int(share * (len(fitted) - 30))]) for share in shares))
    left[before.choose] = 1.0  # the events reach into no sample to choose
    moved = chosen_where_seen(problem, left)
    if moved is None:
        return
    [after] = moved.record.runs
    beyond = (left**2 - 1)[:, 0]
    assert beyond[after.choose].sum() > 0
    assert beyond[after.fit].sum() > beyond[before.fit].sum() / 2 - len(left)
    assert (after.fit.sum(), after.choose.sum()) == (before.fit.sum(), before.choose.sum())
    assert not (after.fit & after.choose).any()
    np.testing.assert_array_equal(after.test, before.test)
    assert "shows only noise" in moved.record.notes[-1].sentence


def test_of_several_events_one_is_chosen_by_and_a_single_one_is_identified() -> None:
    problem = usual(6000)
    [run] = problem.record.runs
    length = problem.record.stretches("choose")[0]
    first = int(np.flatnonzero(run.choose)[0])
    events = [first + k * length + 30 for k in (1, 3, 6, 8, 11) if run.fit[first + k * length + 30]]
    assert len(events) >= 3
    moved = chosen_where_seen(problem, left_at(problem, *events))
    assert moved is not None
    assert sum(bool(moved.record.runs[0].choose[at]) for at in events) == 1
    assert chosen_where_seen(problem, left_at(problem, events[0])) is None
    assert chosen_where_seen(problem, left_at(problem)) is None
