"""An interrupted run of close-loop goes on where it stopped, never with what belongs to something else."""

import io
import json
import os
import pickle
import zipfile
from pathlib import Path

import pytest

from estimator.closeloop import pipeline as chain
from estimator.closeloop.checkpoints import SUFFIX, Stages
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.search import calibrated, screened, search
from fmus import codec
from fmus.errors import BadInput
from fmus.export.builders.hypotheses import ModelBuilder
from scenarios.closing.closing import STAGES
from tests.fmus.test_codec import Harmful
from tests.helpers.carriage import (
    coulomb,
    record,
    to_and_fro,
    write,
)
from tests.scenarios.test_command_line import railfmi

CLOCK = ("wall_seconds", "seconds")  # what differs from run to run


def test_a_stage_is_worked_out_once_under_its_key(tmp_path: Path) -> None:
    calls: list[int] = []

    def work() -> int:
        calls.append(len(calls))
        return len(calls)

    folder = tmp_path / "kept"
    assert [Stages(folder, "a").done("one", work) for _ in range(2)] == [1, 1]
    assert Stages(folder, "a").done("two", work) == 2
    assert Stages(folder, "b").done("one", work) == 3
    (folder / "two.checkpoint").write_bytes(b"PK\x03\x04broken")
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


@pytest.fixture(scope="module")
def in_one_go(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What a run of the same carriage finds that is not interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    assert close(write(folder, "dry", record(to_and_fro(), coulomb(20.0), 1)), folder / "out") == 0
    return found(folder / "out")


@pytest.mark.slow
def test_a_run_goes_on_where_it_stopped(carriage: Path, in_one_go: str, tmp_path: Path, capsys) -> None:
    """What was found before the interruption is not sought again, and the result is that of one go."""
    out = tmp_path / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "dated", interrupted)
        assert close(carriage, out) == 130
    assert "--resume" in capsys.readouterr().err
    assert not (out / "result.json").exists()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrated, "calibrate", refused)
        for done in ("missing_forces", "detect", "diagnose"):
            patch.setattr(chain, done, refused)
        patch.setattr(screened, "onset", refused)
        patch.setattr(Fitter, "briefly", refused)
        assert close(carriage, out, "--resume") == 0
    assert not (out / STAGES).exists()
    assert found(out) == in_one_go


def found(out: Path) -> str:
    """What a run wrote but for its times, as text, so that every digit counts."""
    result = json.loads((out / "result.json").read_text())
    return json.dumps({key: value for key, value in result.items() if key not in CLOCK})


@pytest.mark.slow
def test_every_checkpoint_of_a_run_can_be_read_back(carriage: Path, tmp_path: Path) -> None:
    """A run that is broken off at its end has nothing to work out again."""
    out = tmp_path / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenarios.closing.report.write_report", interrupted)
        assert close(carriage, out) == 130
    assert all(file.suffix == SUFFIX for file in (out / STAGES).rglob("*") if file.is_file())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stages, "_keep", refused)
        assert close(carriage, out, "--resume") == 0


@pytest.mark.slow
def test_planted_checkpoints_run_nothing(carriage: Path, in_one_go: str, tmp_path: Path) -> None:
    """Pickles in place of the checkpoints of an interrupted run: it is worked out again, as in one go."""
    out, mark = tmp_path / "out", tmp_path / "ran"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "dated", interrupted)
        assert close(carriage, out) == 130
    kept = sorted(file for file in (out / STAGES).rglob("*") if file.is_file())
    assert len(kept) > 4
    for file in kept:
        for name in (file, file.with_suffix(".pickle"), file.with_suffix(".part")):
            name.write_bytes(pickle.dumps(("key", Harmful(mark))))
    assert close(carriage, out, "--resume") == 0
    assert not mark.exists()
    assert found(out) == in_one_go


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder outside with a checkpoint that could be taken for one of a run's own."""
    folder = tmp_path / "elsewhere"
    assert Stages(folder, "a").done("one", lambda: "planted") == "planted"
    return folder


def test_a_link_in_place_of_the_folder_is_not_followed(elsewhere: Path, tmp_path: Path) -> None:
    folder, before = tmp_path / "kept", contents(elsewhere)
    folder.symlink_to(elsewhere, target_is_directory=True)
    assert Stages(folder, "a").done("one", lambda: "own") == "own"
    assert not folder.is_symlink()
    assert Stages(folder, "a").done("one", lambda: "again") == "own"
    assert contents(elsewhere) == before


def test_a_link_in_place_of_a_checkpoint_is_not_followed(elsewhere: Path, tmp_path: Path) -> None:
    folder, before = tmp_path / "kept", contents(elsewhere)
    folder.mkdir()
    for end in (SUFFIX, ".part"):
        (folder / f"one{end}").symlink_to(elsewhere / f"one{SUFFIX}")
    assert Stages(folder, "a").done("one", lambda: "own") == "own"
    assert Stages(folder, "a").done("one", lambda: "again") == "own"
    assert contents(elsewhere) == before


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder."""
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.mark.parametrize("what", ["link", "link to nowhere", "file", "folder", "nothing"])
def test_what_was_kept_is_forgotten_and_nothing_else(elsewhere: Path, tmp_path: Path, what: str) -> None:
    """Of a link the link goes, not what it leads to."""
    folder, before = tmp_path / "kept", contents(elsewhere)
    if what.startswith("link"):
        folder.symlink_to(elsewhere if what == "link" else tmp_path / "nowhere")
    elif what == "file":
        folder.write_text("no folder")
    elif what == "folder":
        Stages(folder, "a").done("one", lambda: 1)
        (folder / "further").symlink_to(elsewhere)
    Stages(folder, "a").forget()
    assert not os.path.lexists(folder)
    assert contents(elsewhere) == before


@pytest.mark.parametrize("what", ["file", "folder", "pipe"])
def test_what_lies_in_the_way_is_replaced(tmp_path: Path, what: str) -> None:
    """A file where the folder should be; a folder, or a pipe that nobody writes to, for the checkpoint."""
    folder = tmp_path / "kept"
    file = folder / f"one{SUFFIX}"
    if what == "file":
        folder.write_text("no folder")
    else:
        folder.mkdir()
        _ = file.mkdir() if what == "folder" else os.mkfifo(file)
    assert Stages(folder, "a").done("one", lambda: "own") == "own"
    assert Stages(folder, "a").done("one", lambda: "again") == "own"


def test_a_checkpoint_of_another_format_is_made_again(tmp_path: Path, monkeypatch) -> None:
    folder = tmp_path / "kept"
    assert Stages(folder, "a").done("one", lambda: 1) == 1
    monkeypatch.setattr(codec, "FORMAT", codec.FORMAT + 1)
    assert Stages(folder, "a").done("one", lambda: 2) == 2


def test_the_payload_of_another_key_is_not_decoded(tmp_path: Path, monkeypatch) -> None:
    folder = tmp_path / "kept"
    assert Stages(folder, "a").done("one", lambda: [1.0]) == [1.0]
    monkeypatch.setattr(codec, "_Reading", lambda *_: pytest.fail("was decoded"))
    assert Stages(folder, "b").done("one", lambda: [2.0]) == [2.0]
    with zipfile.ZipFile(io.BytesIO((folder / f"one{SUFFIX}").read_bytes())) as archive:
        assert json.loads(archive.read(codec.HEADER))["key"] == "b"


@pytest.mark.parametrize("change", ["seed", "data", "units", "afresh"])
def test_what_belongs_to_something_else_is_worked_out_again(
    carriage: Path, tmp_path: Path, change: str, monkeypatch, capfd
) -> None:
    monkeypatch.setattr(chain, "missing_forces", interrupted)
    assert close(carriage, tmp_path / "out") == 130
    more = {"seed": ["--resume", "--seed", "5"], "data": ["--resume"], "units": ["--resume"], "afresh": []}[
        change
    ]
    if change == "data":
        data = carriage / "data.csv"
        data.write_text(data.read_text() + "\n")
    elif change == "units":
        (carriage / "data.csv.units.json").write_text('{"q": "m"}')
    monkeypatch.setattr(calibrated, "calibrate", refused)
    assert close(carriage, tmp_path / "out", *more) == 70
    assert "worked out again" in capfd.readouterr().err


def test_there_may_be_nothing_to_resume(carriage: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(chain, "missing_forces", interrupted)
    assert close(carriage, tmp_path / "out", "--resume") == 130


def test_a_location_does_not_lead_to_an_fmu_elsewhere(tmp_path: Path) -> None:
    """A checkpoint may name any location, and an FMU that is loaded runs its own code."""
    work, elsewhere = tmp_path / "work", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "model.fmu").write_text("planted")
    builder = ModelBuilder("drive", work)
    builder((("constant_force", "carriage"),))
    with pytest.raises(BadInput, match="no location 'carriage/"):
        builder((("constant_force", "carriage/../../elsewhere"),))
