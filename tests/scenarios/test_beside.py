"""What is read beside a record is known, so that a checksum of the record can hold it."""

import sys
from pathlib import Path

import pytest

from scenarios.experiment.beside import read_with
from scenarios.experiment.readers import READERS, read_sheet
from scenarios.experiment.readers.mat import Mat
from tests.helpers.experiment_files import table
from tests.scenarios.test_readers import UNITS, WRITERS

BESIDE = ("{name}.units.json", "{name}.json", "{name}_index", "{stem}.units.json", "{stem}.json")
OPENED: list[Path] = []
TRACED: list[Path] = []  # the folder in which files are opened; empty without a test


def _note(event: str, about: tuple[object, ...]) -> None:
    if TRACED and event == "open" and isinstance(about[0], str) and Path(about[0]).parent == TRACED[0]:
        OPENED.append(Path(about[0]))


sys.addaudithook(_note)


@pytest.mark.parametrize("kind", WRITERS)
def test_no_other_file_is_read_with_a_record(kind, tmp_path, monkeypatch):
    write, name = WRITERS[kind]
    file = tmp_path / name
    write(file, table(), UNITS)
    for pattern in BESIDE:
        (tmp_path / pattern.format(name=name, stem=file.stem)).write_text("{}")
    monkeypatch.setattr(Mat, "fragile", False)  # to be read in this process, whose files are seen
    OPENED.clear()
    TRACED.append(tmp_path)
    try:
        read_sheet(file)
    finally:
        TRACED.clear()
    assert file in OPENED
    assert {*OPENED} <= {*read_with(file)}


@pytest.mark.parametrize("suffix", [suffix for suffix in READERS if suffix not in (".csv", ".txt")])
def test_the_file_itself_comes_first(suffix, tmp_path):
    file = tmp_path / f"data{suffix}"
    first, *more = read_with(file)
    assert first == file
    assert all(f.parent == tmp_path and f.name.startswith(f"data{suffix}.") for f in more)
