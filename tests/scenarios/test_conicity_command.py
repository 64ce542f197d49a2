"""`railfmi conicity`: what it writes of a pair, unlike sides, and one line for wrong input."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from fmus.contact import contact_table, equivalent_conicity
from scenarios.cli.app import run_safely
from scenarios.conicity.evaluating import AMPLITUDES, STEP, conicities
from tests.helpers.profile_files import points_of, write_points

A, B, RAIL = "EN15302_WheelA", "EN15302_WheelB", "EN15302_RailA"


def conicity(out, *arguments):
    return run_safely(["conicity", *map(str, arguments), "--out", str(out)])


def test_a_pair_is_written_as_page_json_and_csv(tmp_path, capsys):
    (tmp_path / "result.json").write_text("{}")
    assert conicity(tmp_path, "--wheel", A, "--rail", RAIL, "--gauge", 1.43516) == 0
    printed = capsys.readouterr()
    assert "(result.json, of 2" in printed.err.replace("\n", " ")  # the earlier one was replaced
    table = contact_table(
        A, RAIL, 0.0, 1.43516, search="rigid", roll=False, shifts=STEP * np.arange(-500, 501)
    )
    expected = equivalent_conicity(table, AMPLITUDES)
    rows = pd.read_csv(tmp_path / "conicity.csv")
    assert_allclose(rows["amplitude"], AMPLITUDES)
    assert_allclose(rows["conicity"], expected, rtol=1e-6)
    assert_allclose(rows["high"] - rows["low"], 2 * rows["amplitude"], rtol=1e-6)
    contact = pd.read_csv(tmp_path / "contact.csv", index_col="y")
    assert_allclose(contact["delta_r"], contact["r_left"] - contact["r_right"], atol=2e-9)
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["wheel"] == A
    assert (result["cant"], result["roll"], result["search"]) == (0.0, False, "rigid")
    assert_allclose(result["conicity"], expected)
    low, high = np.interp([2e-3, 4e-3], AMPLITUDES, expected)
    assert_allclose(result["nonlinearity_parameter"], (high - low) / 2e-3)
    at_3 = expected[AMPLITUDES.index(0.003)]
    assert f"3 mm: {at_3:.4f}" in printed.out
    page = (tmp_path / "conicity.html").read_text()
    assert f"Equivalent conicity {at_3:.3f} at 3 mm" in page
    assert page.count('<img src="data:image/png;base64,') == 3
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)  # it loads no other file
    for name in ("contact", "difference", "conicity"):
        assert (tmp_path / f"{name}.png").stat().st_size > 5000
        assert (tmp_path / f"{name}.svg").is_file()


@pytest.mark.parametrize("way", ["twice", "comma"])
def test_unlike_sides(tmp_path, way):
    sides = {"--wheel": (B, A), "--r0": ("0.459", "0.46")}
    arguments = []
    for name, (left, right) in sides.items():
        arguments += [name, left, name, right] if way == "twice" else [name, f"{left},{right}"]
    assert conicity(tmp_path, *arguments, "--rail", RAIL, "--gauge", 1.43516, "--amplitude", 0.003) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert (result["wheel"], result["r0"], result["amplitude"]) == ([B, A], [0.459, 0.46], [0.003])
    table = contact_table(
        (B, A), RAIL, 0.0, 1.43516, (0.459, 0.46), search="rigid", roll=False,
        shifts=STEP * np.arange(-500, 501),
    )  # fmt: skip
    assert_allclose(result["conicity"], [equivalent_conicity(table, 0.003)], rtol=1e-6)
    page = (tmp_path / "conicity.html").read_text()
    assert "459" in page
    assert B in page


@pytest.mark.slow
def test_point_files_rails_with_cant_and_roll(tmp_path):
    file = write_points(tmp_path / "worn, left.txt", points_of("S1002", 700, np.random.default_rng(7), 5e-6))
    given = ("--wheel", file, "--rail", "60E1", "--cant", "1/40", "--amplitude", "0.003,0.004")
    assert conicity(tmp_path / "a", *given, "--roll", "--search", "quasi_elastic") == 0
    result = json.loads((tmp_path / "a" / "result.json").read_text())
    table = contact_table(search="quasi_elastic")
    assert_allclose(result["conicity"], equivalent_conicity(table, [0.003, 0.004]), rtol=0.04)
    assert result["cant"] == pytest.approx(1 / 40)
    assert "points used; smoothed to" in (tmp_path / "a" / "conicity.html").read_text()


def test_without_a_motion_the_row_says_why():
    y = np.linspace(-0.01, 0.01, 201)
    rows = conicities(pd.DataFrame({"r_left": -0.1 * y, "r_right": 0.0}, index=y), [0.003])
    assert np.isnan(rows.loc[0.003, "conicity"])
    assert rows.loc[0.003, "linear"] == pytest.approx(-0.05)
    assert "does not steer the wheelset back" in rows.loc[0.003, "why"]


def test_a_cylinder_runs_straight_on_and_has_no_turning_points(tmp_path):
    given = ("--wheel", "EN15302_WheelI", "--rail", RAIL, "--gauge", 1.43516)
    assert conicity(tmp_path, *given, "--amplitude", "0.001,0.0016,0.003") == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["conicity"][:2] == [0.0, 0.0]
    assert result["low"][:2] == [None, None]
    assert result["conicity"][2] > 0.1
    assert result["why"] == {}


def test_a_motion_far_to_one_side_is_followed(tmp_path):
    """Its one turning point is more than 10 mm from the middle, beyond the shifts of a default table."""
    given = ("--wheel", "EN15302_WheelC,EN15302_WheelI", "--rail", RAIL, "--r0", "0.459,0.46")
    assert conicity(tmp_path, *given, "--gauge", 1.43516, "--amplitude", 0.0071) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["why"] == {}
    assert max(abs(result["low"][0]), result["high"][0]) > 0.0100


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"--amplitude": "3"}, "--amplitude 3: give amplitudes in m, above 0 and up to 0.05"),
        ({"--amplitude": "0.02"}, "--amplitude 0.02: the contact can be followed to 0.014 m"),
        ({"--amplitude": "3mm"}, "--amplitude '3mm' is no number"),
        ({"--wheel": f"{A},{A},{B}"}, "--wheel is given 3 times"),
        ({"--wheel": "EN15302_WheelD"}, "is neither a file nor an exact profile; did you mean"),
        ({"--cant": "1/40"}, "already inclined; give cant = 0"),
        ({"--r0": "460"}, "r0 = 460 must be from 0.05 to 2; give it in SI units"),
        ({"--search": "soft"}, "search = 'soft' is not known"),
    ],
)
def test_wrong_input_is_one_line(tmp_path, capsys, changed, words):
    given = {"--wheel": A, "--rail": RAIL, "--gauge": "1.43516"} | changed
    out = tmp_path / "out"
    assert conicity(out, *(part for pair in given.items() for part in pair)) == 2
    said = capsys.readouterr().err.strip()
    assert words in said
    assert "\n" not in said
    assert not out.exists()
