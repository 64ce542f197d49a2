"""Campaigns: points where they should be, Sobol's indices of a function that is known, clear errors."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import sobol_indices

from fmus.errors import BadInput
from fmus.host.apart.isolation import ISOLATED
from scenarios.campaign.declaration import Declaration, Range
from scenarios.campaign.indices import estimates, indices_of, tail
from scenarios.campaign.policy import POLICY
from scenarios.campaign.sampling import points_of, value_at
from tests.helpers.paths import ROOT

pytest.importorskip("distributed", reason="the extra 'fleet' is not installed")

from scenarios.campaign.campaign import assembled, campaign, write_tables
from scenarios.campaign.planning import plan_of
from scenarios.campaign.result import measured

SHIPPED = ROOT / "scenarios" / "shipped" / "campaign" / "settling.toml"
STEP = ROOT / "scenarios" / "shipped" / "step_of_both_bogies.toml"
TEXT = f"""
id = "one"
scenario = "{STEP}"
sample = "grid"

[set]
duration = 1.2

[vary]
"fmus.vehicle.parameters.k1" = {{values = [4e5, 5e5]}}

[measure]
highest = "max(vehicle.z1)"
"""


def declared(sample: str, n: int | None, **vary) -> Declaration:
    return Declaration.model_validate(
        {"id": "x", "scenario": "x.toml", "sample": sample, "n": n, "vary": vary, "measure": {"y": "0"}}
    )


def ishigami(x: np.ndarray, a: float = 7.0, b: float = 0.1) -> np.ndarray:
    """The function of T. Ishigami and T. Homma (ISUMA 1990), (n,) from (n, 3)."""
    return np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])


def ishigami_indices(a: float = 7.0, b: float = 0.1) -> tuple[list[float], list[float]]:
    """First and total indices in closed form."""
    one = 0.5 * (1 + b * math.pi**4 / 5) ** 2
    two, both = a**2 / 8, b**2 * math.pi**8 * (1 / 18 - 1 / 50)
    whole = one + two + both
    return [one / whole, two / whole, 0.0], [(one + both) / whole, two / whole, both / whole]


def test_the_indices_of_a_known_function_lie_in_their_intervals():
    """And the intervals are narrow enough to say something."""
    pi = {"low": -math.pi, "high": math.pi}
    d = declared("sobol", 1024, x1=pi, x2=pi, x3=pi)
    x = np.array([[*p.values()] for p in points_of(d)])
    found = indices_of("y", [*d.vary], ishigami(x), seed=0)
    for index, first, total in zip(found, *ishigami_indices(), strict=True):
        assert index.first_low - 0.01 <= first <= index.first_high + 0.01
        assert index.total_low - 0.01 <= total <= index.total_high + 0.01
        assert index.first == pytest.approx(first, abs=0.05)
        assert index.total == pytest.approx(total, abs=0.05)
        assert index.total_high - index.total_low < 0.25


@pytest.mark.slow
def test_the_intervals_hold_as_often_as_the_page_says():
    """Tolerance: 40 samples of six intervals, which are not independent, and 95 %."""
    pi, held = {"low": -math.pi, "high": math.pi}, []
    for seed in range(40):
        d = declared("sobol", 64, x1=pi, x2=pi, x3=pi).model_copy(update={"seed": seed})
        x = np.array([[*p.values()] for p in points_of(d)])
        found = indices_of("y", [*d.vary], ishigami(x), seed)
        for i, first, total in zip(found, *ishigami_indices(), strict=True):
            held += [i.first_low <= first <= i.first_high, i.total_low <= total <= i.total_high]
    assert np.mean(held) >= 0.9


def test_intervals_of_few_points_are_wider_than_plain_quantiles():
    """And those of many are plain quantiles. Eight points: 87 % of the plain intervals held, see the page."""
    ends = [tail(n) for n in (8, 16, 64, 4096)]
    assert ends == sorted(ends)
    assert ends[0] < 0.25 * (1 - POLICY.confidence) / 2 * 1.05
    assert ends[-1] == pytest.approx((1 - POLICY.confidence) / 2, rel=5e-3)


def test_intervals_of_eight_points_hold_nine_times_in_ten():
    pi, held = {"low": -math.pi, "high": math.pi}, []
    for seed in range(25):
        d = declared("sobol", 8, x1=pi, x2=pi, x3=pi).model_copy(update={"seed": seed})
        x = np.array([[*p.values()] for p in points_of(d)])
        for i, first, total in zip(
            indices_of("y", [*d.vary], ishigami(x), seed), *ishigami_indices(), strict=True
        ):
            held += [i.first_low <= first <= i.first_high, i.total_low <= total <= i.total_high]
    assert np.mean(held) >= 0.9


def test_too_few_points_have_no_indices():
    values = np.random.default_rng(1).normal(size=3 * (POLICY.fewest - 1))
    assert indices_of("y", ["x"], values, seed=0) == []


def test_complete_points_have_the_indices_of_scipy():
    values = np.random.default_rng(1).normal(size=(5, 32))
    known = sobol_indices(func={"f_A": values[:1], "f_B": values[1:2], "f_AB": values[2:, None]}, n=32)
    np.testing.assert_allclose(estimates(values), [known.first_order, known.total_order], rtol=1e-12)


def test_one_key_alone_causes_all():
    d = declared("sobol", 64, x={"low": 0.0, "high": 1.0})
    [index] = indices_of("y", ["x"], np.array([p["x"] for p in points_of(d)]), seed=0)
    assert index.first == pytest.approx(1.0, abs=0.2)
    assert index.total == pytest.approx(1.0, abs=0.2)


def test_a_key_that_changes_nothing_has_indices_of_zero():
    unit = {"low": 0.0, "high": 1.0}
    d = declared("sobol", 64, x=unit, idle=unit)
    values = np.array([p["x"] for p in points_of(d)])
    index = indices_of("y", [*d.vary], values, seed=0)[1]
    assert (index.first, index.total) == pytest.approx((0.0, 0.0), abs=0.05)
    assert index.total_low == index.total_high == 0.0


def test_points_without_a_value_are_left_out_as_whole_base_points():
    unit = {"low": 0.0, "high": 1.0}
    d = declared("sobol", 64, x=unit, y=unit)
    values = np.array([p["x"] + p["y"] for p in points_of(d)])
    values[[3, 64 + 5, 3 * 64 + 7]] = np.nan
    assert {i.used for i in indices_of("y", [*d.vary], values, seed=0)} == {61}
    assert indices_of("y", [*d.vary], np.full_like(values, np.nan), seed=0) == []
    assert indices_of("y", [*d.vary], np.ones_like(values), seed=0) == []


def test_sobols_points_change_one_key_at_a_time():
    unit = {"low": 0.0, "high": 1.0}
    points = points_of(declared("sobol", 8, a=unit, b=unit, c=unit))
    assert len(points) == 8 * (3 + 2)
    table = np.array([[*p.values()] for p in points]).reshape(5, 8, 3)
    for i in range(3):
        expected = table[0].copy()
        expected[:, i] = table[1][:, i]
        np.testing.assert_array_equal(table[2 + i], expected)
    assert len({*map(tuple, table[:2].reshape(-1, 3).tolist())}) == 16


def test_more_of_sobols_points_keep_those_before():
    unit = {"low": 0.0, "high": 1.0}
    few, many = ({*map(str, points_of(declared("sobol", n, a=unit, b=unit)))} for n in (8, 16))
    assert few < many


@given(st.integers(2, 40), st.integers(0, 99))
def test_a_latin_hypercube_has_one_point_in_each_part_of_each_range(n, seed):
    d = declared("latin-hypercube", n, a={"low": 0.0, "high": 1.0}, b={"low": 5.0, "high": 7.0})
    table = np.array([[*p.values()] for p in points_of(d.model_copy(update={"seed": seed}))])
    for column, low, high in ((0, 0.0, 1.0), (1, 5.0, 7.0)):
        parts = np.floor((table[:, column] - low) / (high - low) * n)
        assert sorted(parts.tolist()) == [*range(n)]


def test_a_grid_has_all_combinations():
    d = declared("grid", None, a={"values": ["x", "y"]}, b={"low": 1.0, "high": 100.0, "points": 3,
                 "scale": "log"}, s={"low": 3, "high": 5, "whole": True})  # fmt: skip
    points = points_of(d)
    assert len(points) == 2 * 3 * 3
    assert {p["a"] for p in points} == {"x", "y"}
    assert sorted({p["b"] for p in points}) == pytest.approx([1.0, 10.0, 100.0])
    assert {p["s"] for p in points} == {3, 4, 5}


@given(st.floats(0, 1, exclude_max=True))
def test_values_lie_within_their_range(u):
    assert 2.0 <= value_at(Range(low=2.0, high=3.0), u) <= 3.0
    assert 0.01 * (1 - 1e-9) <= value_at(Range(low=0.01, high=100.0, scale="log"), u) <= 100.0 * (1 + 1e-9)
    assert value_at(Range(low=1, high=6, whole=True), u) in range(1, 7)
    assert value_at(Range(values=("a", "b", "c")), u) in "abc"
    assert math.isfinite(value_at(Range(mean=0.0, std=1.0), u))


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = folder / "campaign.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('sample = "grid"', 'sample = "sobol"', "key 'n' is missing"),
        ('sample = "grid"', 'sample = "sobol"\nn = 12', "is no power of two"),
        ('sample = "grid"', 'sample = "grid"\nn = 12', "'n' is not for a grid"),
        ("values = [4e5, 5e5]", "low = 1.0", "needs 'low' and 'high'"),
        ("values = [4e5, 5e5]", "low = 1.0, high = 2.0", "needs 'values', or 'low', 'high' and 'points'"),
        ("values = [4e5, 5e5]", "low = 1.0, high = 2.0, mean = 1.0", "either 'low' and 'high', or 'mean'"),
        ("values = [4e5, 5e5]", 'low = 0.0, high = 2.0, points = 3, scale = "log"', "has no logarithm"),
        ("values = [4e5, 5e5]", "low = 0, high = 1000000000000, whole = true", "for 1000000000001 points"),
        ("values = [4e5, 5e5]", "low = 0, high = 1e300, whole = true", "asks for more than 10^15 points"),
        ("values = [4e5, 5e5]", "low = 1.0, high = 2.0, points = 1000001", "asks for 1000001 points, and"),
        ('sample = "grid"', 'sample = "sobol"\nn = 1048576', "asks for 3145728 points"),
        ('sample = "grid"', 'sample = "latin-hypercube"\nn = 4000000000', "asks for 4000000000 points"),
        ("values = [4e5, 5e5]", "values = [1979-05-27]", "fmus.vehicle.parameters"),
        ("fmus.vehicle.parameters.k1", "fmus.vehicle.parameters.k1 k2", "is no key of TOML"),
        ("fmus.vehicle.parameters.k1", "duration.k1", "'duration' is no table"),
        ("fmus.vehicle.parameters.k1", "expect.9.that", "is no number of a list"),
        ("fmus.vehicle.parameters.k1", "fmus.vehicle.paramters.k1", "did you mean 'parameters'"),
        ("max(vehicle.z1)", "max(vehicle.z1", "key 'measure.highest'"),
        ("duration = 1.2", "duration = -1.0", "duration"),
        (f'"{STEP}"', '"none.toml"', "cannot be read"),
        ('id = "one"', 'id = "one"\nvariant = "wet"', "there is no variant 'wet'"),
        ('id = "one"', 'id = "one"\nmesure = 1', "did you mean 'measure'"),
    ],
)
def test_what_is_wrong_in_the_file_is_one_line_that_names_it(old, new, said, tmp_path):
    with pytest.raises(BadInput) as caught:
        plan_of(written(tmp_path, (old, new)), ISOLATED)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_value_that_no_scenario_takes_is_a_point_that_fails(tmp_path):
    """Only the first point is tried before; a date has no form in JSON, by which points are known."""
    plan = plan_of(written(tmp_path, ("[4e5, 5e5]", "[4e5, 1979-05-27]")), ISOLATED)
    assert len({task.key for task in plan.tasks}) == 2
    found = assembled(plan, {}, {}, 1.0)
    write_tables(tmp_path / "out", found)
    kept = pq.read_table(tmp_path / "out" / "points.parquet")
    assert kept["fmus.vehicle.parameters.k1"].to_pylist() == ["400000.0", '"1979-05-27"']


def test_a_task_is_known_by_all_that_its_answer_follows_from(tmp_path):
    first = plan_of(written(tmp_path), ISOLATED)
    assert len({t.key for t in first.tasks}) == 2
    again = plan_of(written(tmp_path, ('id = "one"', 'id = "other"')), ISOLATED)
    assert [t.key for t in again.tasks] == [t.key for t in first.tasks]
    more = plan_of(written(tmp_path, ("[4e5, 5e5]", "[4e5, 6e5]")), ISOLATED)
    assert [a.key == b.key for a, b in zip(first.tasks, more.tasks, strict=True)] == [True, False]
    for change in (("1.2", "1.3"), ("max(", "min(")):
        changed = plan_of(written(tmp_path, change), ISOLATED)
        assert not {t.key for t in changed.tasks} & {t.key for t in first.tasks}


def test_data_and_their_units_are_part_of_the_tasks(tmp_path):
    step, one = STEP.read_text(encoding="utf-8"), '"vehicle.u_fl" = "1e-3 * step(t - 1)"'
    assert one in step
    push = '"vehicle.u_fl" = {data = "push.csv", time = "t", column = "u"}'
    (tmp_path / "step.toml").write_text(step.replace(one, push))
    file = written(tmp_path, (str(STEP), "step.toml"))
    found = []
    for name, text in (
        ("push.csv", "t,u\n0,0\n1,1\n"), ("push.csv", "t,u\n0,0\n1,2\n"),
        ("push.csv.units.json", '{"u": "m"}'), ("push.csv.units.json", '{"u": "mm"}'),
    ):  # fmt: skip
        (tmp_path / name).write_text(text)
        found.append({t.key for t in plan_of(file, ISOLATED).tasks})
    assert len(set.union(*found)) == 2 * 4


def answers_of(plan, value) -> dict:
    """Answers of all points, from a function of their values."""
    return {
        t.key: {"key": t.key, "verdict": "done", "values": {m: value(p) for m in plan.declared.measure}}
        for t, p in zip(plan.tasks, plan.points, strict=True)
    }


def test_a_point_that_fails_is_a_row_with_its_reason(tmp_path):
    plan = plan_of(written(tmp_path), ISOLATED)
    answers = answers_of(plan, lambda p: p["fmus.vehicle.parameters.k1"])
    bad, open_ = plan.tasks[0].key, plan.tasks[1].key
    answers[bad] = {"key": bad, "verdict": "failed", "reason": "too stiff", "values": {}}
    del answers[open_]
    found = assembled(plan, answers, {open_: "no disk"}, 1.0)
    assert [row["reason"] for row in found.rows] == ["too stiff", "no disk"]
    assert found.result.tasks == {"planned": 2, "finished": 1, "failed": 1, "left": 1}
    assert not found.result.complete
    assert found.result.measured[0].points == 0


def test_the_tables_of_the_shipped_campaign_have_all_points_and_the_same_bytes(tmp_path):
    plan = plan_of(SHIPPED, ISOLATED)
    d = plan.declared
    found = assembled(plan, answers_of(plan, lambda p: sum(map(float, p.values()))), {}, 1.0)
    for name in ("one", "two"):
        write_tables(tmp_path / name, found)
    for file in ("points.parquet", "indices.parquet"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
    table = pq.read_table(tmp_path / "one" / "points.parquet").to_pandas()
    assert len(table) == (d.n or 0) * (len(d.vary) + 2)
    assert {*d.vary, *d.measure} <= {*table.columns}
    assert len(found.result.indices) == len(d.vary) * len(d.measure)


def test_measures_are_counted_over_what_gave_a_number():
    m = measured("y", [1.0, None, 3.0, 2.0])
    assert (m.points, m.least, m.greatest, m.mean, m.quantiles[1]) == (3, 1.0, 3.0, 2.0, 2.0)
    assert m.std == pytest.approx(1.0)


@pytest.mark.slow
def test_a_campaign_from_its_file_to_its_page(tmp_path):
    result = campaign(written(tmp_path), tmp_path / "out", workers=1)
    assert result.tasks == {"planned": 2, "finished": 2, "failed": 0, "left": 0}
    table = pq.read_table(tmp_path / "out" / "points.parquet").to_pandas()
    assert (table["highest"] > 0).all()
    assert table["highest"].nunique() == 2
    before = (tmp_path / "out" / "points.parquet").read_bytes()
    assert campaign(written(tmp_path), tmp_path / "out", workers=2).tasks == result.tasks
    assert (tmp_path / "out" / "points.parquet").read_bytes() == before
    assert json.loads((tmp_path / "out" / "result.json").read_text())["campaign"] == "one"
    assert "2 points (grid)" in (tmp_path / "out" / "campaign.html").read_text()
    assert not (tmp_path / "out" / ".builds").exists()


@pytest.mark.slow
def test_a_name_that_no_fmu_has_fails_every_point_and_is_told(tmp_path):
    """As a command, since the workers' event loop outlives a test."""
    file = written(tmp_path, ("parameters.k1", "parameters.stiffness"))
    run = [sys.executable, "-m", "railfmi", "campaign", str(file), "--out", str(tmp_path / "out")]
    found = subprocess.run([*run, "--workers", "1", "-q"], cwd=ROOT, capture_output=True, text=True)
    assert found.returncode == 2
    assert "every point failed, the first one so: " in found.stderr
    assert "stiffness" in found.stderr
    assert not (tmp_path / "out" / "result.json").exists()
