"""Speed: every file is a group, rounds alternate, ratios are of rounds, the JSON has its keys."""

import json
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.figure import write_figure
from benchmarks.group import Curve, Disagreement, Row, agreed, groups
from benchmarks.table import PAGE, Results
from benchmarks.timing import Times, in_turns
from tests.helpers.paths import ROOT

FILES = [f for f in (ROOT / "benchmarks" / "groups").glob("*.py") if not f.name.startswith("_")]


def test_every_file_is_a_group_and_the_readme_tells_of_it() -> None:
    said = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert {g.__module__.rpartition(".")[2] for g in groups().values()} == {f.stem for f in FILES}
    for name in groups():
        assert f"| `{name}` |" in said


def test_computations_take_turns_in_alternating_order_after_one_call_each() -> None:
    order: list[str] = []
    clock = count()
    times = in_turns(
        {name: lambda n=name: order.append(n) for name in "ab"}, 3, clock=lambda: float(next(clock))
    )
    assert "".join(order) == "ab" + "ab" + "ba" + "ab"
    assert {name: len(t) for name, t in times.by_label.items()} == {"a": 3, "b": 3}


def test_a_ratio_is_the_median_of_the_rounds_and_not_of_the_times() -> None:
    times = Times({"ours": np.array([1.0, 2.0, 30.0]), "peer": np.array([2.0, 4.0, 15.0])})
    row = times.row("name", "ours", "peer", "ms", "how", factor=1e3)
    assert (row.ours, row.value, row.ratio) == (2000.0, 4000.0, 0.5)
    assert row.spread == (0.5, 1.25)


def test_results_that_differ_are_not_compared() -> None:
    agreed(np.array([1.0, 2.0]), np.array([1.0, 2.0 + 1e-9]), 1e-6, "equal")
    for wrong in (2.1, np.nan):
        with pytest.raises(Disagreement, match="peer"):
            agreed(np.array([1.0, wrong]), np.array([1.0, 2.0]), 1e-6, "peer")


def test_a_quick_run_of_a_group_writes_rows_with_the_machine(tmp_path: Path, capsys) -> None:
    assert main(["--quick", "--only", "contact", "--out", str(tmp_path)]) == 0
    kept = json.loads((tmp_path / "benchmarks.json").read_text(encoding="utf-8"))
    needed = {
        "processor",
        "cores",
        "memory_GB",
        "system",
        "python",
        "libraries",
        "compiler",
        "date",
        "commit",
    }
    assert needed <= set(kept["machine"])
    assert kept["quick"]
    assert kept["rows"]
    shown = capsys.readouterr().out
    for row in kept["rows"]:
        fields = {"group", "name", "ours", "peer", "value", "ratio", "unit", "how", "spread"}
        assert set(row) == fields
        assert row["ours"] > 0
        assert row["value"] > 0
        assert row["spread"][0] <= row["ratio"] <= row["spread"][1]
        assert row["name"] in shown


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--only", "stp"], "did you mean 'step'"),
        (["--only", "contact", "--write", "docs"], "leave out --only"),
        (["--write", "no/such/folder"], "is no folder"),
    ],
)
def test_wrong_arguments_end_with_a_line(arguments, said, tmp_path: Path, capsys) -> None:
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line
    assert not [*tmp_path.iterdir()]


def test_the_page_says_what_is_missing_and_the_figure_is_drawn(tmp_path: Path) -> None:
    results = Results({"cores": 2, "libraries": {"numpy": "2"}}, quick=True)
    results.add("simulation", Row("rig", 2.0, "ecos", None, None, "µs", "ecospy is not installed"))
    results.add("cost", Curve("samples", "filter, s", (10.0, 20.0), (0.1, 0.2)))
    page = results.page()
    assert "| rig | 2 | ecos | - | µs | - | - | ecospy is not installed |" in page
    assert "quick run" in page
    results.write(tmp_path)
    write_figure(results.curves, tmp_path / "again.png")
    assert (tmp_path / "benchmarks.png").read_bytes()[:4] == b"\x89PNG"
    assert PAGE not in {f.name for f in tmp_path.iterdir()}
