"""The verdict follows from its checks, and every limit says what it is and where it comes from."""

from dataclasses import asdict, fields, replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.closeloop.detection.importance import importance
from estimator.closeloop.evidence import (
    ANSWER,
    Check,
    Name,
    Verdict,
    verdict_of,
)
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.policy import DEFAULT, Policy
from estimator.closeloop.question.problem import Problem
from estimator.record import Record, Run
from tests.helpers.baselines import baseline, fit_with
from tests.helpers.paths import ROOT
from tests.helpers.verdicts import FAILED, judged


def size_of(at, h, likeness=1.0, sets_in=False, noise=np.ones(2)):  # noqa: B008
    return importance(baseline(at, h, noise), likeness, sets_in)


NAMES = get_args(Name)
passing = st.fixed_dictionaries({name: st.booleans() for name in NAMES})


def checks(passed: dict[str, bool]) -> list[Check]:
    return [Check(name, 1.0, 1.0, ok) for name, ok in passed.items()]


@given(passing)
def test_any_checks_give_one_verdict(passed):
    assert verdict_of(checks(passed)) in get_args(Verdict)


@given(passing)
def test_an_answer_that_fails_a_check_is_never_named(passed):
    verdict = verdict_of(checks(passed))
    if not (all(passed[name] for name in ANSWER) and passed["an effect is more probable than none"]):
        assert verdict not in ("traced", "several", "ambiguous")
    if verdict in ("traced", "several", "ambiguous"):
        assert passed["the residual is more than noise"]
        assert passed["the residual is large enough to matter"]


@given(passing)
def test_what_is_left_unexplained_stays_so_if_more_is_found_beyond_noise(passed):
    if verdict_of(checks(passed)) == "unexplained":
        more = passed | {
            "the residual is more than noise": True,
            "the residual is large enough to matter": True,
            "an effect is more probable than none": True,
        }
        assert verdict_of(checks(more)) == "unexplained"


@given(st.floats(0.0, 50.0), st.floats(0.0, 50.0), st.floats(1.0, 3.0), st.sampled_from([0.0, 0.02, 0.2]))
def test_a_larger_residual_matters_no_less(a, b, more, form):
    at = replace(asked(2), form_error=form)
    for sets_in in (False, True):
        less = size_of(at, left(a, b), 0.5, sets_in)
        assert size_of(at, left(more * a, more * b), 0.5, sets_in) >= less


@given(st.floats(0.0, 50.0), st.floats(0.0, 50.0), st.floats(1e-6, 1e6), st.sampled_from([0.0, 0.2]))
def test_neither_the_order_of_outputs_nor_their_units_matter(a, b, unit, form):
    at = replace(asked(2), form_error=form)
    [run] = at.record.runs
    scaled = replace(at, record=replace(at.record, runs=(replace(run, y=run.y * [unit, 1.0]),)))
    one, other = left(a, b), left(b, a)
    in_units = replace(one, residuals=(one.residuals[0] * [unit, 1.0],))
    expected = pytest.approx(size_of(at, one), rel=1e-9)
    assert size_of(at, other) == expected
    assert size_of(scaled, in_units, noise=np.array([unit, 1.0])) == expected


@pytest.mark.parametrize("verdict", sorted(FAILED))
def test_each_verdict_has_checks_that_lead_to_it(verdict):
    assert judged(verdict).verdict == verdict


def test_a_check_that_was_not_made_is_missed():
    with pytest.raises(ValueError, match="more than noise"):
        verdict_of([])


def asked(outputs: int) -> Problem:
    t = np.arange(4000.0)
    y = 30.0 * np.sin(t)[:, None] * np.ones(outputs)
    run = Run(t, y[:, :0], y, t < 2000, t >= 2000, t >= 2000)
    names = tuple(f"y_{i}" for i in range(outputs))
    return Problem(lambda _: None, Record((run,), (), names, np.ones(outputs)), {}, {})


def left(*rms: float) -> Hypothesis:
    sign = np.where(np.arange(4000) % 2, 1.0, -1.0)
    nothing = fit_with((), np.zeros(0), np.zeros((0, 0)), sign, np.zeros((4000, 0)))
    return Hypothesis((), nothing, (sign[:, None] * np.array(rms),))


# ---- the policy

LIMITS = list(DEFAULT.limits())


@pytest.mark.parametrize(("name", "value", "about"), LIMITS, ids=[name for name, _, _ in LIMITS])
def test_every_limit_has_a_unit_a_meaning_and_a_source(name, value, about):
    assert isinstance(value, int | float)
    for key in ("unit", "meaning", "source"):
        assert len(about.metadata[key].split()) >= (1 if key == "unit" else 2), f"{name}: {key}"


def test_the_version_changes_with_every_limit():
    versions = {DEFAULT.version}
    for stage in fields(Policy):
        group = getattr(DEFAULT, stage.name)
        for f in fields(group):
            changed = replace(group, **{f.name: getattr(group, f.name) * 2})
            versions.add(replace(DEFAULT, **{stage.name: changed}).version)
    assert len(versions) == 1 + len(LIMITS)
    assert Policy().version == DEFAULT.version
    assert asdict(DEFAULT)["decision"]["telling"] == DEFAULT.decision.telling


def test_the_page_of_the_policy_is_that_of_the_default():
    page = (ROOT / "docs" / "policy.md").read_text(encoding="utf-8")
    assert page.partition("\n## ")[2] == DEFAULT.table().partition("## ")[2], (
        "write `python -m estimator.closeloop.policy` below the head of docs/policy.md"
    )
