"""Probabilities in words: nothing is said to be certain, and what is left is said."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.closing.lines import lines_of, probable
from scenarios.closing.page.rejected import probable_rows
from scenarios.closing.result import Result
from scenarios.drawing.typography import chance


@pytest.mark.parametrize(
    ("p", "said"),
    [
        (0.0, "below 0.1 %"),
        (0.0123, "1.2 %"),
        (0.5, "50 %"),
        (0.9975, "99.8 %"),
        (0.9996, "above 99.9 %"),
        (1.0, "above 99.9 %"),
    ],
)
def test_a_share_is_said_to_a_tenth_of_a_percent(p, said):
    assert chance(p) == said


@given(st.floats(0.0, 1.0))
def test_no_probability_is_said_to_be_certain(p):
    assert chance(p) not in ("0 %", "100 %")


def test_the_most_probable_answers_are_said_with_what_is_left():
    said = probable({"viscous_damping@wheel": 0.6, "viscous_damping@roller": 0.3})
    assert said == "probability: viscous damping@wheel 60 %, viscous damping@roller 30 %, none of these 10 %"
    many = probable({f"a@{i}": 0.1 for i in range(9)})
    assert many.count("a@") == 3


def test_the_page_says_what_the_line_says_in_words():
    rows = list(probable_rows({"actuator_lag@T_P + viscous_damping@wheel": 0.8, "no_discrepancy": 0.1}))
    assert rows == [
        ("actuator lag at T_P and viscous damping at wheel", "80 %"),
        ("no discrepancy", "10 %"),
        ("none of these", "10 %"),
    ]
    assert list(probable_rows({})) == [("none of these", "above 99.9 %")]


@pytest.mark.parametrize(
    ("verdict", "said", "line"),
    [
        ("unexplained", {}, "  probability: none of these above 99.9 %"),
        ("no_discrepancy", {"no_discrepancy": 0.9}, "  probability: no discrepancy 90 %, none of these 10 %"),
        ("sensor_fault", {}, None),  # a dead sensor: nothing was compared
    ],
)
def test_that_nothing_of_the_library_is_probable_is_said_too(verdict, said, line):
    result = Result("a", verdict, [], "", [], [], {}, {}, 1.0, "", "", {}, {}, probability=said)
    assert [x for x in lines_of(result) if "probability" in x] == ([] if line is None else [line])
