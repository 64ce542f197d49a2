"""The norm's test: its windows, its measured points, and that it finds a calculation or a reader wrong."""

import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from fmus.contact.geometry.exact import exact_profile
from fmus.errors import BadInput
from scenarios.cli.app import run_safely
from scenarios.conicity.norm.measuring import Instrument, reader_of
from scenarios.conicity.norm.pairs import references, tolerance, windows
from scenarios.conicity.norm.steps import step_1
from tests.helpers.paths import SHARED

DATA = SHARED / "data" / "en15302"
WHEEL = "EN15302_WheelB"
READERS = """
from dataclasses import replace
from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.profile import Polynomial

def perfect(path, kind):
    return exact_profile(path.stem)

def wrong(path, kind):
    found = perfect(path, kind)
    if kind == "rail":
        return found
    *flange, tread, field, chamfer = found.sections
    steep = Polynomial(tread.begin, tread.end, (0.0, 0.06))
    return replace(found, sections=(*flange, steep, field, chamfer))
"""


def no_reader(path, kind):
    raise AssertionError("is not read here")


def test_windows_hold_the_tolerance_and_a_moved_amplitude():
    assert_allclose(tolerance(np.array([0.0, 0.025, 0.1, 0.4])), [0, 0.0125, 0.05, 0.05])
    rows = pd.DataFrame({"conicity": [0.1, 0.025], "before": [0.09, 0.025], "behind": [0.2, 0.1]})
    low, high = windows(rows)
    assert_allclose(low, [0.045, 0.0125])
    assert_allclose(high, [0.25, 0.15])


def test_random_errors_stand_square_to_the_surface():
    instrument = Instrument(no_reader, random=1e-5)
    exact = exact_profile(WHEEL)
    points = instrument.points(WHEEL, "random", 0, 0)
    tread = points[np.abs(points[:, 0]) < 0.02]
    off = (tread[:, 1] - exact.height(tread[:, 0])) * np.cos(np.arctan(exact.slope(tread[:, 0])))
    assert_allclose(off.std(), 1e-5, rtol=0.25)  # 200 points: standard error 5 %
    assert_allclose(np.diff(tread[:, 0]).mean(), 2e-4, rtol=0.03)
    clean = Instrument(no_reader, random=0).points(WHEEL, "random", 0, 0)
    assert_allclose(clean[:, 1], exact.height(clean[:, 0]))


def test_grid_errors_put_points_on_a_grid():
    instrument = Instrument(no_reader, grid=5e-5)
    points = instrument.points(WHEEL, "grid", 3, 1)
    steps = (points - points[0]) / 5e-5
    assert_allclose(steps, np.round(steps), atol=1e-6)
    exact = exact_profile(WHEEL).height(points[:, 0])
    tread = np.abs(points[:, 0]) < 0.02
    assert 1e-5 < np.abs(points[:, 1] - exact)[tread].max() < 2.8e-5  # half a grid, and the slope of y's half


def test_draws_and_sides_differ_and_repeat():
    one, two = Instrument(no_reader), Instrument(no_reader)
    points = {(draw, side): one.points(WHEEL, "random", draw, side) for draw in (0, 1) for side in (0, 1)}
    for (draw, side), found in points.items():
        np.testing.assert_array_equal(found, two.points(WHEEL, "random", draw, side))
    assert len({found[10, 1] for found in points.values()}) == 4
    other = Instrument(no_reader, seed=2).points(WHEEL, "random", 0, 0)
    assert other[10, 1] != points[0, 0][10, 1]


def norm(out, *arguments):
    return run_safely(["conicity-norm", *map(str, arguments), "--out", str(out)])


@pytest.mark.slow
def test_a_perfect_reader_passes_and_a_wrong_one_does_not(tmp_path, capsys):
    file = tmp_path / "reader.py"
    file.write_text(READERS)
    given = ("--pair", "B", "--draws", 1)
    (tmp_path / "good").mkdir()
    (tmp_path / "good" / "norm.json").write_text("{}")
    assert norm(tmp_path / "good", *given, "--reader", f"{file}:perfect") == 0
    result = json.loads((tmp_path / "good" / "norm.json").read_text())
    assert [(r["error"], r["place"]) for r in result["step2"]] == [
        (error, place) for error in ("random", "grid") for place in ("wheel", "rail", "both")
    ]
    for row in result["step2"]:
        assert row["values"] == row["extended"] == 66
        assert row["std"] < 1e-12
        # step 2 has fewer shifts, which counts where B jumps to its root
        assert row["largest"] < 0.012
    assert result["step1"][0]["inside"] is None
    printed = capsys.readouterr()
    assert "step 1, B: no table" in printed.out
    assert "(norm.json, of 2" in printed.err.replace("\n", " ")  # the earlier one was replaced
    assert norm(tmp_path / "bad", *given, "--reader", f"{file}:wrong") == 1
    rows = pd.read_csv(tmp_path / "bad" / "step2.csv")
    assert not rows["passed"][rows["place"] != "rail"].any()
    assert rows["passed"][rows["place"] == "rail"].all()
    assert "<b>0 of 1</b>" in (tmp_path / "bad" / "norm.html").read_text()


def test_a_reader_that_cannot_be_used_is_named(tmp_path):
    file = tmp_path / "broken.py"
    file.write_text("import nothing_of_that_name\n")
    with pytest.raises(BadInput, match=r"cannot be loaded \(No module named 'nothing_of_that_name'\)"):
        reader_of(f"{file}:read", None)
    file.write_text("def other(path, kind): ...\n")
    with pytest.raises(BadInput, match="has no function 'read'"):
        reader_of(f"{file}:read", None)
    with pytest.raises(BadInput, match="gave a NoneType for EN15302_WheelB; return a Profile"):
        Instrument(reader_of(f"{file}:other", None)).profile(WHEEL, "grid", 0, 0)


def test_our_own_reader_measures_a_profile():
    found = Instrument(reader_of(None, None)).profile(WHEEL, "random", 0, 0)
    tread = np.linspace(-0.02, 0.025, 200)
    assert_allclose(found.slope(tread), exact_profile(WHEEL).slope(tread), atol=6e-3)
    assert "smoothed to" in found.found


def table_of_norm(folder, more=0.0):
    """The norm's files for pair A, made of our own conicities."""
    rows = references(["A"])[0].exact.iloc[::10]
    value = rows["conicity"].to_numpy() + more
    pd.DataFrame(
        {"amplitude_mm": 1e3 * rows.index.to_numpy(), "conicity": value, "low": value - tolerance(value),
         "high": value + tolerance(value)}
    ).to_csv(folder / "WheelARailA_conicity.csv", index=False)  # fmt: skip


def test_step_1_is_held_against_the_given_tables(tmp_path, capsys):
    table_of_norm(tmp_path)
    given = ("--pair", "A", "--draws", 0, "--reference", tmp_path)
    assert norm(tmp_path / "out", *given) == 0
    row = json.loads((tmp_path / "out" / "norm.json").read_text())["step1"][0]
    assert (row["inside"], row["amplitudes"]) == (7, 7)
    assert row["largest"] < 1e-9
    assert row["at_3"] == pytest.approx(0.188, abs=1e-3)
    assert not (tmp_path / "out" / "step2.csv").exists()
    table_of_norm(tmp_path, more=0.051)
    assert norm(tmp_path / "out", *given) == 1
    assert "<b>0 of 7</b>" in (tmp_path / "out" / "norm.html").read_text()
    assert "step 1, A: 0 of 7 inside" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("--pair", "D"), "--pair 'D' is no reference pair"),
        (("--random", 0.01), "--random 0.01: give it in m"),
        (("--grid", 0), "--grid 0: give it in m"),
        (("--reader", "nothing.py:f"), "--reader nothing.py:f: give FILE.py:FUNCTION"),
        (("--draws", -1), "draws"),
    ],
)
def test_wrong_input_is_one_line(tmp_path, capsys, given, words):
    out = tmp_path / "out"
    assert norm(out, *given) == 2
    said = capsys.readouterr().err.strip()
    assert words in said
    assert "\n" not in said
    assert not out.exists()


@pytest.mark.parametrize(
    ("table", "missing"),
    [("amplitude_mm,conicity\n1.0,0.1\n", "low"), ("amplitude_mm,low,high\n1.0,0.1,0.2\n", "conicity")],
)
def test_a_table_without_its_columns_is_refused(tmp_path, table, missing):
    (tmp_path / "WheelARailA_conicity.csv").write_text(table)
    with pytest.raises(BadInput, match=f"has no column '{missing}'"):
        step_1(references(["A"])[0], tmp_path)


@pytest.mark.parametrize("cells", ["1.0,x,0.1,0.2\n", ""], ids=["a word", "no rows"])
def test_a_table_without_numbers_is_refused(tmp_path, cells):
    (tmp_path / "WheelARailA_conicity.csv").write_text(f"amplitude_mm,conicity,low,high\n{cells}")
    with pytest.raises(BadInput, match="has no rows, or a cell that is not a number"):
        step_1(references(["A"])[0], tmp_path)


def test_step_1_of_the_norms_own_tables():
    if not DATA.is_dir():
        pytest.skip(f"{DATA} is not there; the data come beside the repository")
    for pair in references(["A", "Amod", "B", "AB"]):
        row = step_1(pair, DATA)
        assert row.passed
        assert row.inside == 33
        # misprints at 1.7 mm
        assert row.dr_points - row.dr_close == {"A": 2, "Amod": 1, "B": 0, "AB": 0}[pair.name]
        assert row.dr_largest < 0.05
