"""Unlike wheels, rails and diameters left and right, and upright wheels as EN 15302 takes them."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact import contact_table, equivalent_conicity
from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.pair import Pair, Sides
from fmus.contact.geometry.search import stand
from fmus.errors import BadInput
from tests.helpers.profile_files import cone, points_of, round_rail, write_points

WHEELS = [f"EN15302_Wheel{letter}" for letter in "ABCHI"]
NORM = {"rail": "EN15302_RailA", "cant": 0.0, "gauge": 1.43516, "search": "rigid", "roll": False}
SHIFTS = np.linspace(-0.006, 0.006, 25)


@pytest.mark.parametrize("roll", [True, False])
@pytest.mark.parametrize("search", ["rigid", "quasi_elastic"])
def test_like_sides_given_as_a_pair_are_one(search, roll):
    wheels = exact_profile("S1002"), cone(0.05)
    for wheel in wheels:
        one = contact_table(wheel, search=search, roll=roll, shifts=SHIFTS)
        two = contact_table((wheel, wheel), ("60E1", "60E1"), r0=(0.46, 0.46), search=search, roll=roll,
                            shifts=SHIFTS)  # fmt: skip
        pd.testing.assert_frame_equal(one, two, rtol=1e-12)
        assert one.attrs == two.attrs


@settings(max_examples=4)
@given(
    st.sampled_from(["S1002", *WHEELS]), st.sampled_from(["S1002", *WHEELS]), st.floats(-1e-3, 1e-3),
    st.booleans(),
)  # fmt: skip
def test_exchanged_sides_are_the_mirror_image(left, right, taller, roll):
    given = {"rail": ("60E1", "UIC60_Manchester"), "r0": (0.46, 0.46 + taller), "roll": roll}
    table = contact_table((left, right), **given, shifts=SHIFTS)
    given = {name: both if name == "roll" else both[::-1] for name, both in given.items()}
    mirrored = contact_table((right, left), **given, shifts=SHIFTS)[::-1]
    for name in ("r", "delta", "eta"):
        for side, other in (("left", "right"), ("right", "left")):
            assert_allclose(
                table[f"{name}_{side}"], mirrored[f"{name}_{other}"], rtol=1e-6, atol=1e-7, err_msg=name
            )
    assert_allclose(table["phi"], -mirrored["phi"], atol=1e-8)
    assert_allclose(table["z"], mirrored["z"], atol=1e-8)


@settings(max_examples=6)
@given(
    st.sampled_from(WHEELS), st.sampled_from(["S1002", *WHEELS]), st.floats(-2e-3, 2e-3),
    st.floats(-0.006, 0.006),
)  # fmt: skip
def test_both_wheels_of_unlike_sides_touch_and_neither_penetrates(left, right, taller, y):
    rails = exact_profile("60E1"), exact_profile("UIC60_Manchester")
    sides = Sides(Pair(exact_profile(left), rails[0], r0=0.46 + taller), Pair(exact_profile(right), rails[1]))
    at = stand(sides, np.array([y]))
    assert at.rests.all()
    centre = 0.46 + taller / 2 + at.lift[0]  # over the crowns
    for pair, sign in sides.named.values():
        eta = np.linspace(pair.wheel.begin, pair.wheel.end, 20_011)
        down, phi = pair.wheel.height(eta) - pair.r0, sign * at.phi[0]
        across = sign * y + (pair.tape + eta) * np.cos(phi) - down * np.sin(phi)
        up = centre + (pair.tape + eta) * np.sin(phi) + down * np.cos(phi)
        assert -1e-9 < np.nanmin(up - pair.left_rail.height(across)) < 1e-7


def test_a_taller_left_wheel_rolls_the_wheelset_to_the_right():
    table = contact_table(cone(0.03), round_rail(0.3), cant=0.0, r0=(0.461, 0.46), shifts=[0.0, 1e-4])
    assert_allclose(table["phi"].iloc[0], 0.001 / 1.5, rtol=0.05)
    assert table.attrs["r0"] == (0.461, 0.46)


@settings(max_examples=6)
@given(st.sampled_from(WHEELS), st.sampled_from(WHEELS), st.floats(-0.0075, 0.0075))
def test_upright_wheels_stand_where_the_vertical_distance_is_least(left, right, y):
    """Each on its own rail, by looking at every place of both profiles in the norm's own frame."""
    table = contact_table((left, right), **NORM, r0=(0.459, 0.46), shifts=[y - 1e-6, y])
    rail = exact_profile("EN15302_RailA")
    place = np.linspace(rail.begin + 1e-9, rail.end - 1e-9, 400_001)
    for name, side, sign, r0 in ((left, "left", 1, 0.459), (right, "right", -1, 0.46)):
        wheel = exact_profile(name)
        gap = wheel.height(place - sign * y) - rail.height(place)  # both tape circles lie over y = 0
        nearest = place[np.nanargmin(gap)] - sign * y
        found = table[f"eta_{side}"].iloc[1]
        # at an equal distance either place is right; on conforming arcs 1 pm of distance is 10 um of place
        assert gap[np.nanargmin(gap)] >= float(wheel.height(found) - rail.height(found + sign * y)) - 2e-8
        if abs(found - nearest) < 1e-4:
            assert_allclose(table[f"r_{side}"].iloc[1], r0 - wheel.height(nearest), atol=2e-6)
    assert (table["phi"] == 0).all()


def test_each_upright_wheel_knows_only_its_own_side():
    both = contact_table((WHEELS[0], WHEELS[1]), **NORM, r0=(0.459, 0.46), shifts=SHIFTS)
    for side, wheel, r0 in (("left", WHEELS[0], 0.459), ("right", WHEELS[1], 0.46)):
        alike = contact_table(wheel, **NORM, r0=r0, shifts=SHIFTS)
        for name in ("r", "delta", "eta", "a", "b"):
            assert_allclose(both[f"{name}_{side}"], alike[f"{name}_{side}"], rtol=1e-12)


def test_roll_is_what_a_rolling_wheelset_adds():
    """A cone on a round rail: upright it has its own conicity, rolling the classical factor more."""
    wheel, rail, r = cone(0.04), round_rail(0.3), 0.3
    tables = [
        contact_table(wheel, rail, cant=0.0, search="rigid", roll=roll, shifts=np.linspace(-3e-3, 3e-3, 13))
        for roll in (False, True)
    ]
    upright, rolling = (equivalent_conicity(t, 2e-3) for t in tables)
    assert_allclose(upright, 0.04, rtol=1e-6)
    e0 = Pair(wheel, rail, cant=0.0).left_rail.axis_y - r * np.arctan(0.04)
    assert_allclose(rolling / upright, (e0 + r * 0.04) / (e0 - 0.46 * 0.04), rtol=2e-3)


@given(st.floats(0.02, 0.06), st.floats(-5e-3, 5e-3), st.floats(-1e-4, 1e-4))
@settings(max_examples=5)
def test_unlike_cones_have_their_mean_conicity(left, more, taller):
    rail, right = round_rail(0.3), left + more
    face = 0.75 - Pair(cone(left), rail, cant=0.0).left_rail.axis_y
    table = contact_table(
        (cone(left), cone(right)), rail, cant=0.0, gauge=1.435 + 2 * face, search="rigid", roll=False,
        r0=(0.46 + taller, 0.46), shifts=np.linspace(-0.012, 0.012, 49),
    )  # fmt: skip
    assert_allclose(equivalent_conicity(table, 2e-3), (left + right) / 2, rtol=1e-5)


def test_default_shifts_reach_beyond_both_flanges():
    table = contact_table((WHEELS[0], WHEELS[1]), **NORM, r0=(0.459, 0.46))
    assert len(table) == 1001
    assert min(table["delta_left"].max(), table["delta_right"].max()) > 1.0
    wide = contact_table((WHEELS[0], WHEELS[1]), **{**NORM, "gauge": 1.445})
    assert wide.index[-1] > 0.0135
    assert min(wide["delta_left"].max(), wide["delta_right"].max()) > 1.0


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"wheel": ("S1002", "S1002", "S1002")}, "wheel has 3 entries; give one for both sides, or the left"),
        ({"r0": (0.46, 460.0)}, "r0 = 460 must be from 0.05 to 2; give it in SI units"),
        ({"rail": ("60E1", "60E")}, "rail = '60E' is neither a file nor an exact profile"),
        ({"rail": ("60E1", "EN15302_RailA")}, "already inclined; give cant = 0"),
        ({"wheel": ("S1002", "60E1")}, "wheel = 60E1 is a rail; give the profile of a wheel"),
        ({"wheel": ("S1002", "EN15302_WheelA"), "gauge": 1.3}, "stands on the rail"),
    ],
)
def test_bad_sides_are_named(changed, words):
    with pytest.raises(BadInput) as refused:
        contact_table(**changed)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_stated_gauge_face_places_the_norms_rail():
    pair = Pair(exact_profile("EN15302_WheelA"), exact_profile("EN15302_RailA"), 0.0, 1.43516)
    assert_allclose(pair.left_rail.axis_y, 0.75, atol=1e-12)
    # stated to 0.01 mm, it is where the rail is 14 mm below its crown
    place = np.linspace(-0.0326, -0.032, 60_001)
    below = pair.rail.height(np.linspace(0, 0.03, 100_001)).max() - 0.014
    assert abs(place[np.argmin(np.abs(pair.rail.height(place) - below))] + 0.03242) < 5e-6


def test_measured_points_left_and_exact_right(tmp_path):
    file = write_points(tmp_path / "left.txt", points_of("EN15302_WheelA", 1500, np.random.default_rng(0)))
    table = contact_table((file, "EN15302_WheelB"), **NORM, shifts=SHIFTS)
    exact = contact_table(("EN15302_WheelA", "EN15302_WheelB"), **NORM, shifts=SHIFTS)
    assert_allclose(table["r_left"], exact["r_left"], atol=5e-5)
    assert table.attrs["wheel"] == ("left", "EN15302_WheelB")
    assert table.attrs["wheel_found"][1] == "exact sections"
