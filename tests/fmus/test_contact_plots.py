"""Figures of profiles and tables: what they show, in which unit."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.pair import Pair
from fmus.contact.geometry.plots import (
    connection_figure,
    patch_figure,
    position_figure,
    profile_figure,
    right_rail_place,
    rolling_figure,
)
from fmus.contact.geometry.search import stand
from fmus.contact.geometry.table import contact_table

SHIFTS = np.linspace(-0.010, 0.010, 41)
PAIR = Pair(exact_profile("S1002"), exact_profile("60E1"))


@pytest.fixture
def tables():
    return {s: contact_table(search=s, N=70e3, shifts=SHIFTS) for s in ("rigid", "quasi_elastic")}


def test_every_figure_is_drawn_and_every_axis_named(tables, tmp_path):
    figures = [
        profile_figure(PAIR.wheel), profile_figure(PAIR.rail, exact_profile("UIC60_Manchester")),
        rolling_figure(tables), connection_figure(PAIR, tables), position_figure(tables),
        patch_figure(tables),
    ]  # fmt: skip
    for i, figure in enumerate(figures):
        figure.savefig(tmp_path / f"{i}.png", dpi=40)
        assert all("[" in ax.get_ylabel() for ax in figure.axes)
        assert "[mm]" in figure.axes[-1].get_xlabel()


def test_lines_hold_the_table_in_mm_and_mrad(tables):
    radii, roll = rolling_figure(tables).axes
    for line, table in zip(radii.lines, tables.values(), strict=True):
        assert_allclose(line.get_xdata(), SHIFTS * 1e3)
        assert_allclose(line.get_ydata(), 1e3 * (table["r_left"] - table["r_right"]))
    assert [line.get_label() for line in radii.lines] == ["rigid", "quasi-elastic"]
    assert_allclose(roll.lines[1].get_ydata(), 1e3 * tables["quasi_elastic"]["phi"])
    a, b, ratio = (ax.lines[0].get_ydata() for ax in patch_figure(tables).axes)
    assert_allclose(a / b, ratio)
    assert_allclose(a, 1e3 * tables["rigid"]["a_right"])


def test_connections_join_places_that_touch(tables):
    touching = stand(PAIR, SHIFTS).right
    # at a jump of the rigid search two places are equally near; a roll of 1e-9 rad moves others by 1 um
    same = np.abs(touching.eta - tables["rigid"]["eta_right"]) < 1e-4
    assert same.sum() >= 40
    assert_allclose(right_rail_place(PAIR, tables["rigid"])[same], touching.rail_y[same], atol=1e-6)


def test_steep_backs_are_not_drawn():
    height, inclination, curvature = profile_figure(PAIR.wheel).axes
    assert np.isnan(inclination.lines[0].get_ydata()).any()
    assert np.nanmax(np.abs(inclination.lines[0].get_ydata())) < 1.35e3  # 76 degrees
    assert_allclose(np.nanmax(curvature.lines[0].get_ydata()), 1 / 0.012)
    assert_allclose(np.nanmin(height.lines[0].get_ydata()), -28, atol=1e-3)
