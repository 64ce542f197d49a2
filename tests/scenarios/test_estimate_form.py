"""What the form of a model leaves open in `railfmi estimate`, on plants whose contact has another form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from estimator.filters.bounds import bounded
from estimator.filters.history import History
from estimator.filters.system import UnknownParameter
from fmus.models import model_class
from scenarios.estimating.estimating import estimate
from scenarios.estimating.form import (
    WALKS,
    choices,
    largest_wandering,
    leading,
    parameters_of_form,
    wandering,
    widened,
)
from scenarios.experiment.estimated import Options
from tests.truth.wheelset import OTHER, write_record

ASKED = """
[estimate]
parameters.mu0 = {start = 0.4, std = 0.1, bounds = [0.01, 0.6]}
"""
FIXED = """
[estimate.options]
form = false
"""


def other_contact(folder, seed, duration, more=""):
    """A record of a wheelset whose contact table is smoothed and whose spin force has another form."""
    file = write_record(folder, "other", np.random.default_rng(seed), duration=duration, form=OTHER)
    text = file.read_text().replace("mu0 = 0.5\n", "")
    head, calibrated, rest = text.partition("[calibrate]")
    file.write_text(head + rest[rest.index("[inputs]") :] + ASKED + more if calibrated else text)
    return file


@pytest.mark.slow
def test_friction_with_another_contact_is_near_the_truth_and_its_doubt_is_said(tmp_path):
    result = estimate(other_contact(tmp_path, 3, 20.0))
    mu0 = result.estimated["mu0"]
    assert abs(mu0["value"] - 0.5) < 0.05
    assert abs(mu0["value"] - 0.5) < 2.6 * mu0["std_error"]  # a constant friction was off by 20
    assert mu0["std_error"] < 0.03
    kinds = {name: e["kind"] for name, e in result.estimated.items()}
    assert {name for name, kind in kinds.items() if kind == "form"} == set(model_class("wheelset").form)
    assert any("patch = 1" in note for note in result.notes)
    assert any("'mu0' may wander by" in note for note in result.notes)


@pytest.mark.slow
def test_with_the_form_taken_for_right_the_filter_says_that_it_is_not(tmp_path):
    result = estimate(other_contact(tmp_path, 3, 20.0, FIXED))
    assert not result.consistent
    assert not any(e["kind"] == "form" for e in result.estimated.values())


def experiment(model="wheelset", parameters=(), asked=("mu0",)):
    known = dict.fromkeys(parameters, 1.0)
    return SimpleNamespace(
        model=model, parameters=known, estimate=SimpleNamespace(parameters=dict.fromkeys(asked))
    )


@pytest.mark.parametrize(
    ("e", "options", "expected"),
    [
        (experiment(), Options(), {"k_a", "k_b", "k_c", "k_spin"}),
        (experiment(parameters=("k_a", "k_spin")), Options(), {"k_b", "k_c"}),
        (experiment(asked=("mu0", "k_b")), Options(), {"k_a", "k_c", "k_spin"}),
        (experiment(asked=()), Options(), set()),
        (experiment(), Options(form=False), set()),
        (experiment(model="testrig"), Options(), set()),
        (experiment(model=None), Options(), set()),
    ],
)
def test_what_is_neither_declared_nor_asked_for_is_open(e, options, expected):
    starts = SimpleNamespace(
        variables={n: SimpleNamespace(start=0.8) for n in ("k_a", "k_b", "k_c", "k_spin")}
    )
    found = list(parameters_of_form(e, options, starts, list(e.estimate.parameters)))
    assert {p.name for p in found} == expected
    for p in found:
        assert p.transform.low < p.start < p.transform.high


def test_choices_of_the_form_are_all_tried_but_those_that_are_made():
    assert choices(experiment(), Options()) == [{"patch": 0.0}, {"patch": 1.0}]
    assert choices(experiment(parameters=("patch",)), Options()) == [{}]
    assert choices(experiment(), Options(form=False)) == [{}]


def run_of(level, log_likelihood, nis=2.0, broken=""):
    n = 4000
    x = np.tile([level, 1.0], (n, 1))
    spread = np.random.default_rng(0).chisquare(2, n) * nis / 2
    return History(
        ("mu0", "v"), np.arange(n) / 1e3, x, np.full((n, 2), 0.01), np.zeros((n, 2)), spread,
        np.full(n, 2), np.zeros((n, 2), bool), np.full(n, log_likelihood / n), None, broken,
    )  # fmt: skip


def test_the_scatter_between_plausible_forms_is_a_part_of_the_error_of_what_was_asked():
    runs = [run_of(0.40, 10.0), run_of(0.46, 12.0), run_of(0.9, 50.0, nis=3.0)]
    best, among = leading(runs)
    assert (best, among) == (1, [0, 1])
    h = widened(runs, best, among, ["mu0"])
    assert_allclose(h.std[:, 0], np.hypot(0.01, 0.06 / np.sqrt(2)))
    assert_allclose(h.std[:, 1], 0.01)
    assert_allclose(h.x, runs[1].x)


def test_one_form_alone_keeps_its_errors_and_a_broken_run_does_not_lead():
    alone = run_of(0.4, 1.0)
    assert widened([alone], 0, [0], ["mu0"]) is alone
    inconsistent = [run_of(0.4, 1.0, nis=3.0), run_of(0.5, 9.0, nis=3.0, broken="diverged")]
    assert leading(inconsistent) == (0, [0])
    assert leading([run_of(0.4, 1.0, nis=3.0), run_of(0.5, 9.0, nis=3.0)]) == (1, [0, 1])
    every = [replace(run, broken="diverged") for run in inconsistent]
    assert leading(every) == (0, [0])


def level(y, noise, walk):
    """Value, deviation and log likelihood of a level that walks, of which y (N,) are samples in noise."""
    x, P, likelihood = 0.0, 1.0, 0.0
    for seen in y:
        S = P + noise**2
        likelihood -= 0.5 * ((seen - x) ** 2 / S + np.log(2 * np.pi * S))
        x, P = x + P / S * (seen - x), P * noise**2 / S + walk**2
    return x, np.sqrt(P), likelihood


@pytest.mark.parametrize("true", [0.0, 0.01, *WALKS])
def test_the_band_holds_a_level_that_wanders_as_fast_as_nobody_said(true):
    rng, noise, held, constant = np.random.default_rng(1), 1.0, [], []
    for _ in range(60):
        levels = rng.normal() + np.cumsum(true * rng.normal(size=400))
        y = levels + rng.normal(0.0, noise, 400)
        walk = largest_wandering(lambda size, y=y: level(y, noise, size)[2])
        x, std, _ = level(y, noise, walk)
        held.append(abs(x - levels[-1]) < 1.96 * std)
        x, std, _ = level(y, noise, 0.0)
        constant.append(abs(x - levels[-1]) < 1.96 * std)
    assert np.mean(held) >= 0.88  # 95 % of 60 have a standard deviation of 3 %
    assert true < 0.1 or np.mean(constant) < 0.6


def test_the_largest_walk_that_is_not_rejected_is_taken_and_none_where_all_diverge():
    assert largest_wandering(lambda size: -1e4 * size) == WALKS[0]
    assert largest_wandering(lambda size: -abs(size - 0.1)) == WALKS[-1]
    assert largest_wandering(lambda size: -1e3 * abs(size - 0.1)) == 0.1
    assert largest_wandering(lambda size: -np.inf) == 0.0
    assert largest_wandering(lambda size: -np.inf if size > 0.03 else 0.0) == 0.03


def test_only_the_named_parameters_wander():
    p = [UnknownParameter(n, 0.4, 0.1, bounded((0.0, 1.0)), walk=0.5) for n in ("mu0", "k_a")]
    assert [q.walk for q in wandering(p, ["mu0"], 0.3)] == [pytest.approx(0.03), 0.5]
