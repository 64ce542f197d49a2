"""Words of the report: units that an experiment declares, remarks on formulas, the meaning of each check."""

from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
from matplotlib import pyplot

from estimator.closeloop.evidence import Check, Name
from estimator.record import Conversion
from scenarios.closing.figures.channels import draw_residual
from scenarios.closing.page.case import Case
from scenarios.closing.page.checks import MEANINGS, decided
from scenarios.closing.page.glossary import glossary
from scenarios.closing.page.sections import remark_words
from scenarios.closing.page.wording import story
from tests.helpers.experiment_files import variable


def test_every_check_has_a_meaning_and_a_side_of_its_limit():
    assert set(MEANINGS) == set(get_args(Name))
    row = decided(Check("the residual is more than noise", 0.006, 0.01, True))
    assert (row["limit"], row["passed"]) == ("below 0.0100", "yes")
    assert decided(Check.least("the size is clear of zero", np.inf, 4.0))["value"] == "without limit"


@pytest.mark.parametrize("name", get_args(Name))
def test_a_check_that_is_passed_stands_on_the_side_that_is_said(name):
    """Least and most in words are those of the constructors."""
    relation, _ = MEANINGS[name]
    above = relation in ("at least", "above")
    made = Check.least(name, 2.0, 1.0) if above else Check.most(name, 0.5, 1.0)
    assert made.passed


def test_the_report_has_the_units_that_an_experiment_declares(monkeypatch):
    known = {"omega": variable("omega", "output", None), "i": variable("i", "output", "A")}
    monkeypatch.setattr(
        "scenarios.closing.page.glossary.describe", lambda _: SimpleNamespace(variables=known)
    )
    conversions = [Conversion("omega", "speed", "rpm", "rad/s", 0.1, 0.0)]
    conversions += [Conversion("i", "current", "mA", "kA", 1e-6, 0.0)]
    problem = SimpleNamespace(fmu=None, effects=(), record=SimpleNamespace(conversions=conversions))
    words = glossary(problem, [])
    assert words.unit("omega") == "rad/s"
    assert words.unit("i") == "A"  # what the FMU says has the last word


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("v_s rounds the step at zero velocity", "<var>v</var><sub>s</sub> rounds the step at zero velocity"),
        ("resists motion where F_0 > 0", "Resists motion where <var>F</var><sub>0</sub> &gt; 0"),
        ("what a spring of stiffness k lacks", "What a spring of stiffness <var>k</var> lacks"),
        ("", ""),
    ],
)  # fmt: skip
def test_a_remark_shows_the_symbols_of_its_formula(text, expected):
    assert str(remark_words(text)) == expected


@pytest.mark.parametrize("spike", [0.0, 40.0, -40.0])
def test_a_single_sample_does_not_squeeze_a_residual(spike):
    t = np.linspace(0.0, 10.0, 2000)
    r = np.sin(t)[:, None]
    r[0] = spike
    run = SimpleNamespace(t=t, test=np.zeros(t.size, bool))
    figure, ax = pyplot.subplots()
    draw_residual(ax, SimpleNamespace(runs=[run]), [("after", SimpleNamespace(residuals=[r]), "k")], 0, 0.1)
    low, high = ax.get_ylim()
    assert -2.0 < low < -1.0
    assert 1.0 < high < 2.0
    said = [text.get_text() for text in ax.texts]
    assert said == ([f"single samples reach {spike:.2g}"] if spike else [])
    pyplot.close(figure)


@pytest.mark.parametrize("fitted", [False, True])
def test_no_discrepancy_is_told_apart_from_effects_that_were_fitted_in_vain(fitted: bool) -> None:
    found = SimpleNamespace(singles=[object()] * fitted, pairs=[], detection=SimpleNamespace(detected=True))
    result = SimpleNamespace(verdict="no_discrepancy", reason="no effect accounts for the residual")
    told = story(Case(SimpleNamespace(), found, result, SimpleNamespace()))
    said = f"{told.headline} {told.lead} {told.law}"
    assert ("Effects were fitted" in said) is fitted
    assert ("No effect accounts for the residual." in said) is fitted
    assert ("No effect was fitted" in said) is not fitted
    assert ("too small to matter" in said) is not fitted
