"""What is written is complete or not there; a disk that is full is one line."""

import errno
import os
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus import limits
from fmus.contact.geometry.points import read_points
from fmus.errors import BadInput
from fmus.export.provenance import PLACE, isolation_of
from fmus.export.ssp.reading import read_package
from fmus.host.apart.isolation import ISOLATED
from fmus.host.archive import describe
from scenarios.cli.app import run_safely
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.validation import read_toml
from scenarios.output import WRITING, writable, written_at_once
from scenarios.reporting.entries import entries
from tests.helpers.misbehaving import Fault, bad_fmu

FINE = Fault("none", "none", "")


def test_files_appear_together_and_the_result_last(tmp_path):
    with written_at_once(tmp_path) as part:
        for name in ("result.json", "a.csv", "z.png"):
            (part / name).write_text(name)
        assert [f.name.startswith(WRITING) for f in tmp_path.iterdir()] == [True]
    assert sorted(f.name for f in tmp_path.iterdir()) == ["a.csv", "result.json", "z.png"]


def half_written(folder, error):
    with written_at_once(folder) as part:
        (part / "a.csv").write_text("half")
        raise error


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_takes_no_more_is_bad_input(tmp_path, number):
    with pytest.raises(BadInput, match="cannot be written"):
        half_written(tmp_path, OSError(number, os.strerror(number)))
    assert list(tmp_path.iterdir()) == []


def test_a_mistake_is_no_full_disk(tmp_path):
    with pytest.raises(KeyError):
        half_written(tmp_path, KeyError("x"))
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_command_left_is_removed(tmp_path):
    dies = f"from scenarios.output import *; w = written_at_once(Path({str(tmp_path)!r})); w.__enter__(); "
    killed = [sys.executable, "-c", dies + "import signal; os.kill(os.getpid(), signal.SIGKILL)"]
    assert subprocess.run(killed).returncode == -signal.SIGKILL
    [left] = tmp_path.iterdir()
    with written_at_once(tmp_path) as living:
        writable(tmp_path)
        assert not left.exists()
        assert living.exists()
    assert list(tmp_path.iterdir()) == []


def test_files_in_subfolders_keep_their_place(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "old.csv").touch()
    with written_at_once(tmp_path) as part:
        (part / "data").mkdir()
        (part / "data" / "new.csv").touch()
    assert sorted(f.name for f in (tmp_path / "data").iterdir()) == ["new.csv", "old.csv"]


@pytest.mark.parametrize("broken", range(6))
@pytest.mark.parametrize("command", ["run", "compare"])
def test_no_half_file_whatever_write_fails(command, broken, tmp_path, tmp_path_factory, monkeypatch, capfd):
    """The disk is full from the n-th rename on, or at one of the writes before."""
    bad_fmu(tmp_path, FINE, tmp_path_factory.mktemp("library"))
    arguments = {
        "run": ["run", tmp_path / "scenario.toml"],
        "compare": ["compare", *2 * [tmp_path / "bad.fmu"], tmp_path / "experiment.toml"],
    }[command]
    count, replace = [0], Path.replace

    def full(self, target):
        count[0] += 1
        if count[0] > broken:
            raise OSError(errno.ENOSPC, "No space left on device", str(target))
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", full)
    code = run_safely([*map(str, arguments), "--out", str(tmp_path / "out")])
    if count[0] <= broken:
        assert code == 0
        return
    [line] = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    assert code == 2
    assert "cannot be written (No space left on device)" in line
    assert not [f for f in (tmp_path / "out").iterdir() if f.name.startswith((WRITING, "."))]


def test_results_stay_where_they_were_asked_for(tmp_path, tmp_path_factory, monkeypatch):
    """An FMU that changes the working directory, here with the command, moves nothing."""
    bad_fmu(tmp_path, Fault("directory", "step", ""), tmp_path_factory.mktemp("library"))
    monkeypatch.chdir(tmp_path)
    assert run_safely(["run", "scenario.toml", "--out", "out", "--trust-fmu"]) == 0
    assert Path.cwd() == Path("/")
    assert (tmp_path / "out" / "result.json").exists()


def test_a_package_of_too_much_is_refused_by_its_contents(tmp_path, monkeypatch):
    for name, (few, size) in {"many": (3, 1.0), "large": (99, 1e-6)}.items():
        monkeypatch.setattr(limits, "ENTRIES", few)
        monkeypatch.setattr(limits, "UNPACKED", size)
        for ending, read in (("fmu", describe), ("ssp", read_package)):
            file = tmp_path / f"{name}.{ending}"
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
                for i in range(9):
                    packed.writestr(f"{i}.txt", bytes(1000))
            with pytest.raises(BadInput, match=r"more than .*; pack only what belongs to it"):
                read(file)


def test_pipes_and_devices_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "data.csv")
    for file in (tmp_path / "data.csv", tmp_path, Path("/dev/zero")):
        with pytest.raises(BadInput, match="device or a pipe"):
            read_toml(file, "a scenario")
    with pytest.raises(BadInput, match="device or a pipe"):
        read_sheet(tmp_path / "data.csv")
    with pytest.raises(BadInput, match="device or a pipe"):
        read_points(tmp_path / "data.csv", "wheel")
    with pytest.raises(BadInput, match="device or a pipe"):
        read_package(tmp_path / "data.csv")
    (tmp_path / "result.json").symlink_to(tmp_path / "gone")
    (tmp_path / "sub").mkdir()
    os.mkfifo(tmp_path / "sub" / "plan.json")
    answers = [entry.answer for entry in entries(tmp_path)]
    assert len(answers) == 2
    assert "No such file" in answers[0]
    assert "device or a pipe" in answers[1]
    with pytest.raises(BadInput, match="holds a NUL"):
        read_sheet(tmp_path / "a\0.csv")


def test_output_that_cannot_be_printed_is_told(tmp_path, tmp_path_factory):
    """Standard output buffers: without a look at the end it failed after the exit code was known."""
    bad_fmu(tmp_path, FINE, tmp_path_factory.mktemp("library"))
    command = [sys.executable, "-m", "scenarios.cli", "inspect", str(tmp_path / "bad.fmu")]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("railfmi: the output: cannot be written (No space left on device)")
    assert len(done.stderr.splitlines()) == 1


def test_files_of_too_much_are_refused_before_they_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "TEXT", 1e-3)
    monkeypatch.setattr(limits, "COLUMNS", 100)
    (tmp_path / "large.toml").write_text("# a comment\n" * 200)
    with pytest.raises(BadInput, match=r"has 0\.0024 MB, more than 0\.001 MB"):
        read_toml(tmp_path / "large.toml", "a scenario")
    with pytest.raises(BadInput, match=r"more than 0\.001 MB"):
        read_points(tmp_path / "large.toml", "rail")
    (tmp_path / "wide.csv").write_text(",".join(f"c{i}" for i in range(101)) + "\n")
    with pytest.raises(BadInput, match="has 101 columns, more than 100"):
        read_sheet(tmp_path / "wide.csv")


@pytest.mark.parametrize(
    "record", [b"[]", b'{"sha256": []}', b'{"sha256": 3}', b"[" * 9999, b"\xff", b"{}", b'{"base": 1}']
)
def test_a_record_of_provenance_of_another_form_is_a_foreign_fmu(record, tmp_path, tmp_path_factory):
    """Who forges one must not end the command with an error of Python's."""
    fmu = bad_fmu(tmp_path, FINE, tmp_path_factory.mktemp("library"))
    with zipfile.ZipFile(fmu, "a") as packed:
        packed.writestr(PLACE, record)
    assert isolation_of(fmu, ISOLATED) is ISOLATED


SPOILED = {
    "a start that is a word": (b'<Real start="2"', b'<Real start="two"', "is no|could not convert"),
    "a limit that is a word": (b'min="0.1"', b'min="low"', "could not convert"),
    "a step that is a word": (b'stepSize="0.001"', b'stepSize="small"', "could not convert"),
}


@pytest.mark.parametrize("spoiled", SPOILED)
def test_numbers_that_are_words_are_told(spoiled, tmp_path, tmp_path_factory):
    from tests.helpers.packed import with_description

    old, new, words = SPOILED[spoiled]
    good = bad_fmu(tmp_path, FINE, tmp_path_factory.mktemp("library"))
    with pytest.raises(BadInput, match=words):
        describe(with_description(good, tmp_path / "spoiled.fmu", old, new))


def test_numbers_whose_squares_are_none_are_told(tmp_path, tmp_path_factory, capfd):
    bad_fmu(tmp_path, FINE, tmp_path_factory.mktemp("library"))
    rows = [f"{0.005 * i:.9g},0.1,{1e308 * (-1) ** i}" for i in range(400)]
    (tmp_path / "data.csv").write_text("\n".join(["t,u,x", *rows]) + "\n")
    assert np.isfinite(1e308)
    assert run_safely(["close-loop", str(tmp_path / "experiment.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "numbers above 1e+100" in capfd.readouterr().err
