"""What holds for every sensor fault."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from estimator.sensor_faults import FAULTS, faulty
from fmus.units import base_exponents

T = 3.0 + np.linspace(0.0, 10.0, 2001)
Y = 0.3 + np.sin(2.0 * T)


@pytest.fixture(params=FAULTS)
def fault(request):
    return FAULTS[request.param]


def size(fault):
    return fault.size(float(np.std(Y)), float(T[-1] - T[0]), float(T[1] - T[0]))


def test_zero_is_off(fault):
    assert np.array_equal(fault.apply(Y, T, 0.0), Y)


def test_a_realistic_size_shows_and_a_part_of_it_in_proportion(fault):
    kept = Y.copy()
    change, part = (fault.apply(Y, T, share * size(fault)) - Y for share in (1.0, 0.1))
    assert np.array_equal(kept, Y)
    assert np.std(change) + abs(np.mean(change)) > 1e-3 * np.std(Y)
    # a late channel begins with its first value; 5 %: what a fault may depart from its first order
    assert_allclose(10 * part[10:], change[10:], atol=0.05 * np.abs(change).max())


def test_its_bounds_hold_zero_and_a_realistic_size(fault):
    assert fault.low <= 0.0 < size(fault) < fault.high


def test_it_acts_on_its_own_output_alone(fault):
    shown = faulty(np.column_stack([Y, Y]), T, ("a", "b"), {fault.name_at("b"): size(fault)})
    assert np.array_equal(shown[:, 0], Y)
    assert np.array_equal(shown[:, 1], fault.apply(Y, T, size(fault)))


def test_its_size_has_a_unit_of_the_output(fault):
    assert base_exponents(fault.unit.format("rad/s")).factor == 1.0  # SI


def test_it_says_what_causes_it_and_how_it_shows(fault):
    assert "In data: " in sys.modules[type(fault).__module__].__doc__
