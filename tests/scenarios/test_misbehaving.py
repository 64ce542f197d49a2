"""Misbehaving FMUs through every command: one sentence, exit code 2, and what was recorded is kept."""

import json
import re
from pathlib import Path

import pytest

from fmus.host.master.recording import read_recording
from scenarios.cli.app import run_safely
from tests.helpers.misbehaving import (
    AT_THE_END,
    DEATHS,
    ENDLESS,
    HARMLESS,
    NOT_FINITE,
    REFUSALS,
    Fault,
    bad_fmu,
)

PROGRESS = "... "  # how a line of progress begins, which is no message
LIMITS = ["--memory-limit", "0.6"]
SHORT = ["--call-limit", "4"]  # s, for what never comes back; all else ends by itself
COMMANDS = {
    "run": ["run", "scenario.toml", *LIMITS],
    "estimate": ["estimate", "experiment.toml", *LIMITS],
    "close-loop": ["close-loop", "experiment.toml", "--jobs", "1", *LIMITS],
    "compare": ["compare", "bad.fmu", "bad.fmu", "experiment.toml", *LIMITS],
    "plan": ["plan", "experiment.toml", *LIMITS],
    "close-loop --dry-run": ["close-loop", "--dry-run", "experiment.toml", *LIMITS],
}
EVERY = [(command, fault) for fault in (*DEATHS, *ENDLESS) for command in COMMANDS]
# every third fault, by turns through the commands; endless ones take as long as their limit
QUICK = {(list(COMMANDS)[i % len(COMMANDS)], fault) for i, fault in enumerate(DEATHS[::3])}
QUICK |= {("run", ENDLESS[0]), ("compare", ENDLESS[-1])}


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("misbehaving")


def told(
    command: str, fault: Fault, folder: Path, compiled: Path, capfd, monkeypatch
) -> tuple[int, str, str]:
    """Exit code and what is printed by a command on an FMU with this fault, in its folder."""
    bad_fmu(folder, fault, compiled)
    monkeypatch.chdir(folder)
    short = SHORT if "did not come back" in fault.words else []
    code = run_safely([*COMMANDS[command], *short, "--out", "out"])
    return code, *capfd.readouterr()


@pytest.mark.parametrize(
    ("command", "fault"),
    [pytest.param(*case, marks=() if case in QUICK else pytest.mark.slow) for case in EVERY],
    ids=lambda part: getattr(part, "name", part),
)
def test_an_end_is_one_sentence_and_exit_code_2(command, fault, tmp_path, compiled, capfd, monkeypatch):
    code, out, err = told(command, fault, tmp_path, compiled, capfd, monkeypatch)
    lines = [line for line in (out + err).splitlines() if line.strip() and not line.startswith(PROGRESS)]
    assert code == 2
    assert len(lines) == 1, lines
    assert "bad.fmu: " in lines[0]
    carried = command.startswith(("close-loop", "plan")) and fault.call in (
        "load",
        "instantiate",
        "get",
        "set",
        "setup",
        "reset",
    )
    assert re.search(fault.words.partition(".*")[2] if carried else fault.words, lines[0]), lines[0]
    assert not (tmp_path / "out" / "result.json").exists()
    if command == "run" and fault.call == "late":
        kept = read_recording(tmp_path / "out" / "run.parquet").data
        assert kept["time"].iloc[-1] == pytest.approx(0.05)
        assert f"what was recorded until t = 0.05 s is in {tmp_path}" in lines[0]


@pytest.mark.parametrize(
    "fault",
    [pytest.param(fault, marks=() if i % 3 == 0 else pytest.mark.slow) for i, fault in enumerate(HARMLESS)],
    ids=lambda fault: fault.name,
)
def test_what_does_no_harm_is_no_failure(fault, tmp_path, compiled, capfd, monkeypatch):
    code, out, err = told("run", fault, tmp_path, compiled, capfd, monkeypatch)
    assert code == 0, err
    assert out.splitlines()[0].startswith("bad: 1 of 1 expectations met")


def some(faults: tuple[Fault, ...]) -> list[object]:
    """Faults of which every third is quick."""
    return [
        pytest.param(fault, marks=() if i % 3 == 0 else pytest.mark.slow, id=fault.name)
        for i, fault in enumerate(faults)
    ]


def the_line(out: str, err: str) -> str:
    """The one line that a command says beside its progress."""
    [line] = [line for line in (out + err).splitlines() if line.strip() and not line.startswith(PROGRESS)]
    return line


@pytest.mark.parametrize("fault", some(REFUSALS))
def test_a_refusal_is_told_with_its_status(fault, tmp_path, compiled, capfd, monkeypatch):
    """An FMU that logs no reason leaves the status to tell; a step that is refused leaves the recording."""
    code, *said = told("run", fault, tmp_path, compiled, capfd, monkeypatch)
    assert code == 2
    assert re.search(fault.words, the_line(*said)), said
    assert "bad.fmu" in the_line(*said)
    assert (tmp_path / "out" / "run.parquet").exists() == (fault.call == "late")


@pytest.mark.parametrize("fault", some(AT_THE_END))
def test_a_run_whose_fmu_breaks_down_at_its_end_is_no_result(fault, tmp_path, compiled, capfd, monkeypatch):
    code, *said = told("run", fault, tmp_path, compiled, capfd, monkeypatch)
    assert code == 2
    assert re.search(fault.words, the_line(*said)), said
    assert not (tmp_path / "out" / "result.json").exists()
    kept = read_recording(tmp_path / "out" / "run.parquet").data
    assert kept["time"].iloc[-1] == pytest.approx(0.2)


@pytest.mark.parametrize("fault", some(NOT_FINITE))
def test_a_statement_over_what_is_not_finite_does_not_hold(fault, tmp_path, compiled, capfd, monkeypatch):
    code, out, _ = told("run", fault, tmp_path, compiled, capfd, monkeypatch)
    assert code == 1
    assert out.startswith("bad: 0 of 1 expectations met")
    assert re.search(fault.words, out)


@pytest.mark.parametrize(
    "command", ["run", *(pytest.param(c, marks=pytest.mark.slow) for c in ("estimate", "close-loop"))]
)
def test_isolation_changes_no_result(command, tmp_path, compiled, monkeypatch):
    """Nor does what another FMU has left in its process, as the direction of rounding."""
    monkeypatch.chdir(tmp_path)
    bad_fmu(tmp_path, Fault("rounding", "step", ""), compiled)
    run_safely([*COMMANDS["run"], "--out", "rounding"])
    bad_fmu(tmp_path, Fault("none", "none", ""), compiled)
    found = []
    for trusted in ((), ("--trust-fmu",)):
        run_safely([*COMMANDS[command], "--out", f"out{len(trusted)}", *trusted])
        result = json.loads((tmp_path / f"out{len(trusted)}" / "result.json").read_text())
        found.append(untimed(result))
    assert found[1] == found[0]
    for table in ("run.parquet", "estimate.csv"):
        files = [tmp_path / f"out{i}" / table for i in (0, 1)]
        assert files[0].exists() == files[1].exists()
        assert not files[0].exists() or files[0].read_bytes() == files[1].read_bytes()


def untimed(value: object) -> object:
    """A result without the times that its computation took, and what follows from these."""
    if isinstance(value, dict):
        timed = ("speed", "access", "refused")
        return {k: untimed(v) for k, v in value.items() if "seconds" not in k and k not in timed}
    return [untimed(v) for v in value] if isinstance(value, list) else value
