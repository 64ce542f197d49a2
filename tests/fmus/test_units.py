"""Unit strings of the contract: SI exponents, conversion, and what must be refused."""

import math

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.errors import BadInput
from fmus.units import (
    COMMON,
    SPELLINGS,
    UNITS,
    another_kind,
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


# factors to SI, and prefixes, by BIPM, The International System of Units, and NIST SP 811 (customary units)
SI = {
    "m": 1, "s": 1, "g": 1e-3, "A": 1, "K": 1, "mol": 1, "cd": 1, "rad": 1, "Hz": 1, "N": 1, "Pa": 1, "J": 1,
    "W": 1, "V": 1, "F": 1, "Ohm": 1, "Ω": 1, "S": 1, "Wb": 1, "T": 1, "H": 1, "bar": 1e5, "L": 1e-3,
    "l": 1e-3, "%": 1e-2, "deg": math.pi / 180, "°": math.pi / 180, "turn": 2 * math.pi, "rpm": math.pi / 30,
    "min": 60, "h": 3600, "d": 86400, "t": 1e3, "degC": 1, "g_0": 9.80665, "in": 0.0254, "ft": 0.3048,
    "mph": 0.44704, "lb": 0.45359237, "lbf": 4.4482216152605, "psi": 6894.757293168, "degF": 5 / 9,
}  # fmt: skip
PREFIXES = {
    "p": 1e-12, "n": 1e-9, "u": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "da": 1e1, "h": 1e2,
    "k": 1e3, "M": 1e6, "G": 1e9,
}  # fmt: skip
IN_USE = (
    "kN MN daN mN mm km µm cm nm kg mg t GPa MPa kPa hPa mbar bar kW MW mW mV kV µV mA kA kHz MHz GHz ms µs "
    "ns mrad µrad mmol kmol kOhm MOhm mOhm mT µT µF nF pF mH µH mS kJ MJ mK l L ml mL"
)


PINT = pint.UnitRegistry()
WORDS = "Grad Gs Gm Mm Ms Ks ks MA GT Gg cs ds cg dg MRad Mrad krad MT kt mt mh mmin cN/s.Grad"


@given(st.sampled_from(UNITS))
def test_every_unit_has_the_factor_of_the_tables_and_of_pint(unit):
    whole = (f * SI[unit.removeprefix(p)] for p, f in PREFIXES.items() if unit.removeprefix(p) in SI)
    found = base_exponents(unit).factor
    assert_allclose(found, SI.get(unit) or next(whole), rtol=1e-12)
    zero, one = PINT.Quantity(np.array([0.0, 1.0]), unit.replace("Ohm", "ohm")).to_base_units().magnitude
    assert_allclose(found, one - zero, rtol=1e-12)


@pytest.mark.parametrize("unit", IN_USE.split())
def test_what_engineers_write_is_known(unit):
    assert base_exponents(unit).factor > 0


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("km/hr", "km/h"), ("kmph", "km/h"), ("m/sec", "m/s"), ("deg/sec", "deg/s"), ("N-m", "N.m"),
        ("Nmm", "N.mm"), ("hours", "h"), ("days", "d"), ("rps", "turn/s"), ("C", "degC"), ("Sec", "s"),
    ],
)  # fmt: skip
def test_spellings_of_loggers_are_those_of_units(word, meant):
    assert SPELLINGS[word] == meant
    assert base_exponents(meant).factor > 0


@pytest.mark.parametrize("word", WORDS.split())
def test_no_prefix_makes_a_unit_of_a_word(word):
    """A prefix that nobody writes before a unit is a letter of a word, such as the German 'Grad'."""
    with pytest.raises(BadInput, match="is not known"):
        base_exponents(word)


@pytest.mark.parametrize(
    ("unit", "plain"),
    [
        ("µm", "um"), ("μm", "um"), ("N⋅m", "N.m"), ("N·m", "N.m"), ("m·s⁻¹", "m/s"), ("min⁻¹", "1/min"),
        ("rad/s²", "rad/s2"), ("kΩ", "kOhm"), ("k\u2126", "kOhm"), ("㎜", "mm"), ("㎨", "m/s2"),
        ("s\u22121", "1/s"), ("l/min", "L/min"),
    ],
)  # fmt: skip
def test_characters_that_look_alike_are_alike(unit, plain):
    assert conversion(unit, plain, "here") == (1.0, 0.0)


@pytest.mark.parametrize(
    "word", sorted({*SPELLINGS} - {"1/min", "min-1"})
)  # that are known but count no turns
def test_a_usual_word_is_offered_what_it_means(word):
    with pytest.raises(BadInput, match=f"did you mean '{SPELLINGS[word]}'"):
        base_exponents(word)
    assert base_exponents(SPELLINGS[word]).factor > 0


def test_kinds_are_apart_whatever_the_radian_does():
    assert another_kind("g", "m/s2")
    assert another_kind("min", "rpm")
    assert another_kind("1", "m")
    assert not another_kind("kN", "N")
    assert not another_kind("Hz", "rad/s")
    assert not another_kind("Kästchen", "m")
    assert not another_kind("m", "Kästchen")


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
