"""Commands in the documents: the command line accepts each, and those of shipped files run as printed.

The README and the tutorial have tests of their own, which run all that they say.
"""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.main import get_command

from scenarios.cli.app import COMMANDS, loaded, run_safely
from tests.contracts.test_documents import DOCUMENTS, ids
from tests.contracts.test_python_in_documents import demo, profiles
from tests.contracts.test_readme import expanded
from tests.helpers.paths import ROOT

LINE = re.compile(r"^(?: {4})?(railfmi .+)$", re.M)
PYTHON = re.compile(r"```python\n.*?```", re.S)
FILE = re.compile(r"[\w./-]+\.(?:txt|toml|fmu|ssp|csv|py)(?::\w+)?")  # an argument that names a file
# files of a reader that are like shipped ones, by the page that names them
OWN = {"estimate.md": demo("rig-friction"), "plan.md": demo("rig-drag"), "conicity.md": profiles}
RUN_ELSEWHERE = ("README.md", "tutorial.md")
PICTURE = re.compile(r"`(out/[\w./-]+\.png)`")


def commands(page: Path) -> Iterator[list[str]]:
    """The command lines of railfmi on a page, without the name of the program."""
    for line in LINE.findall(PYTHON.sub("", page.read_text(encoding="utf-8"))):
        for command in line.split("&&"):
            _, *words = shlex.split(command, comments=True)
            if words and words[0] in COMMANDS:  # a sentence may begin with the name, too
                yield words


WITH_COMMANDS = [page for page in DOCUMENTS if any(commands(page))]


def understood(words: list[str]) -> dict[str, object]:
    """The values of a command line by their names; what it does not accept raises UsageError."""
    command = get_command(loaded([words[0]])).commands[words[0]]  # type: ignore[attr-defined]
    with command.make_context(words[0], words[1:]) as context:
        return dict(context.params)


def files(words: list[str]) -> Iterator[str]:
    """The files and folders that a command line reads."""
    values = {name: value for name, value in understood(words).items() if name != "out"}
    for value in values.values():
        for one in value if isinstance(value, list | tuple) else (value,):
            if isinstance(one, Path) or (isinstance(one, str) and FILE.fullmatch(one)):
                yield str(one)


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=ids)
def test_the_command_line_accepts_every_command(page: Path) -> None:
    for words in commands(page):
        assert understood(words), words


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in WITH_COMMANDS if p.name not in RUN_ELSEWHERE], ids=ids)
def test_commands_of_shipped_files_run_as_printed(page: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    """A page is done from its top, in a folder that has only what is shipped; others' files are left out."""
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "shipped").symlink_to(ROOT / "scenarios" / "shipped")
    if page.name in OWN:
        OWN[page.name](tmp_path)
    monkeypatch.chdir(tmp_path)
    for words in commands(page):
        known = [name for name in files(words) if any(tmp_path.glob(name))]
        if len(known) == len([*files(words)]) and "pendulum" not in words:  # a model of the reader's own
            assert run_safely(expanded(words)) == 0, (words, capsys.readouterr())
    for picture in PICTURE.findall(page.read_text(encoding="utf-8")):
        assert Path(picture).is_file(), picture
