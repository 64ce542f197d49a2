"""Unit strings of the contract: SI exponents, conversion, and what must be refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.errors import BadInput
from fmus.units import (
    COMMON,
    base_exponents,
    conversion,
    to_si,
)

KINDS = [
    ["rad/s", "rpm", "deg/s", "mrad/s", "rad.s-1"],
    ["m/s", "km/h", "mm/s", "mph", "m.s-1"],
    ["m", "mm", "µm", "km"],
    ["m/s2", "g_0", "mm/s2", "m/s^2"],
    ["Hz", "1/min", "kHz", "1/s"],
    ["N.m", "kN.m", "J"],
    ["degC", "K"],
]


@pytest.mark.parametrize(
    ("unit", "exponents", "factor"),
    [
        ("rad/s", {"rad": 1, "s": -1}, 1.0),
        ("kg.m2", {"kg": 1, "m": 2}, 1.0),
        ("N.m", {"kg": 1, "m": 2, "s": -2}, 1.0),
        ("N.s/m", {"kg": 1, "s": -1}, 1.0),
        ("m/s2", {"m": 1, "s": -2}, 1.0),
        ("1/min", {"s": -1}, 1 / 60),
        ("rpm", {"rad": 1, "s": -1}, math.pi / 30),
        ("mm", {"m": 1}, 1e-3),
        ("km/h", {"m": 1, "s": -1}, 1 / 3.6),
        ("V", {"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
        ("Ohm", {"kg": 1, "m": 2, "s": -3, "A": -2}, 1.0),
        ("Hz", {"s": -1}, 1.0),
        ("1", {}, 1.0),
        ("N.m.s/rad", {"kg": 1, "m": 2, "s": -1, "rad": -1}, 1.0),
        ("N.m/(rad/s)", {"kg": 1, "m": 2, "s": -1, "rad": -1}, 1.0),
        ("m²", {"m": 2}, 1.0),
    ],
)
def test_contract_units_in_si(unit, exponents, factor):
    base = base_exponents(unit)
    assert base.exponents == exponents
    assert_allclose(base.factor, factor, rtol=1e-14)
    assert base.offset == 0


def test_temperature_has_an_offset():
    assert base_exponents("degC") == ({"K": 1}, 1.0, 273.15)
    assert_allclose(to_si([0.0, 20.0], "degC", "K", "here"), [273.15, 293.15])


@pytest.mark.parametrize("unit", COMMON.split())
def test_every_unit_offered_is_understood(unit):
    assert base_exponents(unit).factor > 0


@given(st.sampled_from(KINDS).flatmap(lambda k: st.tuples(*[st.sampled_from(k)] * 2)), st.floats(-1e6, 1e6))
def test_there_and_back_is_the_same_value(pair, value):
    there = to_si([value], pair[0], pair[1], "here")
    # 1e-9: a difference of two temperatures loses digits, the rest is good to 1e-15
    assert_allclose(to_si(there, pair[1], pair[0], "here"), [value], rtol=1e-12, atol=1e-9)


@given(st.floats(allow_nan=False))
def test_the_same_name_changes_nothing_even_if_nobody_knows_it(value):
    assert to_si([value], "ticks", "ticks", "here")[0] == value


def test_shape_is_kept():
    assert to_si(np.ones((3, 2)), "mm", "m", "here").shape == (3, 2)


@pytest.mark.parametrize(
    ("unit", "target"), [("1/s", "rad/s"), ("rad/s", "1/s"), ("N.m.s", "N.m.s/rad"), ("1", "rad")]
)
def test_a_radian_left_out_is_forgiven(unit, target):
    assert conversion(unit, target, "here") == (1.0, 0.0)


@pytest.mark.parametrize(
    ("unit", "target", "words"),
    [
        ("Hz", "rad/s", ["'Hz' does not fit 'rad/s'", "2 pi"]),
        ("rad/s", "Hz", ["2 pi"]),
        ("1/min", "rad/s", ["2 pi", "'rpm'"]),
        ("rpm", "1/s", ["2 pi"]),
        ("rad.s", "s/rad", ["other side"]),
        ("m", "N", ["'m' does not fit 'N'", "same kind"]),
        ("g", "m/s2", ["'g_0'"]),
        ("Nm", "N.m", ["'Nm' is not known", "did you mean 'N.m'?"]),
        ("kmh", "m/s", ["did you mean 'km/h'?"]),
        ("rads", "rad/s", ["did you mean 'rad/s'?"]),
        ("", "m", ["unit '' is not known"]),
        ("m**x", "m", ["'m**x' is not known"]),
        ("(m", "m", ["'(m' is not known"]),
        ("m/0", "m", ["'m/0' is not known"]),
        ("m s", "m", ["'m s' is not known"]),
        ("m0.5", "m", ["'m0.5' is not known"]),
        ("1**9999999", "m", ["is not known"]),
        ("m", "ticks", ["the FMU's unit 'ticks'", 'unit = "ticks"']),
    ],
)
def test_bad_units_are_refused_in_one_sentence(unit, target, words):
    with pytest.raises(BadInput) as refused:
        to_si([1.0], unit, target, "a.toml: [outputs.x]")
    message = str(refused.value)
    assert message.startswith("a.toml: [outputs.x]: ")
    assert "\n" not in message
    for word in words:
        assert word in message


@given(st.text(max_size=12))
def test_any_text_is_a_unit_or_bad_input(text):
    try:
        base = base_exponents(text)
    except BadInput:
        return
    assert math.isfinite(base.offset)
    assert set(base.exponents) <= {"kg", "m", "s", "A", "K", "mol", "cd", "rad"}
