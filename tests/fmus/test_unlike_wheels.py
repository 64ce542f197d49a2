"""Wheels and rails that differ from left to right: mirror images, where both roll alike, messages."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.bogie.model import Bogie
from fmus.errors import BadInput
from fmus.vehiclelateral.model import VehicleLateral
from fmus.wheelset.model import Wheelset
from fmus.wheelset.track import Track
from tests.helpers.evaluated import Evaluated

MODELS = {"wheelset": Wheelset, "bogie": Bogie}
UNLIKE = {
    "wheel": ("S1002", "S1002_Hollow"),
    "rail": ("60E1", "UIC60_Manchester"),
    "r0": (0.46, 0.4595),
}
UNTURNED = ("V", "omega_1", "omega_2", "creep_law", "contact_search", "gauge_irr")


def built(model, left=0, right=1, **more):
    """The model with the first or second of UNLIKE on each side; radii by the left one."""
    options = {name: both[left] for name, both in UNLIKE.items()}
    options |= {f"{name}_right": both[right] for name, both in UNLIKE.items()}
    return Evaluated(MODELS[model](**options, **more))


@cache
def pair_of(model):
    """The model and the one with its sides exchanged."""
    return built(model, 0, 1), built(model, 1, 0)


@settings(deadline=None, max_examples=15)
@given(st.floats(-6e-3, 6e-3), st.floats(-3e-3, 3e-3), st.floats(-0.05, 0.05), st.sampled_from([0.0, 1.0]))
@pytest.mark.parametrize("model", ["wheelset", pytest.param("bogie", marks=pytest.mark.slow)])
def test_exchanged_sides_move_as_the_mirror_image(model, y, psi, y_dot, search):
    one, other = pair_of(model)
    names = ("y", "psi", "y_dot") if model == "wheelset" else ("y_1", "psi_1", "y_1_dot")
    said = dict(zip(names, (y, psi, y_dot), strict=True)) | {"contact_search": search, "V": 30.0}
    here, there = one.rates(**said), other.rates(**{n: v if n in UNTURNED else -v for n, v in said.items()})
    for name, rate in here.items():
        turns = 1 if name.startswith("omega") else -1
        assert rate == pytest.approx(turns * there[name], rel=1e-6, abs=1e-6), name


def test_sides_that_are_given_twice_have_the_bits_of_one():
    plain = Evaluated(Wheelset())
    twice = Evaluated(Wheelset(wheel_right="S1002", rail_right="60E1", r0_right=0.46))
    x = {"y": 2e-3, "psi": 1e-3, "y_dot": 0.02, "psi_dot": 0.01}
    assert plain.rates(**x) == twice.rates(**x)
    assert plain.outputs(**x) == twice.outputs(**x)


@pytest.mark.parametrize("taller", [2e-4, pytest.param(-3e-4, marks=pytest.mark.slow)])
def test_a_wheelset_with_unlike_radii_rolls_where_both_radii_are_one(taller):
    """To first order the smaller wheel is pulled towards its flange until it rolls on the same radius."""
    model = Evaluated(Wheelset(r0=0.46, r0_right=0.46 - taller))
    free = {"k_y": 0.0, "k_x": 0.0, "b_x": 0.0, "k_spin": 0.0, "F_n": 1e4, "creep_law": 0.0}
    at = model.equilibrium(V=20.0, m_m=1e9, **free)
    o = model.outputs(V=20.0, **free, **at)
    assert np.sign(at["y"]) == -np.sign(taller)
    assert abs(o["r_left"] - o["r_right"]) < 0.05 * abs(taller)


def test_a_bogie_and_a_vehicle_take_unlike_wheels():
    for model in (Bogie, VehicleLateral):
        plain, unlike = Evaluated(model()), Evaluated(model(wheel_right="S1002_Hollow"))
        x = {"y_1": 3e-3}
        left, right = (f"delta_1_{side}" for side in ("left", "right"))
        was, now = plain.outputs(**x), unlike.outputs(**x)
        assert abs(now[right] - was[right]) > 1e-3
        assert abs(now[left] - was[left]) < abs(now[right] - was[right])


def test_what_is_built_in_names_both_sides():
    assert "right" not in str(Track())
    assert "right: wheel S1002_Hollow (r0 0.46 m) on rail 60E1" in str(Track(wheel_right="S1002_Hollow"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"wheel_right": "S1003"}, "S1003"),
        ({"r0_right": "4.6"}, "r0 = 4.6"),
        ({"rail_right": 3.0}, "rail_right"),
    ],
)
def test_a_wrong_right_side_is_named(options, said):
    with pytest.raises(BadInput, match=said):
        Track.parse(**options)
