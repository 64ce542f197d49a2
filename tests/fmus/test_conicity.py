"""Equivalent conicity and Klingel's wavelength: cones, the equation of motion, and the figures of S1002."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from fmus.contact.geometry.conicity import equivalent_conicity, klingel_wavelength
from fmus.contact.geometry.pair import Pair
from fmus.contact.geometry.table import contact_table
from tests.helpers.paths import SHARED
from tests.helpers.profile_files import (
    cone,
    points_of,
    round_rail,
    write_points,
)

DATA = SHARED / "data" / "contact"
S, R0 = 0.75, 0.46  # m
SEARCHES = ("rigid", "quasi_elastic")
SHIFTS = np.linspace(-0.0045, 0.0045, 91)


def table_of(y, difference):
    return pd.DataFrame({"r_left": R0 + difference / 2, "r_right": R0 - difference / 2}, index=y)


def wavelength_of_motion(table, amplitude):
    """Wavelength of y'' = -dr/(2 s r0), released at the amplitude, by integration: four quarter waves, m."""
    difference = (table["r_left"] - table["r_right"]).to_numpy()

    def motion(_, x):
        return [x[1], -np.interp(x[0], table.index, difference) / (2 * S * R0)]

    def centre(_, x):
        return x[0]

    centre.terminal = True
    found = solve_ivp(motion, (0, 200), [amplitude, 0.0], events=centre, rtol=1e-9, atol=1e-13, max_step=0.02)
    return 4 * found.t_events[0][0]


@given(st.floats(1e-3, 0.5), st.floats(1e-4, 9e-3))
def test_straight_difference_is_its_conicity(conicity, amplitude):
    y = np.linspace(-0.010, 0.010, 41)
    assert_allclose(equivalent_conicity(table_of(y, 2 * conicity * y), amplitude), conicity, rtol=1e-5)


@given(st.floats(0.02, 0.3), st.floats(0.1, 10.0), st.floats(1e-3, 8e-3))
def test_cubic_difference_has_the_wave_of_its_motion(conicity, growth, amplitude):
    """The pendulum with a cubic spring: its period by the arithmetic-geometric mean."""
    y = np.linspace(-0.010, 0.010, 4001)
    relative = growth * (y / 0.010) ** 2
    found = equivalent_conicity(table_of(y, 2 * conicity * y * (1 + relative)), amplitude)
    e = growth * (amplitude / 0.010) ** 2
    a, g = np.sqrt(1 + e), np.sqrt(1 + e / 2)
    for _ in range(6):
        a, g = (a + g) / 2, np.sqrt(a * g)
    # Duffing's oscillator: its circular frequency over the linear one is that mean
    assert_allclose(found, conicity * a**2, rtol=1e-4)


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("amplitude", [0.002, 0.004])
def test_klingel_wave_of_the_conicity_is_that_of_the_motion(search, amplitude):
    table = contact_table(search=search)
    by_klingel = klingel_wavelength(equivalent_conicity(table, amplitude), R0, S)
    assert_allclose(by_klingel, wavelength_of_motion(table, amplitude), rtol=2e-4)


@settings(max_examples=6)
@given(st.floats(0.02, 0.045), st.floats(0.2, 0.5), st.sampled_from(SEARCHES))
def test_cone_on_a_round_rail(conicity, radius, search):
    """Classical theory of small motion: conicity (e0 + R g)/(e0 - r0 g), e0 half between the contacts."""
    wheel, rail = cone(conicity), round_rail(radius)
    table = contact_table(wheel, rail, cant=0.0, search=search, shifts=np.linspace(-0.003, 0.003, 13))
    slope = np.arctan(conicity)
    e0 = Pair(wheel, rail, cant=0.0).left_rail.axis_y - radius * slope
    expected = conicity * (e0 + radius * slope) / (e0 - R0 * slope)
    found = equivalent_conicity(table, 0.002)
    assert_allclose(found, expected, rtol=2e-3)  # second order of the slope, 0.045^2
    # apart from that factor, which is 1 for a small angle, the cone has its own conicity and Klingel's wave
    assert_allclose(found, conicity, rtol=0.1)
    wave = klingel_wavelength(found, R0, S)
    assert_allclose(wave, klingel_wavelength(expected, R0, S), rtol=1e-3)


@pytest.mark.parametrize("rail", ["60E1", "UIC60_Manchester"])
@pytest.mark.parametrize("cant", [0.0, 1 / 40, 1 / 20])
def test_cone_on_any_rail(rail, cant):
    table = contact_table(cone(0.05), rail, cant, search="rigid", shifts=np.linspace(-0.003, 0.003, 25))
    # between 1 and the classical factor of the flattest rail, R300, at 1:20
    assert 0.05 < equivalent_conicity(table, 0.002) < 0.05 * (0.75 + 0.015) / (0.735 - 0.023 - 0.015)


# ---- figures, S1002 on 60E1; by an independent solver for the same geometry

FIGURES = [
    ("rigid", 1 / 40, 0.003, 0.177, 0.004),
    ("rigid", 1 / 40, 0.004, 0.159, 0.004),
    ("quasi_elastic", 1 / 40, 0.003, 0.164, 0.005),
    ("rigid", 1 / 20, 0.003, 0.0095, 0.001),
]


@pytest.mark.parametrize(("search", "cant", "amplitude", "expected", "tolerance"), FIGURES)
def test_s1002_on_60e1(search, cant, amplitude, expected, tolerance):
    table = contact_table(cant=cant, search=search)
    assert_allclose(equivalent_conicity(table, amplitude), expected, atol=tolerance)


@pytest.mark.parametrize("search", SEARCHES)
def test_rail_of_the_manchester_benchmark_is_4_per_cent_more_conical(search):
    norm, benchmark = (contact_table(rail=r, search=search) for r in ("60E1", "UIC60_Manchester"))
    more = equivalent_conicity(benchmark, [0.003, 0.004]) / equivalent_conicity(norm, [0.003, 0.004]) - 1
    assert_allclose(more, 0.04, atol=0.006)


@pytest.mark.parametrize("search", SEARCHES)
def test_points_of_the_manchester_benchmark(search):
    wheel, rail = (DATA / f"MBench_{name}_v3_points.csv" for name in ("S1002", "UIC60"))
    if not (wheel.is_file() and rail.is_file()):
        pytest.skip(f"{DATA} is not there; the data come beside the repository")
    measured = contact_table(wheel, rail, cant=0.0, search=search)  # the rail's points are canted
    exact = contact_table(rail="UIC60_Manchester", search=search)
    amplitudes = [0.002, 0.003, 0.004]
    assert_allclose(
        equivalent_conicity(measured, amplitudes), equivalent_conicity(exact, amplitudes), rtol=5e-3
    )


@pytest.mark.parametrize("noise", [5e-6, 20e-6])
def test_conicity_of_noisy_points(tmp_path, noise):
    points = points_of("S1002", 700, np.random.default_rng(7), noise, begin=-0.068)
    file = write_points(tmp_path / "wheel.txt", points)
    for search in SEARCHES:
        found, true = (contact_table(w, search=search, shifts=SHIFTS) for w in (file, "S1002"))
        amplitudes = [0.003, 0.004]
        assert_allclose(
            equivalent_conicity(found, amplitudes), equivalent_conicity(true, amplitudes), rtol=0.03
        )


def test_conicity_of_a_noisy_pair(tmp_path):
    rng = np.random.default_rng(3)
    wheel = write_points(tmp_path / "wheel.txt", points_of("S1002", 700, rng, 1e-5, begin=-0.068))
    rail = write_points(tmp_path / "rail.txt", points_of("60E1", 500, rng, 1e-5))
    found, true = contact_table(wheel, rail, shifts=SHIFTS), contact_table(shifts=SHIFTS)
    amplitudes = [0.003, 0.004]
    assert_allclose(equivalent_conicity(found, amplitudes), equivalent_conicity(true, amplitudes), rtol=0.05)


# ---- the border


def test_shapes():
    y = np.linspace(-0.010, 0.010, 41)
    table = table_of(y, 0.1 * y)
    assert isinstance(equivalent_conicity(table, 0.003), float)
    assert equivalent_conicity(table, [[0.003, 0.004]]).shape == (1, 2)
    assert klingel_wavelength([0.1, 0.2], 0.46, 0.75).shape == (2,)
    assert_allclose(klingel_wavelength(0.05, 0.46, 0.75), 16.5046, rtol=1e-5)


def test_wrong_amplitudes_are_named():
    y = np.linspace(-0.010, 0.010, 41)
    table = table_of(y, 0.1 * y)
    for amplitude, words in [(0.011, "exceeds the table, which ends at 0.01 m"), (0.0, "amplitude must be")]:
        with pytest.raises(ValueError, match=words):
            equivalent_conicity(table, amplitude)
    with pytest.raises(ValueError, match="does not steer the wheelset back"):
        equivalent_conicity(table_of(y, -0.1 * y), 0.003)
    with pytest.raises(ValueError, match="on both sides of 0 m"):
        equivalent_conicity(table.loc[0.001:], 0.003)
    with pytest.raises(ValueError, match="conicity must be finite and greater than 0"):
        klingel_wavelength(0.0, 0.46, 0.75)
