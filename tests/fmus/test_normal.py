"""The normal problem: Hertz's solution put back into the half-space, its limits, scaling, tables."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact.normal import hertz, virtual_penetration

E, NU = 210e9, 0.28
E_STAR = E / (2 * (1 - NU**2))
curvatures = st.floats(1e-2, 1e3)  # 1/m, radii from half a millimetre to 50 m
loads = st.floats(1.0, 2e5)


def displacement(x, y, a, b, p0):
    """Displacement of both half-spaces, m, under p0 sqrt(1 - (x/a)² - (y/b)²): Boussinesq, by chords."""
    angle = (np.arange(4000) + 0.5) * np.pi / 4000  # a periodic integrand: the midpoint rule is exact
    c, s = np.cos(angle), np.sin(angle)
    square, middle = c**2 / a**2 + s**2 / b**2, x * c / a**2 + y * s / b**2
    rest = 1 - (x / a) ** 2 - (y / b) ** 2
    return p0 / (2 * E_STAR) * np.pi * np.mean((middle**2 + square * rest) / square**1.5)


@given(curvatures, st.floats(0.02, 50.0), loads, st.floats(0.0, 1.0), st.floats(0.0, 6.3))
def test_the_pressure_bends_the_surfaces_onto_each_other(A, ratio, N, radius, angle):
    a, b, delta, p0 = hertz(A, A * ratio, N, E, NU)
    x, y = a * radius * np.cos(angle), b * radius * np.sin(angle)
    assert_allclose(displacement(x, y, a, b, p0), delta - A * x**2 - A * ratio * y**2, rtol=1e-11)
    assert_allclose(2 / 3 * np.pi * a * b * p0, N, rtol=1e-12)


@given(curvatures, loads)
def test_equal_curvatures_give_a_circle(A, N):
    a, b, delta, p0 = hertz(A, A, N, E, NU)
    R = 1 / (2 * A)
    assert_allclose([a, b], np.cbrt(3 * N * R / (4 * E_STAR)), rtol=1e-12)
    assert_allclose(delta, a**2 / R, rtol=1e-12)
    assert_allclose(p0, 1.5 * N / (np.pi * a**2), rtol=1e-12)


@given(curvatures, loads, st.floats(-1e-4, 1e-4))
def test_near_the_circle_nothing_cancels(A, N, off):
    a, b, _, _ = hertz(A * (1 + off), A * (1 - off), N, E, NU)
    # b/a to first order: the slope 2/3 of log(b/a) against log(A/B); what follows is of order off³
    assert_allclose(np.log(b / a), 2 / 3 * np.log((1 + off) / (1 - off)), atol=1e-11)


@given(st.floats(1e-14, 1e-9), st.floats(1.0, 1e3), loads)
def test_a_long_ellipse_is_in_its_middle_a_contact_of_cylinders(ratio, B, N):
    _, b, _, p0 = hertz(ratio * B, B, N, E, NU)
    # p0 = E* b/(2 R) and 1/R = 2 B; what is left out is of order (b/a)² log(a/b)
    assert_allclose(p0, E_STAR * B * b, rtol=1e-7)


@pytest.mark.parametrize(
    ("theta", "m", "n"),
    [(80, 1.128, 0.893), (70, 1.284, 0.802), (60, 1.486, 0.717), (50, 1.754, 0.641), (30, 2.731, 0.493)],
)
def test_tabulated_coefficients(theta, m, n):
    # Timoshenko & Goodier, Theory of Elasticity, 3rd ed., section 142; (B - A)/(A + B) = cos theta
    A, B = 1 - np.cos(np.deg2rad(theta)), 1 + np.cos(np.deg2rad(theta))
    a, b, _, _ = hertz(A, B, 1e4, E, NU)
    unit = np.cbrt(3 * 1e4 / (4 * E_STAR * (A + B)))
    assert_allclose([a / unit, b / unit], [m, n], rtol=3e-3)  # the row of 70 degrees is off by that


@given(curvatures, curvatures, loads)
def test_turning_the_axes_turns_the_ellipse(A, B, N):
    a, b, delta, p0 = hertz(A, B, N, E, NU)
    assert hertz(B, A, N, E, NU) == (b, a, delta, p0)
    assert (a > b) == (A < B) or a == b


@given(curvatures, curvatures, loads, st.floats(1e-3, 1e3))
def test_load_scales_sizes_by_its_third_root(A, B, N, factor):
    small, large = hertz(A, B, N, E, NU), hertz(A, B, factor * N, E, NU)
    root = np.cbrt(factor)
    assert_allclose(large, np.array([root, root, root**2, root]) * small, rtol=1e-12)


def test_extreme_ratios_stay_exact():
    A = np.logspace(-30, 0, 61)
    a, b, delta, p0 = hertz(A, 1.0, 1e4, E, NU)
    assert np.isfinite([a, b, delta, p0]).all()
    assert (np.diff(a / b) < 0).all()
    assert_allclose(2 / 3 * np.pi * a * b * p0, 1e4, rtol=1e-11)


def test_no_load_no_patch():
    assert hertz(1.0, 2.0, 0.0, E, NU) == (0.0, 0.0, 0.0, 0.0)


def test_floats_give_floats_and_arrays_broadcast():
    assert all(type(x) is float for x in hertz(1, 2, 3, E, NU))
    found = hertz(np.ones((3, 1)), np.array([1.0, 2.0]), 1e4, E, NU)
    assert [x.shape for x in found] == [(3, 2)] * 4
    assert found[0][2, 1] == hertz(1.0, 2.0, 1e4, E, NU)[0]
    assert hertz(np.ones((2, 0)), 1.0, 1.0, E, NU)[0].shape == (2, 0)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"A": 0.0}, "A must be finite and greater than 0"),
        ({"B": np.array([1.0, -1.0])}, "B must be finite and greater than 0"),
        ({"N": -1.0}, "N must be finite and 0 or greater"),
        ({"E": np.nan}, "E must be finite"),
        ({"nu": 0.6}, "nu must be finite and from"),
        ({"A": "steep"}, "A must be a number"),
        ({"A": np.ones(2), "B": np.ones(3)}, r"do not broadcast together: A \(2,\), B \(3,\)"),
    ],
)
def test_what_physics_does_not_allow_is_named(wrong, words):
    with pytest.raises(ValueError, match=words):
        hertz(**{"A": 1.0, "B": 1.0, "N": 1.0, "E": E, "nu": NU} | wrong)


@given(curvatures, curvatures, st.floats(1e-8, 1e-3))
def test_virtual_penetration_cuts_the_surfaces_at_its_depth(A, B, delta):
    a, b = virtual_penetration(A, B, delta)
    assert_allclose([A * a**2, B * b**2], 0.55 * delta, rtol=1e-12)


def test_virtual_penetration_of_a_circle_is_near_hertz():
    a, _, delta, _ = hertz(1.0, 1.0, 5e4, E, NU)
    # R delta = a² in Hertz's solution, and A = 1/(2 R): the ratio of the areas is 2 times 0.55
    assert_allclose(virtual_penetration(1.0, 1.0, delta)[0] / a, np.sqrt(1.1), rtol=1e-12)


def test_virtual_penetration_names_a_wrong_argument():
    with pytest.raises(ValueError, match="delta must be finite and 0 or greater"):
        virtual_penetration(1.0, 1.0, -1e-5)
