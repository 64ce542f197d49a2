"""How loudly commands speak: --json, -q, -v, progress with counts and times, completion."""

import ast
import json
import math
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from scenarios.cli import voice
from scenarios.cli.app import COMMANDS, loaded, run_safely
from scenarios.cli.console import show
from scenarios.cli.voice import Progress, plain, progress, span
from tests.helpers.paths import ROOT, SHIPPED

CLI = ROOT / "scenarios" / "cli"
RECORD = str(SHIPPED / "demo" / "rig-drag" / "data.csv")


def test_progress_tells_elapsed_and_expected_time():
    now = [0.0]
    shown = Progress("reading", lambda: now[0])
    now[0] = 3.0
    assert str(shown) == "reading (3 s)"
    shown.update("fitting, 0 of 40")
    now[0] = 23.0
    shown.update("fitting, 10 of 40")
    assert str(shown) == "fitting, 10 of 40 (23 s, about 1 min 00 s left in this step)"
    shown.update("drawing, 1 of 2")  # another step: what the last one took says nothing of it
    assert str(shown) == "drawing, 1 of 2 (23 s)"
    assert span(59.6) == "1 min 00 s"


def test_a_count_may_be_a_time_with_more_behind_it():
    now = [0.0]
    shown = Progress("a: its run, 0.00 of 10 s, 0.0 times real time", lambda: now[0])
    now[0] = 5.0
    shown.update("a: its run, 2.50 of 10 s, 0.5 times real time")
    assert str(shown).endswith("(5 s, about 15 s left in this step)")


@pytest.mark.parametrize(("quiet", "verbose"), [(False, False), (True, False), (False, True)])
def test_progress_off_a_terminal_is_plain_lines_after_a_while(monkeypatch, quiet, verbose):
    out = StringIO()
    monkeypatch.setattr(voice, "said", Console(file=out, highlight=False, force_terminal=False))
    monkeypatch.setattr(voice, "PATIENCE", 0.1)
    monkeypatch.setattr(voice, "INTERVAL", 600.0)
    monkeypatch.setattr(voice, "TICK", 0.05)
    voice.VOICE.begin()
    voice.VOICE.quiet, voice.VOICE.verbose = quiet, verbose

    def waited(text: str, comes: bool) -> None:
        """Wait until a text was said, or long enough to be sure that it is not."""
        until = time.monotonic() + (60.0 if comes else 0.4)
        while time.monotonic() < until and not (comes and text in out.getvalue()):
            time.sleep(0.02)

    with progress("first, 1 of 3") as told:
        waited("... first, 1 of 3 (", not quiet)
        told.update("second")
        waited("... second (", verbose)
    voice.VOICE.begin()
    said = out.getvalue()
    assert "\x1b" not in said
    assert ("... first, 1 of 3 (" in said) is not quiet
    assert ("... second (" in said) is verbose


@dataclass(frozen=True)
class Holds:
    file: Path
    value: object


def test_what_is_not_of_json_becomes_so():
    given = Holds(Path("a/b"), {"n": np.float64(2.5), "x": np.array([1.0, math.nan]), "s": (True, None)})
    assert plain(given) == {"file": "a/b", "value": {"n": 2.5, "x": [1.0, None], "s": [True, None]}}


@pytest.mark.parametrize("tell", [voice.echo, voice.echo_coloured, lambda line: show([line])])
def test_nothing_is_printed_that_a_terminal_obeys(tell, capfd):
    """Names in an FMU or a record may hold its codes; spaces without a line break are none."""
    voice.VOICE.begin()
    tell("a\u00a0b \x1b[2J\x1b]0;title\x07 \u202eedocnu \x9b1m \ud800")
    said = "".join(capfd.readouterr()).replace("\n", "")
    assert said == "a\u00a0b \ufffd[2J\ufffd]0;title\ufffd \ufffdedocnu \ufffd1m \ufffd"


def test_json_is_all_that_stands_on_the_output(tmp_path, capsys):
    assert run_safely(["inspect", RECORD, "--out", str(tmp_path), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["command"], answer["exit"]) == ("inspect", 0)
    assert answer["lines"][0].startswith("data.csv: 5001 rows")
    assert run_safely(["check", "nope.fmu", "--json"]) == 2
    shown = capsys.readouterr()
    assert "no such FMU file" in json.loads(shown.out)["error"]
    assert "railfmi: nope.fmu" in shown.err
    assert run_safely(["row"]) == 0  # the next command speaks as usual
    assert not capsys.readouterr().out.startswith("{")


def test_json_holds_the_result(tmp_path, capsys):
    assert run_safely(["build", "drive", "--out", str(tmp_path), "--json"]) == 0
    [made] = json.loads(capsys.readouterr().out)["result"]
    assert Path(made).is_file()
    assert run_safely(["check", made, "--json"]) == 0
    checks = json.loads(capsys.readouterr().out)["result"]["checks"]
    assert {c["passed"] for c in checks} <= {True, None}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_tells_its_progress_and_what_its_answer_is_made_of(name):
    tree = ast.parse((CLI / f"{COMMANDS[name]}.py").read_text())
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert {"found", "progress"} <= names or "carried_out" in names


@pytest.mark.parametrize("arguments", [["row"], ["inspect", RECORD]], ids=["row", "inspect"])
def test_json_has_a_result(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run_safely([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["result"]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_the_common_options(name):
    from typer.main import get_command

    command = get_command(loaded([name]))
    opts = {o for p in command.commands[name].params for o in p.opts}
    assert {"-q", "--quiet", "-v", "--verbose", "--json"} <= opts


def test_a_shell_can_complete_commands_and_their_options():
    def completed(words: str) -> list[str]:
        env = {
            **os.environ, "PYTHONPATH": str(ROOT), "_RAILFMI_COMPLETE": "complete_bash", "COMP_WORDS": words,
            "COMP_CWORD": str(len(words.split()) - 1),
        }  # fmt: skip
        script = "import sys; sys.argv = ['railfmi']; from scenarios.cli import main; main()"
        done = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True)
        return done.stdout.split()

    assert "close-loop" in completed("railfmi clo")
    assert completed("railfmi close-loop --dr") == ["--dry-run"]
