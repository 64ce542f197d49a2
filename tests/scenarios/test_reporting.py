"""The results of a folder on one page: nothing is lost, nothing that cannot be read ends the list."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.errors import BadInput
from railfmi import report
from scenarios.closing.result import Result
from scenarios.reporting.entries import entry

TRACED = {
    "experiment": "rig <7>",
    "verdict": "traced",
    "effects": [
        {"kind": "quadratic_damping", "location": "roller", "parameters": {"c": [0.3, 0.001]}},
    ],
    "error": {"omega_w": {"before": 0.05, "after": 0.004, "noise": 0.002}},
    "wall_seconds": 3.2,
}
SCENARIO = {"scenario": "braking", "ok": False, "expectations": [{"holds": True}, {"holds": False}]}


def put(folder: Path, name: str, table: object) -> Path:
    """Write a result into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(table if isinstance(table, str) else json.dumps(table))
    return folder / name


def test_every_result_is_listed_with_what_it_says(tmp_path: Path) -> None:
    put(tmp_path / "a", "result.json", TRACED)
    put(tmp_path / "b" / "deep", "result.json", SCENARIO)
    put(tmp_path / "c", "result.json", "{half")
    put(tmp_path / "d", "result.json", "[1, 2]")
    put(tmp_path / "e", "result.json", {"something": 1})
    found = report(tmp_path, tmp_path / "page")
    assert [(e.command, e.standing) for e in found.entries] == [
        ("close-loop", "good"),
        ("run", "bad"),
        ("unreadable", "bad"),
        ("unreadable", "bad"),
        ("other", "doubtful"),
    ]
    assert found.entries[0].error_over_noise == pytest.approx(2.0)
    assert "quadratic damping at roller: c = 0.3000" in found.entries[0].answer
    assert found.entries[1].answer == "1 of 2 expectations are met"
    assert "4 to look at" in found.headline
    page = (tmp_path / "page" / "summary.html").read_text()
    assert "rig &lt;7&gt;" in page
    assert "rig <7>" not in page
    assert 'href="../a/result.json"' in page
    table = (tmp_path / "page" / "summary.csv").read_text()
    assert len(table.splitlines()) == 6


def test_the_demo_is_on_the_page_with_a_link_to_its_report(demo: tuple[Result, Path], tmp_path: Path) -> None:
    result, out = demo
    found = report(out, tmp_path)
    [mine] = [e for e in found.entries if e.command == "close-loop"]
    assert (mine.name, mine.page) == (result.experiment, "report.html")
    assert mine.answer.startswith("traced: ")
    assert mine.seconds == pytest.approx(result.wall_seconds, rel=1e-6)


values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=8,
)
KEYS = (
    "verdict",
    "effects",
    "error",
    "estimated",
    "consistent",
    "scenario",
    "expectations",
    "step1",
    "reader",
)


@given(st.dictionaries(st.sampled_from(KEYS), values))
def test_whatever_a_file_holds_becomes_one_entry(
    tmp_path_factory: pytest.TempPathFactory, table: object
) -> None:
    file = put(tmp_path_factory.mktemp("any"), "result.json", table)
    assert entry(file).standing in ("good", "doubtful", "bad")


def test_links_to_folders_and_unfinished_writing_are_left_out(tmp_path: Path) -> None:
    put(tmp_path / "in" / "a", "result.json", TRACED)
    put(tmp_path / "in" / ".writing_1_x", "result.json", TRACED)
    put(tmp_path / "elsewhere", "result.json", TRACED)
    (tmp_path / "in" / "link").symlink_to(tmp_path / "elsewhere")
    assert len(report(tmp_path / "in").entries) == 1


@pytest.mark.parametrize("name", ["missing", "empty"])
def test_a_folder_without_results_is_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match=r"^[^\n]+; name [^\n]+$"):
        report(tmp_path / name)
