"""Several experiments in one run: their folders and table, bad input, interrupted runs."""

import csv
import json
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from estimator.closeloop import pipeline as chain
from estimator.closeloop.outcome import Outcome
from fmus.drive.model import Drive
from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.host.fmu import FmuError
from scenarios import close_loop, close_loops
from scenarios.closing import closing
from scenarios.closing.several import fmu_of
from scenarios.closing.several_results import COLUMNS, Results
from tests.helpers.carriage import (
    coulomb,
    one_way,
    record,
    to_and_fro,
    write,
)
from tests.helpers.paths import ROOT
from tests.scenarios.test_command_line import railfmi

TRACE = "scenarios.closing.closing.trace"


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The same friction in a run one way, which cannot tell it from a constant force, and to and fro."""
    folder = tmp_path_factory.mktemp("carriage")
    slow = write(folder, "slow", record(one_way(), coulomb(20.0), 1, speed=0.3), speed=0.3)
    return [slow, write(folder, "fast", record(to_and_fro(), coulomb(20.0), 2))]


Outcomes = dict[float, Outcome]  # by the speed at the start


@pytest.fixture(scope="module")
def outcomes(two: list[Path]) -> Outcomes:
    """What the chain finds in each experiment."""
    found: Outcomes = {}

    def keep(problem, *more):
        found[problem.declared["q_dot"]] = chain.trace(problem, *more)
        return found[problem.declared["q_dot"]]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TRACE, keep)
        for experiment in two:
            close_loop(experiment, jobs=1)
    return found


@pytest.fixture(scope="module")
def closed(
    two: list[Path], outcomes: Outcomes, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Results, Path]:
    """Both experiments, closed once, and the folder written."""
    out = tmp_path_factory.mktemp("out")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TRACE, lambda problem, *more: outcomes[problem.declared["q_dot"]])
        return close_loops(two, out, jobs=1), out


@pytest.fixture
def known(outcomes: Outcomes, monkeypatch) -> None:
    """The chain finds what it found before, at once; no FMUs and no reports are written."""
    monkeypatch.setattr("scenarios.closing.closing.augment", lambda *a: ())
    monkeypatch.setattr("scenarios.closing.report.write_report", lambda *a: None)
    monkeypatch.setattr(TRACE, lambda problem, *more: outcomes[problem.declared["q_dot"]])


def rows(out: Path) -> list[dict[str, str]]:
    with (out / "table.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def words(page: str) -> str:
    """What a reader sees of a page."""
    return re.sub(r"\s+", " ", re.sub(r"<style.*?</style>|<[^>]+>", " ", page, flags=re.S))


@pytest.mark.slow
def test_a_second_run_splits_what_the_first_left_open(closed: tuple[Results, Path]) -> None:
    found, _ = closed
    assert [(r.experiment, r.verdict) for r in found.results] == [("slow", "ambiguous"), ("fast", "traced")]
    status = {(c.source, c.target, c.effect): c.status for c in found.transfers}
    assert status["slow", "fast", "coulomb_friction@carriage"] == "confirmed"
    assert status["slow", "fast", "constant_force@carriage"] == "absent"
    assert status["fast", "slow", "coulomb_friction@carriage"] == "confirmed"
    assert "comes down to coulomb_friction@carriage" in found.together["slow"]
    assert "constant_force@carriage is ruled out by fast" in found.together["slow"]
    [both] = found.joint
    value, error = both.parameters["coulomb_friction_carriage_F_c"]
    assert abs(value - 20.0) < 4 * error
    assert error < both.alone["fast"]["coulomb_friction_carriage_F_c"][1]
    assert both.serves
    assert both.units["coulomb_friction_carriage_F_c"] == "N"


@pytest.mark.slow
def test_each_experiment_has_its_own_folder_with_its_own_numbers(closed: tuple[Results, Path]) -> None:
    found, out = closed
    for result in found.results:
        own = out / result.experiment
        written = json.loads((own / "result.json").read_text())
        assert written["error"] == result.error
        assert (own / "report.html").is_file()
        assert (own / result.augmented_fmu).is_file()
    every = json.loads((out / "results.json").read_text())
    assert [r["experiment"] for r in every["results"]] == ["slow", "fast"]
    assert every["joint"][0]["parameters"] == found.joint[0].parameters


@pytest.mark.slow
def test_the_table_holds_the_output_that_is_farthest_from_its_noise(closed: tuple[Results, Path]) -> None:
    found, out = closed
    table = rows(out)
    assert list(table[0]) == list(COLUMNS)
    for row, result in zip(table, found.results, strict=True):
        over = {o: e["after"] / e["noise"] for o, e in result.error.items()}
        assert over[row["output"]] == max(over.values())
        assert float(row["after"]) == result.error[row["output"]]["after"]
        assert row["unit"] == {"q": "m", "q_dot": "m/s"}[row["output"]]
        for e in result.effects:
            value, error = e.parameters[next(iter(e.parameters))]
            assert f"{e.kind}@{e.location}" in row["effects"]
            assert f"= {value:.4g} +- {error:.2g}" in row["effects"]
        assert row["together"] == found.together[result.experiment]
        assert (out / row["report"]).is_file()


@pytest.mark.slow
def test_the_page_leads_to_the_reports_and_says_what_the_results_say(closed: tuple[Results, Path]) -> None:
    found, out = closed
    page = (out / "index.html").read_text(encoding="utf-8")
    links = re.findall(r'href="([^"]+)"', page)
    within = [link for link in links if link.startswith("#")]
    assert [link for link in links if link not in within] == ["slow/report.html", "fast/report.html"]
    assert all(f'id="{link[1:]}"' in page for link in within)
    assert not re.search(r"""(src|href)\s*=\s*["'](https?:)?//""", page)
    assert "<script" not in page
    text = words(page)
    for sentence in (*found.together.values(), *(c.status for c in found.transfers)):
        assert sentence in text
    value, _ = found.joint[0].parameters["coulomb_friction_carriage_F_c"]
    assert f"{value:.2f}" in text
    assert "The run was interrupted" not in text
    assert (out / "common_coulomb_friction_carriage.png").is_file()


@pytest.mark.slow
def test_the_command_prints_the_table(
    two: list[Path], closed: tuple[Results, Path], tmp_path: Path, capsys, monkeypatch
) -> None:
    monkeypatch.setattr("scenarios.closing.several.close_loops", lambda *a, **k: closed[0])
    assert railfmi("close-loop", *two, "--out", tmp_path) == 0
    printed = capsys.readouterr().out
    [head, first, *_] = printed.splitlines()
    assert head.split()[:2] == ["experiment", "verdict"]
    assert first.split()[:2] == ["slow", "ambiguous"]
    assert first.index("constant_force") == head.index("effects")  # columns stand below their heads
    for said in (*closed[0].together.values(), closed[0].joint[0].reason, str(tmp_path / "table.csv")):
        assert said in printed


# ---- bad input


def never(*arguments, **more):
    raise AssertionError("the first experiment was run before all were read")


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("experiment.toml", 'id = "fast"', 'id = "slow"', "id 'slow' is also used by"),
        ("experiment.toml", 'id = "fast"', 'id = "a/b"', "id 'a/b' cannot name a folder"),
        ("experiment.toml", 'id = "fast"', 'id = ".."', "id '..' cannot name a folder"),
        ("experiment.toml", 'id = "fast"', 'id = "table.csv"', "id 'table.csv' cannot name a folder"),
        ("experiment.toml", 'F = "F"', 'F = "G"', "G"),
        ("experiment.toml", "F_v = 200.0", "F_w = 200.0", "'F_w' is not a parameter of Drive"),
        ("experiment.toml", "[split]", "[spilt]", "spilt"),
        ("data.csv", "t,F,q", "t,F,p", "'q'"),
    ],
)
def test_what_is_wrong_with_the_last_is_said_before_the_first_is_run(
    file: str, old: str, new: str, said: str, two: list[Path], tmp_path: Path, monkeypatch, capsys
) -> None:
    bad = tmp_path / "bad"
    bad.mkdir()
    for source in two[1].iterdir():
        text = source.read_text()
        assert source.name != file or old in text
        (bad / source.name).write_text(text.replace(old, new) if source.name == file else text)
    monkeypatch.setattr(TRACE, never)
    assert railfmi("close-loop", two[0], bad, "--out", tmp_path / "out") == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert said in line
    assert str(bad) in line
    assert not (tmp_path / "out").exists()


def test_equal_ids_are_refused_with_both_files_named(two: list[Path], tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="give each experiment an id of its own") as refused:
        close_loops([two[0], two[0] / "experiment.toml"], tmp_path)
    assert str(refused.value).count(str(two[0] / "experiment.toml")) == 2


def test_no_experiment_at_all_is_refused() -> None:
    with pytest.raises(BadInput, match="no experiment given"):
        close_loops([])


# ---- interrupted runs


def second_raises(error: BaseException, monkeypatch) -> None:
    """The chain goes through for the fast record, and breaks off in the slow one."""
    goes_through = closing.trace

    def run(problem, *more):
        if problem.declared["q_dot"] > 0:
            raise error
        return goes_through(problem, *more)

    monkeypatch.setattr(TRACE, run)


@pytest.mark.usefixtures("known")
def test_ctrl_c_keeps_what_is_finished_and_its_table(
    two: list[Path], tmp_path: Path, monkeypatch, capsys
) -> None:
    second_raises(KeyboardInterrupt(), monkeypatch)
    assert railfmi("close-loop", two[1], two[0], "--out", tmp_path, "--jobs", "1") == 130
    assert [row["experiment"] for row in rows(tmp_path)] == ["fast"]
    assert json.loads((tmp_path / "results.json").read_text())["interrupted"] is True
    assert (tmp_path / "fast" / "result.json").is_file()
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "The run was interrupted" in words(page)
    assert "slow/report.html" not in page
    printed = capsys.readouterr()
    assert "1 of 2 experiments are finished" in printed.err
    assert "table.csv" in printed.out


@pytest.mark.usefixtures("known")
def test_an_fmu_that_fails_keeps_what_is_finished_and_is_reported(
    two: list[Path], tmp_path: Path, monkeypatch, capsys
) -> None:
    second_raises(FmuError("Drive.fmu: refused to step"), monkeypatch)
    assert railfmi("close-loop", two[1], two[0], "--out", tmp_path, "--jobs", "1") == 2
    assert [row["experiment"] for row in rows(tmp_path)] == ["fast"]
    assert "refused to step" in capsys.readouterr().err


@pytest.mark.usefixtures("known")
def test_ctrl_c_while_effects_are_carried_over_keeps_all_experiments(
    two: list[Path], tmp_path: Path, monkeypatch
) -> None:
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("scenarios.closing.several.commons", interrupted)
    found = close_loops(two, tmp_path, jobs=1)
    assert found.interrupted
    assert [row["experiment"] for row in rows(tmp_path)] == ["slow", "fast"]
    assert "comes down to coulomb_friction@carriage" in rows(tmp_path)[0]["together"]
    assert (len(found.transfers), found.joint) == (3, [])


def test_ctrl_c_before_anything_is_finished_writes_no_table(
    two: list[Path], tmp_path: Path, monkeypatch
) -> None:
    def at_once(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(TRACE, at_once)
    assert railfmi("close-loop", *two, "--out", tmp_path) == 130
    assert not (tmp_path / "table.csv").exists()


# ---- one alone, and other FMUs


@pytest.mark.usefixtures("known")
def test_one_experiment_is_written_to_the_folder_itself(two: list[Path], tmp_path: Path) -> None:
    assert railfmi("close-loop", two[1], "--out", tmp_path, "--jobs", "1") == 0
    assert json.loads((tmp_path / "result.json").read_text())["experiment"] == "fast"
    assert not (tmp_path / "fast").exists()
    assert not (tmp_path / "table.csv").exists()


@pytest.mark.usefixtures("known")
def test_records_of_different_fmus_are_not_compared(two: list[Path], monkeypatch) -> None:
    monkeypatch.setattr("scenarios.closing.several.fmu_of", lambda e: e.id)
    found = close_loops(two, jobs=1)
    assert [r.experiment for r in found.results] == ["slow", "fast"]
    assert (found.transfers, found.joint, found.together) == ([], [], {})


def test_the_same_fmu_is_the_same_model_or_the_same_file_wherever_it_lies(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.fmu", "copy.fmu", "other.fmu")]
    for file, content in zip(files, (b"one", b"one", b"two"), strict=True):
        file.write_bytes(content)
    a, copy, other = (fmu_of(SimpleNamespace(fmu_path=f, model=None)) for f in files)
    assert a == copy != other
    assert fmu_of(SimpleNamespace(fmu_path=None, model="Drive")) == "drive"


@pytest.mark.slow
def test_copies_of_a_foreign_fmu_are_one_machine(two: list[Path], tmp_path: Path) -> None:
    made, port = build_python(Drive(), tmp_path), '[[ports]]\nname = "slide"\nforce = "F_ext"\n'
    port += 'velocity = "q_dot"\ndisplacement = "q"\n'
    for folder in two:
        copy = tmp_path / folder.name
        copy.mkdir()
        (copy / f"{folder.name}.fmu").write_bytes(made.read_bytes())
        (copy / "data.csv").write_bytes((folder / "data.csv").read_bytes())
        text = (folder / "experiment.toml").read_text()
        text = text.replace('model = "drive"', f'fmu = "{folder.name}.fmu"')
        (copy / "experiment.toml").write_text(text + port)
    found = close_loops([tmp_path / f.name for f in two], tmp_path / "out", jobs=1)
    status = {(c.source, c.target, c.effect): c.status for c in found.transfers}
    assert status["slow", "fast", "coulomb_friction@slide"] == "confirmed"
    assert status["fast", "slow", "coulomb_friction@slide"] == "confirmed"
    assert "constant_force@slide is ruled out by fast" in found.together["slow"]
    assert [j.effect for j in found.joint if j.serves] == ["coulomb_friction@slide"]


@pytest.mark.slow
def test_the_example_of_the_docs_does_what_is_said_of_it(tmp_path: Path, monkeypatch, capsys) -> None:
    text = (ROOT / "docs" / "several.md").read_text(encoding="utf-8")
    [code] = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "several.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "the class comes down to coulomb_friction@carriage" in printed
    assert "constant_force@carriage is ruled out by fast" in printed
    assert "one value of coulomb_friction@carriage accounts for slow and fast" in printed
    assert (tmp_path / "out" / "index.html").is_file()
