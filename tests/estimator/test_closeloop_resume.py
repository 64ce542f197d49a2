"""An interrupted run of close-loop goes on where it stopped, never with what belongs to something else."""

import json
from pathlib import Path

import pytest

from estimator.closeloop import pipeline as chain
from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.search import screened, search
from scenarios.closing.closing import STAGES
from tests.helpers.carriage import (
    coulomb,
    record,
    to_and_fro,
    write,
)
from tests.scenarios.test_command_line import railfmi


def test_a_stage_is_worked_out_once_under_its_key(tmp_path: Path) -> None:
    calls: list[int] = []

    def work() -> int:
        calls.append(len(calls))
        return len(calls)

    folder = tmp_path / "kept"
    assert [Stages(folder, "a").done("one", work) for _ in range(2)] == [1, 1]
    assert Stages(folder, "a").done("two", work) == 2
    assert Stages(folder, "b").done("one", work) == 3
    (folder / "two.pickle").write_bytes(b"\x80\x04broken")
    assert Stages(folder, "a").done("two", work) == 4
    Stages(folder, "a").forget()
    assert not folder.exists()
    assert [Stages().done("one", work) for _ in range(2)] == [5, 6]


def test_a_stage_that_fails_leaves_nothing(tmp_path: Path) -> None:
    def broken_off() -> int:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Stages(tmp_path / "kept", "a").done("one", broken_off)
    assert Stages(tmp_path / "kept", "a").done("one", lambda: 7) == 7


def refused(*arguments: object, **more: object) -> None:
    raise RuntimeError("worked out again")


def interrupted(*arguments: object, **more: object) -> None:
    raise KeyboardInterrupt


@pytest.fixture
def carriage(tmp_path: Path) -> Path:
    """A carriage with dry friction."""
    return write(tmp_path, "dry", record(to_and_fro(), coulomb(20.0), 1))


def close(experiment: Path, out: Path, *more: str) -> int:
    return railfmi("close-loop", experiment, "--out", out, "--jobs", "1", *more)


def test_a_run_goes_on_where_it_stopped(carriage: Path, tmp_path: Path, capsys) -> None:
    """What was found before the interruption is not sought again, and the result is that of one go."""
    out = tmp_path / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "to_the_end", interrupted)
        assert close(carriage, out) == 130
    assert "--resume" in capsys.readouterr().err
    assert not (out / "result.json").exists()
    with pytest.MonkeyPatch.context() as patch:
        for done in ("calibrate", "missing_forces", "detect", "honesty"):
            patch.setattr(chain, done, refused)
        patch.setattr(screened, "onset", refused)
        patch.setattr(search, "briefly", refused)
        assert close(carriage, out, "--resume") == 0
    assert not (out / STAGES).exists()
    assert close(carriage, tmp_path / "at once") == 0
    parts, whole = (json.loads((o / "result.json").read_text()) for o in (out, tmp_path / "at once"))
    for key in ("verdict", "effects", "calibrated", "error", "detection"):
        assert parts[key] == whole[key]


@pytest.mark.parametrize("change", ["seed", "data", "afresh"])
def test_what_belongs_to_something_else_is_worked_out_again(
    carriage: Path, tmp_path: Path, change: str, monkeypatch
) -> None:
    monkeypatch.setattr(chain, "missing_forces", interrupted)
    assert close(carriage, tmp_path / "out") == 130
    more = {"seed": ["--resume", "--seed", "5"], "data": ["--resume"], "afresh": []}[change]
    if change == "data":
        data = carriage / "data.csv"
        data.write_text(data.read_text() + "\n")
    monkeypatch.setattr(chain, "calibrate", refused)
    with pytest.raises(RuntimeError, match="worked out again"):
        close(carriage, tmp_path / "out", *more)


def test_there_may_be_nothing_to_resume(carriage: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(chain, "missing_forces", interrupted)
    assert close(carriage, tmp_path / "out", "--resume") == 130
