"""From Python: an experiment as a table or an object, a record as a DataFrame, results that show."""

import dataclasses
import inspect
import json
import tomllib
from typing import get_type_hints

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from numpy.testing import assert_array_equal

import railfmi
from fmus.errors import BadInput
from fmus.host.fmu import Fmu
from scenarios.closing.result import Effect, Result
from scenarios.closing.several_results import Results
from scenarios.comparing.result import Comparison, Difference
from scenarios.experiment.experiment import Experiment, load_experiment
from scenarios.experiment.given import given
from scenarios.experiment.record import load_record
from scenarios.shown import Shown
from tests.helpers.experiment_files import GOOD, RIG, assert_one_clear_line, table, write
from tests.helpers.paths import SHIPPED

FRICTION = SHIPPED / "demo" / "rig-friction"


@pytest.fixture
def _no_screen(monkeypatch):
    """Figures are made without a screen, and closed."""
    matplotlib.use("Agg")
    yield
    matplotlib.pyplot.close("all")


def frame() -> pd.DataFrame:
    return pd.DataFrame(table())


@pytest.mark.parametrize("as_index", [True, False])
@pytest.mark.parametrize("how", ["file", "folder", "table", "object"])
def test_an_experiment_may_be_given_in_any_way(tmp_path, how, as_index):
    file = write(tmp_path)
    reference = load_record(load_experiment(file), RIG)
    ways = {
        "file": file, "folder": tmp_path, "table": tomllib.loads(GOOD), "object": load_experiment(file),
    }  # fmt: skip
    data = pd.read_csv(tmp_path / "data.csv")
    data.attrs["units"] = {"torque": "N.m", "n_wheel": "rpm"}
    (tmp_path / "data.csv").unlink()  # the record is the table alone
    (tmp_path / "work").mkdir()
    data = data.set_index("time") if as_index else data
    e = given(ways[how], None, data, tmp_path / "work")
    record = load_record(e, RIG)
    assert_array_equal(record.runs[0].y, reference.runs[0].y)
    assert_array_equal(record.runs[0].u, reference.runs[0].u)
    assert {c.variable: c.unit for c in record.conversions}["T_P"] == "N.m"


def test_units_of_a_frame_are_compared_with_the_declared_ones(tmp_path):
    data = frame()
    data.attrs["units"] = {"n_wheel": "rad/s"}
    with pytest.raises(BadInput, match="states 'rad/s' for it"):
        load_record(given(write(tmp_path), None, data, tmp_path), RIG)


def test_a_frame_without_the_time_is_refused(tmp_path):
    file = write(tmp_path)
    with pytest.raises(BadInput) as refused:
        given(file, None, frame().drop(columns="time"), tmp_path)
    assert_one_clear_line(refused, file, "column 'time' is neither a column nor the index of the data")


def test_a_wrong_table_is_one_clear_line(tmp_path):
    with pytest.raises(BadInput, match="experiment: key 'idd' is not known; did you mean 'id'"):
        given({**tomllib.loads(GOOD), "idd": "x"}, None, None, tmp_path)


@pytest.mark.usefixtures("_no_screen")
def test_an_estimate_from_a_table_and_a_frame_shows_itself(tmp_path):
    e = tomllib.loads((FRICTION / "experiment.toml").read_text())
    data = pd.read_csv(FRICTION / "data.csv").iloc[:400].set_index("time")
    del e["data"], e["split"]
    result = railfmi.estimate(e, data=data)
    assert repr(result).startswith("omega_w = ")
    found = result.to_frame()
    assert list(found.index) == list(result.estimated)
    assert found.loc["mu0", "value"] == result.estimated["mu0"]["value"]
    assert "<table" in result._repr_html_()
    assert isinstance(result.plot(), Axes)


def a_result(**more) -> Result:
    blank = {f.name: {} for f in dataclasses.fields(Result) if "dict" in str(f.type)}
    blank |= {f.name: [] for f in dataclasses.fields(Result) if str(f.type).startswith("list")}
    values = {
        "experiment": "motor", "verdict": "traced", "policy": "1", "wall_seconds": 1.0,
        "reason": "a <law> accounts for the residual", "next_experiment": "",
        "effects": [Effect("coulomb_friction", "shaft", {"F_c": [0.012, 2e-4]})],
        "error": {
            "omega": {"declared": 9.0, "before": 5.0, "after": 0.3, "noise": 0.2},
            "i": {"declared": 0.4, "before": 0.2, "after": 0.01, "noise": 0.01},
        },
    }  # fmt: skip
    return Result(**{**blank, **values, **more})


@pytest.mark.usefixtures("_no_screen")
def test_a_result_shows_itself(tmp_path):
    result = a_result()
    assert repr(result).splitlines()[:2] == [
        "traced: a <law> accounts for the residual",
        "  coulomb_friction at shaft: F_c = 0.012 ± 0.0002",
    ]
    assert result.to_frame().loc["omega", "after"] == 0.3
    assert "a &lt;law&gt; accounts" in result._repr_html_()
    drawn = result.plot()
    heights = sorted(bar.get_height() for bar in drawn.patches)
    np.testing.assert_allclose(heights, sorted([25.0, 1.5, 20.0, 1.0]))
    assert result.plot(drawn) is drawn
    result.write(tmp_path / "result.json")
    assert json.loads((tmp_path / "result.json").read_text())["error"]["i"]["noise"] == 0.01


def returned() -> dict[str, type]:
    """What each public function returns, where that is a result of its own."""
    found = {}
    for name in railfmi.__all__:
        of = getattr(railfmi, name)
        kind = get_type_hints(of).get("return") if inspect.isfunction(of) else None
        if isinstance(kind, type) and kind.__module__.startswith("scenarios.") and kind is not Experiment:
            found[name] = kind
    return found


def test_every_result_shows_itself():
    found = returned()
    assert {"close_loop", "close_loops", "estimate", "plan", "report", "init", "inspect", "dry_run"} <= set(
        found
    )
    for name, kind in found.items():
        assert issubclass(kind, Shown), name
        assert kind.__repr__ is Shown.__repr__, name  # a dataclass would bring its own


def assert_shown(result: Shown) -> None:
    """What a notebook asks of a result."""
    assert repr(result) == "\n".join(result.lines())
    assert "<table" in result._repr_html_()
    assert len(result.to_frame())
    assert isinstance(result.plot(), Axes)


@pytest.mark.usefixtures("_no_screen")
def test_results_of_the_way_in_and_of_several_show_themselves(built, tmp_path):
    t = np.arange(300) * 0.01
    F = 100 * np.sin(3 * t)
    with Fmu(built("drive")) as drive:
        measured = drive.simulate_frame(t, {"F": F}, ["q", "q_dot"])
    measured.assign(F=F).to_csv(tmp_path / "data.csv")
    fmu, record = railfmi.inspect(built("drive")), railfmi.inspect(tmp_path / "data.csv")
    for seen in (fmu, record):
        assert_shown(seen)
    assert fmu.to_frame().loc["q", "unit"] == "m"
    assert record.to_frame().loc["F", "greatest"] == pytest.approx(100, rel=1e-3)
    begun = railfmi.init(built("drive"), tmp_path / "data.csv", out=tmp_path)
    assert_shown(begun)
    assert list(begun.to_frame()["column"]) == ["F", "q", "q_dot"]
    tried = railfmi.dry_run(begun.file)
    assert_shown(tried)
    assert tried.to_frame().loc["q_dot", "factor"] == pytest.approx(1.0, rel=1e-2)
    first = a_result()
    both = Results([first, dataclasses.replace(first, experiment="again")])
    assert_shown(both)
    assert both.to_frame().loc["again", "before"] == 5.0
    first.write(tmp_path / "result.json")
    assert_shown(railfmi.report(tmp_path))


SCENARIO = """
id = "push"
question = "How far does a force move a carriage?"
duration = 1.0
step = 0.01
fmus.drive.fmu = "{fmu}"
inputs."drive.F" = 95.0

[[expect]]
that = "last(drive.q) > 0"
because = "it is pushed forward"

[[expect]]
that = "last(drive.q) < 0"
because = "it is not pulled back"
"""


@pytest.mark.usefixtures("_no_screen")
def test_a_run_and_a_comparison_are_tables(built, tmp_path):
    (tmp_path / "push.toml").write_text(SCENARIO.format(fmu=built("drive")))
    result = railfmi.run(tmp_path / "push.toml", tmp_path / "out")
    assert_shown(result)
    assert result.lines()[0].startswith("push: 1 of 2 expectations met (")
    assert "it is not pulled back" in result.lines()[1]
    assert list(result.to_frame()["holds"]) == [True, False]
    table = result.recording()
    assert (table.index.name, table.index[-1]) == ("time", 1.0)
    assert table.attrs["units"]["drive.q"] == "m"
    assert table["drive.q"].is_monotonic_increasing
    with pytest.raises(BadInput, match="no variant 'wet' was run"):
        result.recording("wet")
    one = Difference("m", 2e-9, 0.5, 1e-9, 3e-9, 2e-9, None, False)
    both = Comparison("x", "a", "b", "0", "1", 1e-9, {"q": one}, (), (), (), ())
    assert_shown(both)
    assert both.to_frame().loc["q", "relative"] == 3e-9
