"""A wheelset that does not sit between its flanges is refused; how profile files were read is said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.contact import contact_table
from fmus.errors import BadInput
from fmus.models import MODELS
from fmus.wheelset.model import Wheelset
from fmus.wheelset.track import Track
from tests.helpers.profile_files import points_of, write_points


@given(st.floats(1.32, 1.42))
@settings(max_examples=25)
def test_a_gauge_that_wedges_the_wheelset_is_refused(gauge):
    with pytest.raises(
        ValueError, match=r"the flanges touch when it is centred|the flange stands"
    ) as refused:
        contact_table(gauge=gauge, shifts=[-1e-4, 0.0, 1e-4])
    assert "\n" not in str(refused.value)
    assert f"gauge {gauge:g} m" in str(refused.value)


@given(st.floats(1.4255, 1.46), st.floats(1.357, 1.363))
@settings(max_examples=25)
def test_a_gauge_with_play_is_not(gauge, back_to_back):
    table = contact_table(gauge=gauge, back_to_back=back_to_back - 0.004, shifts=[0.0])
    assert np.abs(table["delta_left"]).max() < 0.5


def test_a_narrower_wheelset_fits_a_narrower_gauge():
    narrow, usual = (
        contact_table(gauge=1.435 - d, back_to_back=1.36 - d, shifts=[-2e-3, 0.0, 2e-3], search="rigid")
        for d in (0.1, 0.0)
    )
    # each wheel stands over its rail as before; only the roll's lever is shorter
    np.testing.assert_allclose(narrow["delta_left"], usual["delta_left"], atol=1e-3)
    with pytest.raises(BadInput):
        contact_table(gauge=1.335)


def test_how_point_files_were_read_is_said(tmp_path):
    file = write_points(tmp_path / "worn.txt", points_of("S1002", 300, np.random.default_rng(2), noise=5e-6))
    (line,) = Wheelset(track=Track(wheel=str(file))).notes()  # an exact rail needs no reading
    assert line.startswith("wheel worn: ")
    assert "points used; smoothed to" in line
    assert Wheelset().notes() == MODELS["drive"]().notes() == []
