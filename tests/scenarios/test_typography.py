"""Numbers as pages print them: what is said must not say more, or less, than what is known."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.drawing.typography import interval, number

numbers = st.floats(-1e9, 1e9).filter(lambda x: x == 0 or abs(x) > 1e-9)
LIFTED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def read(text):
    """A number as printed, as a number."""
    value, _, power = text.replace("−", "-").replace("\N{NO-BREAK SPACE}", " ").partition(" × 10")
    plain = "".join(value.split())
    return float(plain) * (10.0 ** int(power.translate(LIFTED)) if power else 1.0)


@given(numbers, st.floats(1e-6, 1e6))
def test_the_ends_of_an_interval_are_told_to_a_tenth_of_its_width(low, width):
    high = low + width
    if high <= low or width < 1e-9 * abs(low):
        return
    ends = [read(end) for end in interval(low, high).split(" to ")]
    assert ends == pytest.approx(
        [low, high], abs=0.0501 * 10 ** math.floor(math.log10(high - low)) + 1e-12 * abs(low)
    )
    assert ends[0] < ends[1]


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (0.997, 1.003, "0.9970 to 1.0030"),
        (1.2, 3.4, "1.2 to 3.4"),
        (-5.0, 1000.0, "-5 to 1000"),
        (0, 0, "0 to 0"),
    ],
)
def test_an_interval_reads_so(low, high, text):
    assert interval(low, high).replace("\N{NO-BREAK SPACE}", " ").replace("−", "-") == text


@given(numbers)
def test_a_number_is_printed_to_its_digits(x):
    assert read(number(x, 4)) == pytest.approx(x, rel=5.001e-4)
