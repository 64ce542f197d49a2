"""Kalker's creep coefficients: his table at its rows, between them, its limits beyond, the polynomials."""

import json
from itertools import pairwise

import casadi as cs
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact.forces.coefficients import (
    NU,
    TABLE,
    coefficients,
    kalker,
)
from tests.helpers.paths import SHARED

NAMES = ("c11", "c22", "c23", "c33")
SHARED = SHARED / "data" / "contact" / "kalker_coefficients.json"
ROWS = pd.read_csv(TABLE, comment="#")
SMALLER = np.arange(1, 11) / 10  # of a/b and b/a, at the rows
columns, nus, sides = st.integers(0, 3), st.sampled_from(NU), st.sampled_from([1, -1])
ratios, poisson = st.floats(1e-6, 1e6), st.floats(0.0, 0.5)


def value(column, a_over_b, nu, source="table"):
    return kalker(a_over_b, nu, source)[column]


@pytest.mark.parametrize("column", range(4))
def test_rows_of_the_table_are_reproduced(column):
    found = value(column, ROWS["a_over_b"], ROWS["nu"])
    assert_allclose(found, ROWS[NAMES[column]], rtol=2e-6)  # a/b has six digits in the file
    rows = ROWS[ROWS["a_over_b"] <= 1]
    assert_allclose(value(column, rows["a_over_b"], rows["nu"]), rows[NAMES[column]], rtol=1e-12)


@given(columns, nus, sides, st.sampled_from(list(pairwise(SMALLER))), st.floats(0, 1))
def test_between_rows_the_value_is_on_the_line_over_the_smaller_ratio(column, nu, side, rows, part):
    ends = [value(column, g**side, nu) for g in rows]
    g = rows[0] + part * (rows[1] - rows[0])
    assert_allclose(value(column, g**side, nu), ends[0] + part * (ends[1] - ends[0]), rtol=1e-9)


@given(columns, st.floats(0.1, 10.0), poisson)
def test_poissons_ratio_enters_as_a_parabola_of_the_inverse(column, r, nu):
    inverse = np.polyval(np.polyfit(NU, [1 / value(column, r, n) for n in NU], 2), nu)
    assert_allclose(value(column, r, nu), 1 / inverse, rtol=1e-9)


@given(ratios, poisson)
def test_coefficients_are_positive(r, nu):
    assert min(kalker(r, nu)) > 0


@given(columns, nus, sides)
def test_the_table_goes_over_into_its_limits_without_a_step(column, nu, side):
    inside, beyond = (value(column, (0.1 * (1 + off)) ** side, nu) for off in (1e-9, -1e-9))
    assert_allclose(beyond, inside, rtol=1e-7)


def test_very_slender_ellipses():
    # Kalker 1990, Table E.3: strip theory across, pi²/4 over 1 - nu along; pi²/(16 (1 - nu) g) for spin
    g, nu = 1e-6, 0.28
    c11, c22, _, c33 = kalker(g, nu)
    assert_allclose([c11, c22], [np.pi**2 / 4 / (1 - nu), np.pi**2 / 4], rtol=1e-5)
    assert_allclose(c33, np.pi**2 / 16 / (1 - nu) / g, rtol=1e-5)
    # c33 along, at nu = 0
    assert_allclose(value(3, 1 / g, 0.0), np.pi / 4, rtol=1e-5)


@given(ratios)
def test_without_poissons_ratio_a_half_space_is_as_stiff_along_as_across_the_slip(r):
    c11, c22, _, _ = kalker(r, 0.0)
    assert_allclose(c11, c22, rtol=1e-12)


def test_circular_patch_of_steel():
    # Kalker 1990, Table E.3 at a/b = 1: 3.40, 4.12, 5.20 for nu = 0, 0.25, 0.5; 1/c at 0.28 by the parabola
    assert_allclose(value(0, 1.0, 0.28), 4.2262, rtol=1e-5)


@pytest.mark.parametrize(
    ("column", "worst"), list(zip(range(4), (0.014, 0.021, 0.193, 0.07), strict=True)), ids=NAMES
)
def test_polynomials_are_the_table_to_their_known_errors(column, worst):
    found = value(column, ROWS["a_over_b"].clip(upper=10), ROWS["nu"], "polynomial")
    error = np.abs(found / ROWS[NAMES[column]] - 1)
    assert 0.9 * worst < error.max() < worst
    assert error[ROWS["a_over_b"].between(0.3, 3.34)].max() < 0.026


def test_numbers_are_the_independent_transcription():
    if not SHARED.is_file():
        pytest.skip(f"{SHARED} is not there; the data come beside the repository")
    shared = json.loads(SHARED.read_text(encoding="utf-8"))
    assert tuple(shared["nu"]) == NU
    for row in shared["rows"]:
        found = np.array(kalker(row["a_over_b"], np.array(NU)))
        assert_allclose(found, [row[name] for name in NAMES], rtol=2e-6, err_msg=str(row["a_over_b"]))


def test_polynomials_are_the_independent_transcription():
    if not SHARED.is_file():
        pytest.skip(f"{SHARED} is not there; the data come beside the repository")
    thesis = json.loads(SHARED.read_text(encoding="utf-8"))["thesis_appendix_A"]
    r, nu = 1.7, 0.28
    powers = {"k33": (1, 1 / r, 1 / r**2, 1 / r**3), "k23": (1, r, r**2, r**3)}
    for column, name in enumerate(("k11", "k22", "k23", "k33")):
        k = np.array(thesis[name]) @ (1, nu, nu**2)
        expected = k @ powers.get(name, (1, r, r**2, np.sqrt(r)))
        assert_allclose(value(column, r, nu, "polynomial"), expected, rtol=1e-12)


def test_expressions_have_finite_derivatives():
    r, nu = cs.SX.sym("r"), cs.SX.sym("nu")
    slope = cs.Function("slope", [r, nu], [cs.jacobian(cs.vertcat(*coefficients(r, nu)), cs.vertcat(r, nu))])
    for ratio in (1e-8, 0.1, 0.35, 1.0, 1.25, 10.0, 1e8):
        for poisson_ratio in (0.0, 0.28, 0.5):
            assert np.isfinite(slope(ratio, poisson_ratio).full()).all()


def test_floats_give_floats_and_arrays_broadcast():
    assert all(type(c) is float for c in kalker(1, 0.28))
    found = kalker(np.ones((3, 1)), np.array([0.0, 0.25]))
    assert [c.shape for c in found] == [(3, 2)] * 4
    assert kalker(np.ones((0, 2)), 0.25)[0].shape == (0, 2)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"a_over_b": 0.0}, "a_over_b must be finite and greater than 0"),
        ({"a_over_b": 20.0, "source": "polynomial"}, "a_over_b must be finite and from 0.1 to 10"),
        ({"nu": 0.6}, "nu must be finite and from 0 to 0.5"),
        ({"source": "tabel"}, "source 'tabel' is not known; did you mean 'table'"),
    ],
)
def test_what_physics_does_not_allow_is_named(wrong, words):
    with pytest.raises(ValueError, match=words):
        kalker(**{"a_over_b": 1.0, "nu": 0.25} | wrong)
