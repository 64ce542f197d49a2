"""Formulas over signals: numbers as numpy's, known signals as mathematics says, and no other code."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.errors import BadInput
from scenarios.simulating.expression import expression, in_formula, statement
from scenarios.simulating.value import Value

T = np.linspace(0.0, 10.0, 10001)
SIGNALS = {
    "a.x": Value(np.exp(-0.3 * T) * np.sin(2 * np.pi * 1.5 * T), T, "m"),
    "a.v": Value(np.cos(T), T, "m/s"),
    "a.ramp": Value(2 * T - 3, T, "m"),
    "a.F": Value(np.full(T.size, 4.0), T, "N"),
    "b.x": Value(np.array([0.0, 1.0, 4.0]), np.array([0.0, 1.0, 2.0]), "m"),
    "c.even": Value(np.array([4.0, 1.0, 0.0, 1.0, 4.0]), np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), "m"),
    "c.odd": Value(np.array([-4.0, -1.0, 0.0, 1.0, 4.0]), np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), "m"),
}


def value(text):
    return expression(text, "here").value(SIGNALS.__getitem__)


def holds(text):
    return statement(text, "here").verdict(SIGNALS.__getitem__)


finite = st.floats(-1e3, 1e3).map(lambda x: round(x, 6))


@given(finite, finite, finite.filter(lambda x: abs(x) > 1e-3))
def test_numbers_are_python_s(a, b, c):
    text = f"({a}) + ({b}) * ({a}) - ({b}) / ({c}) + abs({c}) ** 2"
    assert value(text).number() == pytest.approx(a + b * a - b / c + abs(c) ** 2, rel=1e-12, abs=1e-9)


def test_signals_are_joined_sample_by_sample():
    found = value("sqrt(a.x ** 2 + (a.ramp - 1) ** 2) * a.F")
    x, ramp = SIGNALS["a.x"].y, SIGNALS["a.ramp"].y
    np.testing.assert_allclose(found.y, np.hypot(x, ramp - 1) * 4)
    np.testing.assert_array_equal(found.x, T)


NUMBERS = [
    ("max(a.ramp)", 17.0),
    ("min(a.ramp)", -3.0),
    ("max(max(a.ramp), 20)", 20.0),
    ("first(a.ramp)", -3.0),
    ("last(a.ramp)", 17.0),
    ("span(a.ramp)", 20.0),
    ("mean(a.ramp)", 7.0),
    ("std(a.F)", 0.0),
    ("rms(-a.F)", 4.0),
    ("at(a.ramp, 1.00025)", -0.9995),
    ("first(after(a.ramp, 2))", 1.0),
    ("last(before(a.ramp, 2))", 0.998),
    ("count(between(a.ramp, 2, 3))", 1001.0),
    ("crossing(a.ramp, 0)", 1.5),
    ("crossing(a.ramp, 0.0005)", 1.50025),
    ("settled(a.ramp, 17, 1)", 9.5),
    ("settled(a.F, 4, 1)", 0.0),
    ("integral(a.F)", 40.0),
    ("mean(derivative(a.ramp))", 2.0),
    ("max(steps(a.ramp))", 0.002),
    ("last(axis(a.F))", 10.0),
    ("frequency(a.x)", 1.5),
    ("growth(a.x)", -0.3),
    ("max(abs(mirrored(c.odd) + c.odd))", 0.0),
    ("max(abs(mirrored(c.even) - c.even))", 0.0),
    ("max(shifted(a.ramp, 2) - a.ramp)", 0.0),
    ("at(shifted(a.ramp, 2), 5)", 3.0),
    ("at(shifted(a.ramp, 2), 1)", -3.0),
    ("last(on(a.ramp, b.x))", 1.0),
    ("count(peaks(a.x))", 30.0),
    ("2 * pi", 2 * math.pi),
]


@pytest.mark.parametrize(("text", "expected"), NUMBERS)
def test_functions_on_signals_whose_answer_is_known(text, expected):
    assert value(text).number() == pytest.approx(expected, rel=1e-4, abs=1e-9)


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1))
def test_any_name_of_a_variable_can_stand_in_a_formula(variable):
    name = f"a.{variable}"
    formula = statement(f"max(abs({in_formula(name)})) < 3 and 1 < last({in_formula(name)})", "here")
    assert formula.names == (name,)
    signal = Value(np.array([0.0, 2.0]), np.array([0.0, 1.0]), "m")
    assert formula.verdict({name: signal}.__getitem__).holds


@pytest.mark.parametrize("text", ['"a.x" < 1', '2 * "a.x" < 1'])
def test_a_name_in_quotes_is_a_signal_as_one_without(text):
    with pytest.raises(BadInput, match="is a signal; compare its max"):
        statement(text, "here")


def test_a_cone_has_its_own_conicity():
    y = np.linspace(-0.01, 0.01, 401)
    cone = Value(2 * 0.05 * y, y, "m")
    found = expression("conicity(contact.dr, 4e-3)", "here").value({"contact.dr": cone}.__getitem__)
    assert found.number() == pytest.approx(0.05, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("a.x", "m"),
        ("a.x - a.ramp", "m"),
        ("2 * a.x + 1", "m"),
        ("a.x + a.F", None),
        ("a.F * a.v", "(N)*(m/s)"),
        ("a.x / a.ramp", "1"),
        ("a.F / a.v", "(N)/(m/s)"),
        ("a.x ** 2", "(m)*(m)"),
        ("max(abs(a.F))", "N"),
        ("derivative(a.x)", "(m)/s"),
        ("integral(a.F)", "(N)*(s)"),
        ("sin(a.x)", "1"),
    ],
)
def test_units_follow_the_formula(text, unit):
    assert value(text).unit == unit


@pytest.mark.parametrize(
    ("text", "holds_", "values"),
    [
        ("1 < 2", True, (1, 2)),
        ("1 < 2 <= 2 < 2", False, (1, 2, 2, 2)),
        ("1 > 2 or 3 > 2", True, (1, 2, 3, 2)),
        ("1 > 2 and 3 > 2", False, (1, 2, 3, 2)),
        ("not 1 > 2", True, (1, 2)),
        ("max(a.ramp) <= 17", True, (17, 17)),
        ("crossing(a.ramp, 100) > 0", False, (math.nan, 0)),
        ("crossing(a.ramp, 100) < 0", False, (math.nan, 0)),
    ],
)
def test_statements_hold_or_not_and_show_their_numbers(text, holds_, values):
    found = holds(text)
    assert found.holds is holds_
    np.testing.assert_array_equal(found.values, values)


GONE = 5.0  # s, from when on these are not finite
BROKEN = SIGNALS | {
    f"{name}.q": Value(np.where(T < GONE, np.sin(7 * T), bad), T, "m")
    for name, bad in (("nan", math.nan), ("up", math.inf), ("down", -math.inf))
}
# about a signal q: what is worked out from all of its samples
OVER_ALL = [
    "max(abs(q))",
    "min(q)",
    "max(q)",
    "max(min(q, 1))",
    "max(max(q, -1))",
    "mean(q)",
    "std(q)",
    "rms(q)",
    "span(q)",
    "last(q)",
    "integral(q)",
    "crossing(q, 0.5)",
    "settled(q, 0, 2)",
    "growth(q)",
    "frequency(q)",
    "count(q)",
    "count(peaks(q))",
    "max(tanh(q))",
    "max(q ** 0)",
    "max(abs(0 / q))",
    "max(exp(-abs(q)))",
    "max(derivative(q))",
    "max(steps(q))",
    "max(shifted(q, 1))",
    "max(on(q, a.x))",
    "at(q, 7)",
    "rms(q - a.x)",
    "max(after(q, 1))",
    "min(max(q), 3)",
    "first(q) + 0 * last(q)",
]
STATEMENTS = [
    "{} > 0.1",
    "{} < 0.1",
    "not ({} > 0.1)",
    "not {} < 0.1",
    "not not {} <= 100",
    "0 < {} < 100",
    "not (0 < {} < 100)",
    "{} < 100 and 1 < 2",
    "{} < 100 or 1 < 2",
    "1 < 2 or {} < 100",
    "not ({} < 100 and 2 < 1)",
    "not (2 < 1 or {} > 100)",
]


@pytest.mark.parametrize("form", STATEMENTS)
@pytest.mark.parametrize("side", OVER_ALL)
def test_neither_a_statement_over_what_is_not_finite_nor_its_negation_holds(form, side):
    for name in ("nan", "up", "down"):
        text = form.format(side.replace("q", f"{name}.q").replace(f"fre{name}.quency", "frequency"))
        found = statement(text, "here").verdict(BROKEN.__getitem__)
        assert found.holds is False, text
        assert found.problem is not None, text
        assert f"signal '{name}.q' is not finite from t = 5 s on" in found.problem


@pytest.mark.parametrize(
    "text",
    ["max(before(nan.q, 5)) < 1.1", "first(nan.q) < 1", "at(nan.q, 2) < 1", "last(between(nan.q, 1, 2)) < 1"],
)
def test_what_is_asked_of_the_finite_part_is_answered(text):
    found = statement(text, "here").verdict(BROKEN.__getitem__)
    assert found.holds
    assert found.problem is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("not crossing(a.ramp, 100) < 1", "'crossing(a.ramp, 100)' is not finite"),
        ("not max(a.F / (a.ramp - a.ramp)) < 1", "'max(a.F / (a.ramp - a.ramp))' is not finite"),
        ("not settled(a.F, 4, 1 / 0) > 1", "is not finite"),
        ("not max(a.F ** (1 / 0)) < 1", "is not finite"),
        (
            "not last(axis(b.x)) * max(nan.q) < 1",
            "'last(axis(b.x)) * max(nan.q)' is not finite; signal 'nan.q'",
        ),
    ],
)
def test_a_number_that_is_not_finite_is_named(text, words):
    found = statement(text, "here").verdict(BROKEN.__getitem__)
    assert not found.holds
    assert words in (found.problem or "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("count(after(a.x, crossing(nan.q, 0.5))) < 1", "is cut at nan, which is not finite; signal 'nan.q'"),
        ("not count(before(a.x, crossing(a.ramp, 100))) > 1", "is cut at nan"),
        ("count(between(a.x, 1, 1 / 0)) > 1", "is cut at 1, inf"),
        ("first(shifted(a.x, 1 / 0)) < 1", "has a delay of inf"),
    ],
)
def test_a_place_that_is_not_finite_is_no_answer(text, words):
    with pytest.raises(BadInput, match=r"^here: ") as refused:
        statement(text, "here").verdict(BROKEN.__getitem__)
    assert words in str(refused.value)


def test_a_contact_table_has_its_shift_for_a_place():
    table = {"contact.r": Value(np.array([1.0, math.nan]), np.array([0.0, 0.01]), "m")}
    found = statement("not max(contact.r) > 2", "here").verdict(table.__getitem__)
    assert not found.holds
    assert "signal 'contact.r' is not finite from y = 0.01 m on" in (found.problem or "")


REFUSED = [
    ("__import__('os').system('true') < 1", "may not stand in a formula"),
    ("(lambda: 1)() < 1", "may not stand"),
    ("[x for x in a.x] < 1", "may not stand"),
    ("a.x[0] < 1", "may not stand"),
    ("open('x') < 1", "function 'open' is not known"),
    ("a.x.max() < 1", "may not stand"),
    ("max(a.x, key=1) < 1", "may not stand"),
    ("'text' < 1", "may not stand"),
    ("True < 1", "may not stand"),
    ("1 == 1", "compares nothing"),
    ("max(a.x)", "compares nothing"),
    ("a.x < 1", "'a.x' is a signal; compare its max, rms, last"),
    ("abs(a.x) - 1 < 1", "is a signal"),
    ("max(a.x, a.v) < 1", "is a signal"),
    ("maximum(a.x) < 1", "function 'maximum' is not known; did you mean 'max'?"),
    ("at(a.x) < 1", "'at' takes 2 arguments, not 1"),
    ("max(a.x < 1", "is not a formula"),
    ("1 < 2 == 2", "compares nothing"),
]


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_nothing_but_formulas_is_run(text, words):
    with pytest.raises(BadInput, match=r"^here: ") as refused:
        statement(text, "here")
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


UNANSWERED = [
    ("at(a.x, 11) < 1", "reaches from 0 to 10, and 11 is outside"),
    ("max(a.x + b.x) < 1", "different times"),
    ("growth(b.x) < 1", "0 peaks; a growth needs three"),
    ("frequency(b.x) < 1", "less than three times"),
    ("max(after(a.x, 11)) < 1", "without samples"),
    ("max(mirrored(a.x)) < 1", "symmetric about 0"),
    ("conicity(a.ramp, 0.1) < 1", "conicity"),
    ("rms(1) < 1", "takes a signal"),
    ("last(shifted(a.x, a.v)) < 1", "needs a number, not a signal"),
]


@pytest.mark.parametrize(("text", "words"), UNANSWERED)
def test_what_signals_do_not_allow_is_said(text, words):
    with pytest.raises(BadInput, match=r"^here: ") as refused:
        holds(text)
    assert words in str(refused.value)
