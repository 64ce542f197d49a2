"""What the form of a model leaves open in `railfmi estimate`, on plants whose contact has another form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from estimator.filters.history import History
from fmus.models import model_class
from scenarios.estimating.estimating import estimate
from scenarios.estimating.form import choices, leading, parameters_of_form, widened
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


def test_friction_with_another_contact_is_near_the_truth_and_its_doubt_is_said(tmp_path):
    result = estimate(other_contact(tmp_path, 3, 20.0))
    mu0 = result.estimated["mu0"]
    assert abs(mu0["value"] - 0.5) < 0.05
    assert abs(mu0["value"] - 0.5) < 2.6 * mu0["std_error"] or not result.consistent
    kinds = {name: e["kind"] for name, e in result.estimated.items()}
    assert {name for name, kind in kinds.items() if kind == "form"} == set(model_class("wheelset").form)
    assert any("patch = 1" in note for note in result.notes)


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
