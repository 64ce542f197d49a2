"""Kalker's creep coefficients: his table at its nodes, lines between them, the nearest row beyond."""

import json
from itertools import pairwise
from pathlib import Path

import casadi as cs
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact.kalker import NU, TABLE, coefficient

NAMES = ("c11", "c22", "c23", "c33")
SHARED = (
    Path(__file__).resolve().parents[1] / ".." / "shared" / "data" / "contact" / "kalker_coefficients.json"
)
ROWS = pd.read_csv(TABLE, comment="#")
RATIOS = sorted(set(ROWS["a_over_b"]))
names, nus = st.sampled_from(NAMES), st.sampled_from(NU)


def functions():
    r, nu = cs.SX.sym("r"), cs.SX.sym("nu")
    return {name: cs.Function(name, [r, nu], [coefficient(name, r, nu)]) for name in NAMES}


COEFFICIENT = functions()


def value(name, a_over_b, nu):
    return float(COEFFICIENT[name](a_over_b, nu))


@pytest.mark.parametrize("name", NAMES)
def test_nodes_of_the_table_are_reproduced(name):
    found = [value(name, row.a_over_b, row.nu) for row in ROWS.itertuples()]
    assert_allclose(found, ROWS[name], rtol=1e-12)


@given(names, nus, st.sampled_from(list(pairwise(RATIOS))), st.floats(0, 1))
def test_between_rows_the_value_is_on_the_line(name, nu, rows, part):
    low, high = rows
    ends = [value(name, r, nu) for r in rows]
    assert_allclose(
        value(name, low + part * (high - low), nu), ends[0] + part * (ends[1] - ends[0]), rtol=1e-9
    )


@given(names, nus, st.floats(1e-6, 0.1), st.floats(10.0, 1e6))
def test_beyond_the_table_the_nearest_row_holds(name, nu, small, large):
    assert value(name, small, nu) == value(name, RATIOS[0], nu)
    # the sum of ramps ends in rounding of the size of what it adds
    assert_allclose(value(name, large, nu), value(name, RATIOS[-1], nu), rtol=1e-12)


@given(names, st.floats(0.1, 10.0), st.floats(0.0, 0.5))
def test_poissons_ratio_enters_as_a_parabola(name, r, nu):
    by_fit = np.polyval(np.polyfit(NU, [value(name, r, n) for n in NU], 2), nu)
    assert_allclose(value(name, r, nu), by_fit, rtol=1e-9)


@given(names, st.floats(0.01, 100.0), st.floats(0.0, 0.5))
def test_coefficients_are_positive(name, r, nu):
    assert value(name, r, nu) > 0


def test_circular_patch_of_steel():
    # Kalker 1990, Table E.3 at a/b = 1: 3.40, 4.12, 5.20 for nu = 0, 0.25, 0.5; the parabola at 0.28
    assert_allclose(value("c11", 1.0, 0.28), 4.2306, rtol=1e-4)


def test_table_is_the_independent_transcription():
    if not SHARED.is_file():
        pytest.skip(f"{SHARED} is not there; the data come beside the repository")
    shared = json.loads(SHARED.read_text(encoding="utf-8"))
    assert tuple(shared["nu"]) == NU
    assert_allclose(sorted(row["a_over_b"] for row in shared["rows"]), RATIOS, rtol=1e-9)
    for row in shared["rows"]:
        for name in NAMES:
            assert_allclose(
                [value(name, row["a_over_b"], nu) for nu in NU], row[name], rtol=1e-9, err_msg=name
            )
