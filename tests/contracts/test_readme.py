"""Every command of the README runs as it is printed, in a folder that has only what is shipped."""

import re
import shlex
from pathlib import Path

import pytest

from scenarios.cli.app import run_safely
from tests.helpers.paths import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
[BLOCK] = re.findall(r"```sh\n(.*?)```", README, re.S)
COMMANDS = [shlex.split(line, comments=True)[1:] for line in BLOCK.splitlines()]
# compiles, or takes minutes
LONG = (
    "--platform", "--kind", "run", "bifurcation", "export-ssp", "compare", "plan", "close-loop", "fleet",
    "campaign", "wear",
)  # fmt: skip


def expanded(arguments: list[str]) -> list[str]:
    """A command line as a shell would give it: patterns replaced by the files that they match."""
    found = []
    for argument in arguments:
        matching = sorted(map(str, Path().glob(argument))) if "*" in argument else []
        assert matching or "*" not in argument, f"{argument} matches no file"
        found += matching or [argument]
    return found


@pytest.fixture(scope="module")
def clone(tmp_path_factory) -> Path:
    """A folder with the shipped files alone."""
    folder = tmp_path_factory.mktemp("clone")
    (folder / "scenarios").mkdir()
    (folder / "scenarios" / "shipped").symlink_to(ROOT / "scenarios" / "shipped")
    return folder


def test_the_readme_has_commands():
    assert len(COMMANDS) >= 12
    assert all(line.startswith("railfmi ") for line in BLOCK.splitlines())


def test_the_quick_commands_run_as_printed(clone, monkeypatch, capsys):
    monkeypatch.chdir(clone)
    quick = [c for c in COMMANDS if not {*c} & {*LONG}]
    assert {c[0] for c in quick} == {
        "build", "check", "inspect", "estimate", "watch", "row", "conicity", "report",
    }  # fmt: skip
    for command in quick:
        assert run_safely(expanded(command)) == 0, (command, capsys.readouterr())


@pytest.mark.slow
def test_all_commands_run_as_printed(clone, monkeypatch, capsys):
    monkeypatch.chdir(clone)
    for command in COMMANDS:
        assert run_safely(expanded(command)) == 0, (command, capsys.readouterr())
    [code] = re.findall(r"```python\n(.*?)```", README, re.S)
    exec(compile(code, "README.md", "exec"), {})
