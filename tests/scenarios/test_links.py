"""A folder of results that comes from somebody else: no link in it leads a command elsewhere."""

import os
from pathlib import Path

import pytest

from fmus.errors import BadInput
from scenarios.cli.app import run_safely
from scenarios.links import refuse_links
from scenarios.tasks.store import Store
from tests.helpers.paths import SHIPPED

PRECIOUS = "not of railfmi\n"
WATCHED = ("watch.checkpoint", "windows.csv", "windows.1.csv", "recent", "events")
PLACES = [
    *(("watch", place) for place in (*WATCHED, "events/000001", "recent/000000000.parquet")),
    *(("campaign", place) for place in (".tasks", ".tasks/ab", ".builds")),
    ("fleet", "results"),
]
DECLARED = {
    "watch": SHIPPED / "watch",
    "campaign": SHIPPED / "campaign" / "settling.toml",
    "fleet": SHIPPED / "fleet" / "fleet.toml",
}


def everything(folder: Path) -> dict[str, str]:
    """The files in a folder with what they hold."""
    return {str(f.relative_to(folder)): f.read_text() for f in folder.rglob("*") if f.is_file()}


@pytest.fixture
def elsewhere(tmp_path):
    """A folder of other people, and a file in it."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "precious").write_text(PRECIOUS)
    return folder


@pytest.mark.parametrize(("command", "place"), PLACES)
def test_a_command_that_goes_on_in_a_folder_follows_no_link_in_it(command, place, elsewhere, tmp_path, capfd):
    link = tmp_path / "out" / place
    link.parent.mkdir(parents=True)
    link.symlink_to(elsewhere if "." not in link.name[1:] else elsewhere / "precious")
    assert run_safely([command, str(DECLARED[command]), "--out", str(tmp_path / "out")]) == 2
    [line] = [line for line in capfd.readouterr().err.splitlines() if not line.startswith("... ")]
    assert str(link) in line
    assert "is a link, a device or a pipe" in line
    assert everything(elsewhere) == {"precious": PRECIOUS}


def test_files_and_folders_are_no_links_and_what_is_not_there_is_none(tmp_path):
    (tmp_path / "events" / "000001").mkdir(parents=True)
    (tmp_path / "events" / "000001" / "data.parquet").touch()
    refuse_links(tmp_path, "events", "recent")
    Store.within(tmp_path, "results")


def test_a_link_to_nothing_and_a_pipe_are_refused(tmp_path):
    (tmp_path / "gone").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "pipe")
    for name in ("gone", "pipe"):
        with pytest.raises(BadInput, match=f"{name}: is a link, a device or a pipe"):
            refuse_links(tmp_path, name)
    assert not (tmp_path / "nowhere").exists()
