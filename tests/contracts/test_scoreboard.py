"""The published scoreboard belongs to the code that answers, or says that this code has changed."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.challenge.board import PAGE, Board, board_of, page, section
from benchmarks.challenge.code import ROOT, changed, digests, read_for
from benchmarks.challenge.match import Answer
from benchmarks.challenge.truth import Truth

DEMO = ROOT / "scenarios" / "shipped" / "demo" / "rig-drag"


def test_the_page_is_that_of_the_kept_scoreboard_and_right_about_the_code() -> None:
    board = Board.kept()
    text = PAGE.read_text(encoding="utf-8")
    said = "docs/challenge.md is not what 'python -m benchmarks.challenge.board' writes"
    assert page(text, board, changed(board.code)) == text, said


def test_what_a_run_compiles_is_no_code_that_answers() -> None:
    """A clean checkout has none of it, so that the page would be wrong there."""
    kept = Board.kept().code
    assert "estimator/closeloop/pipeline.py" in kept
    assert not [f for f in kept if "__pycache__" in f]


def test_the_set_of_the_page_can_be_repeated() -> None:
    named = re.findall(r"(?:SEED=|--seed )(\d{3,})", PAGE.read_text(encoding="utf-8"))
    assert set(named) == {str(Board.kept().seed)}


def test_one_changed_byte_or_a_lost_file_is_seen(tmp_path: Path) -> None:
    for name, content in {"a.py": b"x = 1\n", "b.c": b"int x;\n", "c.csv": b"1,2\n"}.items():
        (tmp_path / name).write_bytes(content)
    kept = digests(["a.py", "b.c", "c.csv"], tmp_path)
    assert changed(kept, tmp_path) == []
    (tmp_path / "b.c").write_bytes(b"int y;\n")
    (tmp_path / "c.csv").unlink()
    assert changed(kept, tmp_path) == ["b.c", "c.csv"]


def test_the_page_names_what_has_changed() -> None:
    board = Board.kept()
    assert "unchanged since that commit" in section(board, [])
    said = section(board, ["estimator/closeloop/policy/decision.py"])
    assert "unchanged" not in said
    assert "`estimator/closeloop/policy/decision.py`" in said
    moved = section(board, ["estimator/plant.py", "estimator/moved/away.py"])
    assert "in 2 of" in moved
    assert "`estimator/plant.py`, and 1 that no longer exist" in " ".join(moved.split())
    assert "estimator/moved/away.py" not in moved


def test_a_new_scoreboard_has_the_one_before_beside_it() -> None:
    last = replace(
        Board.kept(),
        seed=1,
        commit="before",
        rows=(("records", "7", ""), ("two effects, both named", "3 of 7", "")),
    )
    marked = [(Truth("record-000", "double", "rig"), Answer("several", (("a", "b"),)))]
    new = board_of(marked, 2, "after", "today", last, ["pyproject.toml"])
    assert (new.seed, new.before_seed, new.before_commit, new.records) == (2, 1, "before", 1)
    assert new.code == digests(["pyproject.toml"])
    [row] = re.findall(r"^\| two effects, both named \|.*$", section(new, []), re.M)
    assert row.startswith("| two effects, both named | ")
    assert row.endswith("| 3 of 7 |")
    assert new.ways == ()  # all records are measured in one


def test_a_set_of_several_ways_of_measuring_is_counted_by_way() -> None:
    ways = ("clock", "inputs", "inputs")
    marked = [(Truth("record", "double", "rig", way=w), Answer("several", (("a", "b"),))) for w in ways]
    new = board_of(marked, 2, "after", "today", Board.kept(), ["pyproject.toml"])
    counted = re.findall(r"^\| (\w+) \|.*\| 0 of (\d) \|", section(new, []), re.M)
    assert counted == [("clock", "1"), ("inputs", "2"), ("all", "3")]


@pytest.mark.slow
def test_the_files_that_answer_are_found_by_answering() -> None:
    found = read_for([DEMO])
    assert {
        "estimator/closeloop/policy/decision.py",
        "estimator/closeloop/decision/verdict.py",
        "fmus/testrig/model.py",
        "fmus/effects/quadratic_damping.py",
        "fmus/export/builders/native/sources/stepping.c",
        "scenarios/closing/closing.py",
    } <= set(found)
    assert not [
        f
        for f in found
        if f.startswith(("scenarios/closing/page", "scenarios/cli", "benchmarks/challenge/board"))
    ]
