"""Contact search: both wheels touch, neither penetrates, and closed forms of circles and cones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.nearest import WheelGrid
from fmus.contact.geometry.pair import Pair
from fmus.contact.geometry.search import (
    QUASI_ELASTIC,
    quasi_elastic_contact,
    rigid_contact,
    stand,
)
from tests.helpers.profile_files import cone, round_rail, round_wheel

shifts = st.floats(-0.012, 0.012)
pairs = st.builds(
    Pair,
    wheel=st.just(exact_profile("S1002")),
    rail=st.sampled_from([exact_profile("60E1"), exact_profile("UIC60_Manchester")]),
    cant=st.sampled_from([0.0, 1 / 40, 1 / 20]),
    gauge=st.floats(1.432, 1.445),
    r0=st.floats(0.35, 0.55),
)


def standard(**changed):
    return Pair(exact_profile("S1002"), exact_profile("60E1"), **changed)


def surfaces(pair, y, phi, lift):
    """Left wheel's points in the track frame, on a fine grid of its own: y, z above the rail (n, m)."""
    eta = np.linspace(pair.wheel.begin, pair.wheel.end, 20_011)
    z = pair.wheel.height(eta) - pair.r0
    turned_y = (pair.tape + eta) * np.cos(phi) - z * np.sin(phi)
    turned_z = (pair.tape + eta) * np.sin(phi) + z * np.cos(phi)
    track_y = y + turned_y
    return track_y, turned_z + pair.r0 + lift - pair.left_rail.height(track_y)


@settings(max_examples=15)
@given(pairs, shifts)
def test_both_wheels_touch_and_neither_penetrates(pair, y):
    at = stand(pair, np.array([y]))
    assert at.rests.all()
    for sign, touch in ((1, at.left), (-1, at.right)):
        assert abs(touch.gap[0] + at.lift[0]) < 1e-9
        _, above = surfaces(pair, sign * y, sign * at.phi[0], at.lift[0])
        least = np.nanmin(above)
        # this grid of 6.5 um steps misses the very touching point by less than 0.1 um on the flange
        assert -1e-9 < least < 1e-7


@settings(max_examples=10)
@given(pairs, st.floats(1e-4, 0.012))
def test_left_and_right_are_mirror_images(pair, y):
    at = stand(pair, np.array([y, -y]))
    assert_allclose(at.phi[0], -at.phi[1], atol=1e-9)
    assert_allclose(at.left.gap[0], at.right.gap[1], atol=1e-9)
    assert_allclose(at.left.rail_y[0], at.right.rail_y[1], atol=1e-7)


@settings(max_examples=10)
@given(st.floats(-0.005, 0.01), st.floats(-0.01, 0.01), st.floats(-0.005, 0.005))
def test_wider_gauge_is_a_shift_of_each_wheel_over_its_rail(wider, y, phi):
    shifts, rolls = np.array([y, -y]), np.array([phi, -phi])  # of both wheels, the right one mirrored
    wide = WheelGrid.of(standard(gauge=1.435 + wider)).nearest(shifts, rolls)
    narrow = WheelGrid.of(standard()).nearest(shifts - wider / 2, rolls)
    assert_allclose(wide.gap, narrow.gap, atol=1e-10)
    assert_allclose(wide.rail_y, narrow.rail_y + wider / 2, atol=1e-6)


@settings(max_examples=10)
@given(st.floats(-0.3, 0.3), st.floats(-0.008, 0.008))
def test_wheelset_and_track_may_widen_together(wider, y):
    y = np.array([y])
    wide = WheelGrid.of(standard(gauge=1.435 + wider, back_to_back=1.360 + wider)).nearest(y, np.zeros(1))
    base = WheelGrid.of(standard()).nearest(y, np.zeros(1))
    assert_allclose(wide.gap, base.gap, atol=1e-10)
    assert_allclose(wide.eta, base.eta, atol=1e-6)
    assert_allclose(wide.lever - base.lever, wider / 2, atol=1e-5)


def test_gauge_is_measured_14_mm_below_the_crown():
    for cant in (0.0, 1 / 60, 1 / 40):
        rail = standard(cant=cant).left_rail
        assert_allclose(rail.height(1.435 / 2 + 1e-9), -0.014, atol=1e-6)
        y = np.linspace(rail.begin, rail.end, 10_001)
        assert_allclose(np.nanmax(rail.height(y)), 0.0, atol=1e-8)
        # the crown of R300 leans out by 300 sin(cant)
        crown = y[np.argmax(rail.height(y))]
        assert_allclose(crown - rail.axis_y, 0.3 * np.sin(np.arctan(cant)), atol=1e-5)


@settings(max_examples=10)
@given(st.floats(0.01, 0.045), st.floats(0.15, 0.6), st.floats(0.0, 0.006))
def test_cone_on_round_rail_by_closed_form(conicity, radius, y):
    """A line on a circle: the distance of the circle's centre from the line is its radius."""
    pair = Pair(cone(conicity), round_rail(radius), cant=0.0)
    at = stand(pair, np.array([y]))
    assert at.rests.all()
    gamma, centre_y = np.arctan(conicity), pair.left_rail.axis_y
    phi, lift = at.phi[0], at.lift[0]
    for sign, touch in ((1, at.left), (-1, at.right)):
        slope = gamma + sign * phi  # of the wheel's line in the track frame
        # where the line through the tape circle's point is over the centre of the circle
        tape_y = sign * y + pair.tape * np.cos(phi) + sign * pair.r0 * np.sin(phi)
        tape_z = sign * pair.tape * np.sin(phi) - pair.r0 * np.cos(phi) + pair.r0 + lift
        over = tape_z + (centre_y - tape_y) * np.tan(slope)
        assert_allclose(over + radius, radius / np.cos(slope), atol=2e-9)
        assert_allclose(touch.rail_y, centre_y - radius * np.sin(slope), atol=2e-7)


@settings(max_examples=10)
@given(st.floats(0.2, 0.5), st.floats(0.1, 0.5), st.floats(0.0, 0.003))
def test_circle_on_circle_by_closed_form(rail_radius, wheel_over_rail, y):
    """A bulging circle on a circle touches on the line of their centres, as far apart as both radii."""
    wheel_radius = rail_radius * wheel_over_rail + 0.1
    pair = Pair(round_wheel(-wheel_radius), round_rail(rail_radius), cant=0.0)
    at = stand(pair, np.array([y]))
    assert at.rests.all()
    phi, lift, touch = at.phi[0], at.lift[0], at.left
    up = wheel_radius - pair.r0
    centre_y = y + pair.tape * np.cos(phi) - up * np.sin(phi)
    centre_z = pair.tape * np.sin(phi) + up * np.cos(phi) + pair.r0 + lift
    rail_y, rail_z = pair.left_rail.axis_y, -rail_radius
    apart = np.hypot(centre_y - rail_y, centre_z - rail_z)
    assert_allclose(apart, wheel_radius + rail_radius, atol=2e-9)
    assert_allclose(touch.rail_y, rail_y + rail_radius * (centre_y - rail_y) / apart, atol=2e-7)
    contact = rigid_contact(pair, touch)
    assert_allclose([contact.kappa_wheel[0], contact.kappa_rail[0]], [1 / wheel_radius, -1 / rail_radius])


def test_quasi_elastic_place_on_circles_is_the_rigid_one():
    # symmetric weights about the touching point; curvatures are constant
    pair = Pair(round_wheel(-0.5), round_rail(0.3), cant=0.0)
    y = np.zeros(1)
    at = stand(pair, y)
    soft, hard = quasi_elastic_contact(pair, y, at.phi, at.left), rigid_contact(pair, at.left)
    # the circles lean by the offset of their centres, which skews the weights
    assert_allclose(soft.eta, hard.eta, atol=5e-5)
    # over a cell of 0.1 mm the chord stands for the arc
    assert_allclose(soft.kappa_wheel - soft.kappa_rail, 1 / 0.5 + 1 / 0.3, rtol=1e-7)


@pytest.mark.parametrize("y", [-0.004, 0.0015, 0.0063, 0.008])
def test_quasi_elastic_weights_by_quadrature(y):
    """The same means from a grid eight times as fine, over the whole wheel."""
    pair = standard()
    at = stand(pair, np.array([y]))
    found = quasi_elastic_contact(pair, at.y, at.phi, at.left)
    eta = np.linspace(pair.wheel.begin, pair.wheel.end, 20_011)
    track_y, above = surfaces(pair, y, at.phi[0], at.lift[0])
    weight = np.where(np.isnan(above), 0.0, np.exp(-np.nan_to_num(above) / QUASI_ELASTIC))
    place = (weight * eta).sum() / weight.sum()
    assert_allclose(found.eta, place, atol=2e-6)
    near = weight > 1e-12
    bend = pair.wheel.curvature(eta[near]) - pair.left_rail.curvature(track_y[near])
    mean = (weight[near] * bend).sum() / weight[near].sum()
    assert_allclose(found.kappa_wheel - found.kappa_rail, mean, rtol=2e-3)
