"""The benchmark of fleets: runs are kept and go on, kills are noted, the outcome says what is not right."""

import sys
from pathlib import Path

import psutil
import pytest

from benchmarks.fleet.arms import Clock, Kept, cut, timed
from benchmarks.fleet.kills import Early, kill_client, killed_at, started
from benchmarks.fleet.outcome import KILLED, Outcome, busy, told

TASKS = 6
# a command with a process of its own that finishes a task each 0.1 s, those that are not there yet
WORK = """
import json, os, pathlib, sys, time
for k in range(6):
    file = pathlib.Path(sys.argv[1]) / ".tasks" / "00" / f"{k}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    if not file.exists():
        time.sleep(0.1)
        file.write_text(json.dumps({"seconds": 0.1}))
"""
COMMAND = f"import subprocess, sys; sys.exit(subprocess.call([sys.executable, '-c', {WORK!r}, sys.argv[1]]))"


def command(out: Path) -> list[str]:
    return [sys.executable, "-c", COMMAND, str(out)]


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr("benchmarks.fleet.kills.LOOK", 0.02)
    monkeypatch.setattr("benchmarks.fleet.arms.LOOK", 0.02)
    monkeypatch.setattr("benchmarks.fleet.arms.TOLD", 0.0)


def kept_in(folder: Path, **asked: int) -> Kept:
    return Kept(folder / "arms.json", asked or {"records": TASKS})


def clock(said: list[str]) -> Clock:
    return Clock(TASKS, {"1": 1, "2": 2, KILLED: 2}, said.append)


def test_a_run_that_is_cut_off_goes_on_and_its_time_is_that_of_both_sessions(tmp_path):
    first = kept_in(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        timed("1", command(tmp_path / "1"), tmp_path / "1", first, Clock(TASKS, {"1": 1}, interrupting))
    left = first.arm("1").seconds
    said: list[str] = []
    again = timed("1", command(tmp_path / "1"), tmp_path / "1", kept_in(tmp_path), clock(said))
    assert (again.done, again.sessions) == (True, 2)
    assert again.seconds > left > 0
    assert busy(tmp_path / "1") == pytest.approx(0.6)
    assert any("min to the end of all" in line for line in said)
    assert timed("1", ["no such command"], tmp_path / "1", kept_in(tmp_path), clock(said)) == again


def interrupting(_: str) -> None:
    raise KeyboardInterrupt


def test_what_was_asked_for_otherwise_is_not_taken_over(tmp_path):
    kept_in(tmp_path).keep()
    with pytest.raises(SystemExit, match="--anew"):
        kept_in(tmp_path, records=9)


def test_a_command_that_fails_ends_the_benchmark(tmp_path):
    with pytest.raises(SystemExit, match="exit code 3"):
        timed("1", [sys.executable, "-c", "raise SystemExit(3)"], tmp_path, kept_in(tmp_path), clock([]))


def test_a_kill_on_the_way_is_noted_once(tmp_path):
    out, kept = tmp_path / KILLED, kept_in(tmp_path)
    cut(KILLED, "client", command(out), out, 2, kill_client, kept, clock([]))
    assert kept_in(tmp_path).arm(KILLED).killed["client"] != 0
    cut(KILLED, "client", ["no such command"], out, 2, kill_client, kept_in(tmp_path), clock([]))
    with pytest.raises(SystemExit, match="before the worker could be killed"):
        cut(KILLED, "worker", command(out), out, 5, lambda _: False, kept, clock([]))


def test_nothing_is_killed_in_a_run_that_has_ended(tmp_path):
    with pytest.raises(Early) as caught:
        killed_at([sys.executable, "-c", "raise SystemExit(4)"], tmp_path / "x", 1, kill_client)
    assert caught.value.args == (4,)


def test_a_run_ends_with_what_started_it(tmp_path):
    with started([sys.executable, "-c", "import time; time.sleep(60)"], tmp_path / "log") as process:
        assert psutil.pid_exists(process.pid)
    assert process.returncode is not None


def right(**other: object) -> Outcome:
    sound = {
        "records": TASKS, "efficiency": 0.95, "same_bytes": {"2": True, KILLED: True},
        "killed": {"client": 2, "scheduler": 2, "worker": 0}, "seconds": {"1": 10.0, "2": 5.3},
        "sessions": {"1": 1, "2": 2}, "task_seconds": {"1": 9.0, "2": 9.2},
    }  # fmt: skip
    return Outcome(**{**sound, **other})  # type: ignore[arg-type]  # by name


@pytest.mark.parametrize(
    "wrong",
    [
        {"efficiency": 0.89}, {"same_bytes": {"2": False, KILLED: True}}, {"drift_found": ["rig-001"]},
        {"broken_true": ["rig-001-01"]}, {"killed": {"client": 2, "scheduler": 2}},
        {"killed": {"client": 0, "scheduler": 2, "worker": 0}},
        {"killed": {"client": 2, "scheduler": 2, "worker": 1}},
    ],
    ids=str,
)  # fmt: skip
def test_the_outcome_is_right_only_if_all_is(wrong):
    assert right().right
    assert not right(**wrong).right


def test_the_outcome_is_told_as_a_table():
    said = told(right())
    assert "| run, 2 workers | 5 s, in 2 sessions; its tasks alone 9 s |" in said
    assert "| parallel efficiency | 95.0% |" in said
    assert "| exit code after the worker was killed | 0 |" in said
