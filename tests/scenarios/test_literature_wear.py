"""Wear from a library of frequency content: laws of its parts, and records of the bogie's truth model."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact import equivalent_conicity
from scenarios.literature import ROWS, run_row
from scenarios.literature import wear_library as wear
from scenarios.literature.twin import twin
from scenarios.track.statistics import CHOCEN_DOBRIKOV
from tests.helpers.native import native
from tests.helpers.rows import truth
from tests.helpers.rows_bogie import HOLLOW
from tests.truth.bogie import felt_behind
from tests.truth.wheelset_contact import contacts
from tests.truth.wheelset_track import random_alignment


def case_of(name, **changed):
    (found,) = (c for c in wear.CASES if c.name == name)
    return replace(found, **changed)


def felt(duration):
    """What both wheelsets feel of a random alignment, (N, 4)."""
    run = random_alignment(np.random.default_rng(1), np.arange(0.0, duration, wear.DT), wear.V)
    both = (run, felt_behind(run, 2.56))
    return np.column_stack([a[::2] for r in both for a in (r.y_irr, r.y_irr_dot)])


@given(st.floats(1e-6, 1e3), st.integers(0, 100))
def test_white_noise_has_its_density_in_every_band_and_ten_times_more_is_twenty_decibels(std, seed):
    noise = np.random.default_rng(seed).normal(0.0, std, (200_000, 1))
    found = wear.content(noise, wear.DT)[0]
    density = 10 * np.log10(2 * wear.DT * std**2)
    assert found[8:].mean() == pytest.approx(density, abs=0.5)
    assert_allclose(found, density, atol=4.0)  # the lowest bands hold a few frequencies only
    assert_allclose(wear.content(10 * noise, wear.DT)[0], found + 20.0)


@given(st.floats(0.0, 1.0), st.integers(0, 100))
def test_a_state_between_two_of_the_library_is_found_between_them(share, seed):
    new, worn = np.random.default_rng(seed).normal(0.0, 5.0, (2, 3, 16))
    known = new + wear.GRID[:, None, None] * (worn - new)
    found = wear.compared(known, new + share * (worn - new))
    assert found.wear == pytest.approx(share, abs=1e-6)
    assert int(np.argmin(found.off)) == pytest.approx(share * (len(wear.GRID) - 1), abs=0.51)


def test_the_other_section_has_the_same_spectrum_and_another_course():
    track = felt(16.0)
    other, speed = wear.sections(track)[wear.ANOTHER]
    assert speed == wear.V
    for i, j in ((0, 2), (1, 3)):
        here, there = (wear.content(x[:, [k]], wear.DT) for x, k in ((track, i), (other, j)))
        assert_allclose(there, here, atol=1.0)
    assert abs(np.corrcoef(track[:, 0], other[:, 0])[0, 1]) < 0.5
    slope = np.gradient(other[:, 0], wear.DT)
    assert_allclose(slope, other[:, 1], atol=0.02 * np.abs(slope).max())  # the rate is that of the alignment


def test_the_faster_run_is_over_the_same_places():
    track = felt(16.0)
    fast, speed = wear.sections(track)[wear.FASTER]
    t = wear.DT * np.arange(len(track))
    there = np.interp(10.0 * wear.V / speed, t, fast[:, 0])
    assert there == pytest.approx(np.interp(10.0, t, track[:, 0]), abs=1e-6)
    slope = np.gradient(fast[:, 0], wear.DT)[: len(t) // 2]
    assert_allclose(slope, fast[: len(t) // 2, 1], atol=0.02 * np.abs(slope).max())


@pytest.mark.slow
def test_a_third_of_the_depth_is_not_a_third_of_the_way_to_the_worn_conicity():
    """What docs/rows.md says of the missed target, by the truth's own contacts."""
    amplitudes = np.array([1e-3, 1.5e-3, 2e-3])

    def table(hollow):
        c = contacts(hollow=HOLLOW * hollow)
        radii = {"r_left": 0.46 + c.growth, "r_right": 0.46 + np.interp(-c.y, c.y, c.growth)}
        return pd.DataFrame(radii, index=c.y)

    new, third, worn = (table(share) for share in (0.0, 1 / 3, 1.0))
    at = [np.asarray(equivalent_conicity(t, amplitudes)) for t in (new, third, worn, new + (worn - new) / 3)]
    assert at[1][0] > 1.5 * max(at[0][0], at[2][0])
    assert_allclose((at[1] - at[0])[1:] / (at[2] - at[0])[1:], [0.92, 0.51], atol=0.02)
    assert_allclose(at[3] / at[1] - 1, [-0.43, -0.25, -0.11], atol=0.02)


@pytest.mark.slow
def test_the_second_wheelset_feels_the_track_a_wheelbase_later():
    record = twin(native("bogie"))(case_of("a third", duration=4.0))
    first, second = (record.columns[n] for n in ("y_irr_1", "y_irr_2"))
    late = 2.56 / wear.V
    assert_allclose(second[100:], np.interp(record.t - late, record.t, first)[100:], atol=1e-12)
    assert first.std() == pytest.approx(CHOCEN_DOBRIKOV["alignment"].sd)


@pytest.mark.slow
def test_worn_wheels_are_told_from_new_ones_by_the_truths_records():
    found = {}
    for name in ("new", "worn"):
        case = case_of(name, duration=20.0)
        record = truth(case)
        known = wear.library(native("bogie"), record.table(wear.ALIGNMENT), wear.V)
        found[name] = wear.compared(known, wear.content(record.table([*wear.NOISE]), wear.DT)).wear
    assert found["new"] < 0.2
    assert found["worn"] > 0.8


@pytest.mark.slow
def test_the_whole_row_meets_its_targets_but_for_a_state_that_the_library_does_not_hold(tmp_path):
    outcome = run_row("wear_library", tmp_path, truth, native("bogie"))
    # a tread that is hollow by a third has more of the worn one's conicity than a third: see docs/rows.md
    assert {f.case for f in outcome.missed} == {"a third"}
    assert {c.name for c in ROWS["wear_library"].cases} == {f.case for f in outcome.findings}
