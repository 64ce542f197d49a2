"""The free motion of a wheelset between turning points that are both free, against its integration."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from fmus.contact import (
    contact_table,
    equivalent_conicity,
    harmonic_conicity,
    linear_conicity,
    nonlinearity_parameter,
)
from fmus.contact.geometry.conicity import turning_points
from fmus.contact.geometry.motion import NOTHING

S, R0 = 0.75, 0.46  # m
Y = np.linspace(-0.010, 0.010, 401)


def table_of(dr, y=Y):
    return pd.DataFrame({"r_left": R0 + dr / 2, "r_right": R0 - dr / 2}, index=y)


def released(table, start):
    """Half wave and the other turning point, m, of y'' = -dr/(2 s r0) released at a shift, integrated."""
    y, dr = table.index.to_numpy(), (table["r_left"] - table["r_right"]).to_numpy()

    def motion(_, x):
        return [x[1], -np.interp(x[0], y, dr) / (2 * S * R0)]

    def turns(_, x):
        return x[1]

    turns.terminal, turns.direction = True, 1
    found = solve_ivp(motion, (0, 400), [start, -1e-12], events=turns, rtol=1e-9, atol=1e-13, max_step=0.05)
    return found.t_events[0][0], found.y_events[0][0][0]


slopes = st.lists(st.floats(0.01, 1.0), min_size=8, max_size=8)


@settings(max_examples=12)
@given(slopes, st.floats(-0.003, 0.003), st.floats(1e-3, 5e-3))
def test_unsymmetric_difference_has_the_wave_of_its_integrated_motion(slopes, centre, amplitude):
    knots = np.linspace(-0.010, 0.010, 9)
    rising = np.append(0.0, np.cumsum(np.diff(knots) * slopes))
    dr = np.interp(Y, knots, rising) - np.interp(centre, knots, rising)
    table = table_of(dr)
    low, high = turning_points(table, amplitude)
    assert_allclose(high - low, 2 * amplitude, rtol=1e-12)
    half, turned = released(table, high)
    assert_allclose(turned, low, atol=2e-8)
    assert_allclose(equivalent_conicity(table, amplitude), (np.pi / half) ** 2 * S * R0, rtol=2e-4)


@settings(max_examples=20)
@given(st.floats(0.01, 0.5), st.floats(-2e-3, 2e-3), st.floats(1e-3, 4e-3))
def test_unlike_diameters_move_the_middle_and_leave_the_wave(conicity, more, amplitude):
    table = table_of(2 * conicity * Y + 2 * conicity * more)
    assert_allclose(equivalent_conicity(table, amplitude), conicity, rtol=1e-6)
    levelled = NOTHING * (Y[1] - Y[0]) / (4 * conicity * amplitude)  # a dr below NOTHING is none
    assert_allclose(np.mean(turning_points(table, amplitude)), -more, rtol=0, atol=1e-12 + levelled)
    for form in (linear_conicity, harmonic_conicity):
        assert_allclose(form(table, amplitude), conicity, rtol=1e-9)


@settings(max_examples=20)
@given(slopes, st.floats(1e-3, 6e-3))
def test_the_mirrored_wheelset_has_the_same_wave(slopes, amplitude):
    knots = np.linspace(-0.010, 0.010, 9)
    dr = np.interp(Y, knots, np.append(0.0, np.cumsum(np.diff(knots) * slopes)))
    dr -= dr[200]
    table, mirrored = table_of(dr), table_of(-dr[::-1])
    for form in (equivalent_conicity, linear_conicity, harmonic_conicity):
        assert_allclose(form(table, amplitude), form(mirrored, amplitude), rtol=1e-7)


def test_a_switched_difference_has_the_wave_of_two_parabolas():
    """dr = c sign(y - y0), as at a jump from tread to flange: each quarter wave is sqrt(4 s r0 a/c)."""
    c, y0 = 2e-3, 1.3e-3
    fine = np.unique(np.append(Y, [y0 - 1e-9, y0 + 1e-9]))
    table = table_of(np.where(fine > y0, c, -c), fine)
    for amplitude in (1e-3, 4e-3):
        wave = 4 * np.sqrt(4 * S * R0 * amplitude / c)
        found = equivalent_conicity(table, amplitude)
        assert_allclose(found, (2 * np.pi / wave) ** 2 * S * R0, rtol=1e-5)
        assert_allclose(np.mean(turning_points(table, amplitude)), y0, atol=1e-8)


@settings(max_examples=20)
@given(st.floats(1e-3, 3e-3), st.floats(0.05, 0.3))
def test_a_cylinder_between_flanges(half, conicity):
    """No difference within +- half: straight on with no wave; beyond, time is lost on the straight part."""
    fine = np.unique(np.append(Y, [-half, half]))
    dr = 2 * conicity * np.sign(fine) * np.maximum(np.abs(fine) - half, 0)
    table = table_of(dr, fine)
    assert equivalent_conicity(table, 0.99 * half) == 0.0
    amplitude = half + 2e-3
    # quarter of a sinusoid, and the straight part at the sinusoid's greatest slope
    quarter = (np.pi / 2 + half / (amplitude - half)) / np.sqrt(conicity)
    assert_allclose(equivalent_conicity(table, amplitude), (np.pi / 2 / quarter) ** 2, rtol=1e-5)


def test_a_rounding_error_of_the_search_is_no_difference():
    table = table_of(1e-13 * np.sin(1e5 * Y))
    assert equivalent_conicity(table, 3e-3) == 0.0


@settings(max_examples=20)
@given(st.floats(0.02, 0.3), st.floats(0.1, 10.0), st.floats(1e-3, 8e-3))
def test_forms_of_a_cubic_difference(conicity, growth, amplitude):
    fine = np.linspace(-0.010, 0.010, 4001)
    table = table_of(2 * conicity * fine * (1 + growth * (fine / 0.010) ** 2), fine)
    e = growth * (amplitude / 0.010) ** 2
    # means of y^4 over those of y^2: 3/5 where all shifts weigh alike, 3/4 of a sinusoid
    assert_allclose(linear_conicity(table, amplitude), conicity * (1 + 3 / 5 * e), rtol=1e-5)
    assert_allclose(harmonic_conicity(table, amplitude), conicity * (1 + 3 / 4 * e), rtol=1e-5)
    assert_allclose(harmonic_conicity(table, amplitude), equivalent_conicity(table, amplitude), rtol=0.05)


def test_two_stable_positions():
    """A difference that falls in the middle: small motions swing about a side, large ones over it."""
    table = table_of(0.2 * Y * ((Y / 4e-3) ** 2 - 1))
    low, high = turning_points(table, 1e-3)
    assert low * high > 0
    assert abs((low + high) / 2) == pytest.approx(4e-3, abs=3e-4)
    half, turned = released(table, high)
    assert_allclose(turned, low, atol=1e-7)
    assert_allclose(equivalent_conicity(table, 1e-3), (np.pi / half) ** 2 * S * R0, rtol=1e-3)
    low, high = turning_points(table, 7e-3)
    assert_allclose(low, -high)
    with pytest.raises(ValueError, match="does not steer the wheelset back"):
        equivalent_conicity(table, 4e-3)  # too wide for a side, too narrow to pass over the middle


def test_a_falling_difference_has_a_negative_line_and_no_wave():
    table = table_of(-0.1 * Y)
    assert_allclose(linear_conicity(table, [2e-3, 4e-3]), -0.05)
    assert_allclose(harmonic_conicity(table, 3e-3), -0.05)
    with pytest.raises(ValueError, match="does not steer the wheelset back"):
        nonlinearity_parameter(table)


def test_nonlinearity_parameter_is_the_growth_of_the_conicity():
    table = table_of(0.2 * Y * (1 + (Y / 0.010) ** 2))
    more = equivalent_conicity(table, 4e-3) - equivalent_conicity(table, 2e-3)
    assert nonlinearity_parameter(table) == pytest.approx(more / 2e-3)
    assert nonlinearity_parameter(table_of(0.2 * Y)) == pytest.approx(0, abs=1e-6)


def test_a_motion_that_leaves_the_table_is_refused():
    table = table_of(0.1 * (Y - 0.007))
    assert equivalent_conicity(table, 2.9e-3) == pytest.approx(0.05)
    for form in (equivalent_conicity, linear_conicity):
        with pytest.raises(ValueError, match=r"of amplitude 0.004 m leaves the table from -0.01 to 0.01 m"):
            form(table, 4e-3)
        with pytest.raises(ValueError, match=r"amplitude 0.011 m exceeds the table, which ends at 0.01 m"):
            form(table, 11e-3)
    with pytest.raises(ValueError, match="not finite"):
        equivalent_conicity(table_of(np.where(Y > 5e-3, np.nan, Y)), 1e-3)


@pytest.mark.parametrize(("left", "right", "r0"), [("C", "C", 0.46), ("H", "H", 0.459), ("I", "A", 0.46)])
@pytest.mark.parametrize("amplitude", [2.3e-3, 5.2e-3])
def test_pairs_of_the_norm_have_the_wave_of_their_integrated_motion(left, right, r0, amplitude):
    wheels = f"EN15302_Wheel{left}", f"EN15302_Wheel{right}"
    table = contact_table(
        wheels, "EN15302_RailA", 0.0, 1.43516, (r0, 0.46), search="rigid", roll=False,
        shifts=5e-5 * np.arange(-180, 181),
    )  # fmt: skip
    low, high = turning_points(table, amplitude)
    half, turned = released(table, high)
    assert_allclose(turned, low, atol=2e-7)
    assert_allclose(equivalent_conicity(table, amplitude), (np.pi / half) ** 2 * S * R0, rtol=1e-3)
