"""SIGINT and SIGTERM end every command, in words, and leave no process and no folder behind."""

import contextlib
import fcntl
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from fmus.files import remove_left
from fmus.host.master.recording import read_recording
from scenarios.cli.supervision import FOLDER, hint
from scenarios.tasks.undisturbed import undisturbed
from tests.helpers.interrupting import PATIENCE, SIGNALS, orphans
from tests.helpers.misbehaving import EXPERIMENT, SCENARIO, Fault, bad_fmu, write_data
from tests.helpers.paths import SHIPPED
from tests.helpers.small_commands import command_line

LATEST = 20.0  # s, after an interrupt: four times as long as it may take, for a busy machine

SWALLOWS = """if t > 0.05:
    open({mark!r}, "w").close()
    while True:
        try:
            time.sleep(0.01)
        except BaseException:
            {then}
self.x += dt * (self.u - self.k * self.x)"""


def begun(arguments: Sequence[str | Path], folder: Path) -> subprocess.Popen[str]:
    """A command that has been started, with its temporary files in `folder`."""
    return subprocess.Popen(
        [sys.executable, "-m", "scenarios.cli", *map(str, arguments)], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=os.environ | {"TMPDIR": str(folder)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip


def ended(
    arguments: Sequence[str | Path], number: int, there: Path, folder: Path
) -> subprocess.CompletedProcess[str]:
    """A command to which a signal was sent as soon as a file was there; its temporary files in `folder`."""
    process = begun(arguments, folder)
    until = time.monotonic() + PATIENCE
    while not any(Path("/").glob(str(there)[1:])) and process.poll() is None and time.monotonic() < until:
        time.sleep(0.05)
    assert process.poll() is None, process.communicate()[0]
    process.send_signal(number)
    said, _ = process.communicate(timeout=PATIENCE)
    return subprocess.CompletedProcess(process.args, process.returncode, said, "")


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """A folder as it is while a command uses it."""
    lock = os.open(folder, os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    yield
    os.close(lock)


def assert_tidied(folder: Path) -> None:
    """No temporary file is left, and no process that had been given this folder for them."""
    assert list(folder.iterdir()) == []
    assert orphans(folder) == []


@pytest.fixture
def swallowing(tmp_path, foreign):
    """A folder with an FMU in Python that takes interrupts for itself, and where it says that it steps."""

    def write(then):
        (tmp_path / "bad.fmu").write_bytes(
            foreign(SWALLOWS.format(mark=str(tmp_path / "begun"), then=then)).read_bytes()
        )
        (tmp_path / "scenario.toml").write_text(SCENARIO)
        bare = EXPERIMENT.replace('unit = "m"', 'unit = "m"\nmodel_unit = "m"')
        (tmp_path / "experiment.toml").write_text(bare.partition("[[ports]]")[0])
        write_data(tmp_path)
        (tmp_path / "temporary").mkdir()
        return tmp_path

    return write


@pytest.mark.parametrize("number", SIGNALS, ids=lambda n: n.name)
def test_a_run_keeps_its_recording_while_an_fmu_steps(swallowing, number):
    folder = swallowing("pass")
    arguments = ["run", folder / "scenario.toml", "--out", folder / "out"]
    done = ended(arguments, number, folder / "begun", folder / "temporary")
    assert done.returncode == SIGNALS[number]
    assert "interrupted" in done.stdout
    kept = read_recording(folder / "out" / "run.parquet").data["time"].iloc[-1]
    assert kept == pytest.approx(0.051)
    assert_tidied(folder / "temporary")


@pytest.mark.parametrize(
    ("then", "number"),
    [
        ("return False", signal.SIGINT),
        pytest.param("pass", signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param("raise", signal.SIGINT, marks=pytest.mark.slow),
    ],
)
def test_an_interrupt_is_no_failure_of_a_trusted_fmu(swallowing, then, number):
    """It runs in the process of the command, and takes the exception for itself."""
    folder = swallowing(then)
    arguments = ["run", folder / "scenario.toml", "--out", folder / "out", "--trust-fmu"]
    done = ended(arguments, number, folder / "begun", folder / "temporary")
    assert done.returncode == SIGNALS[number]
    assert "interrupted" in done.stdout
    for blame in ("refused", "failed", "Traceback", "check"):
        assert blame not in done.stdout
    assert_tidied(folder / "temporary")


@pytest.mark.slow
@pytest.mark.parametrize("trusted", [(), ("--trust-fmu",)], ids=["apart", "trusted"])
@pytest.mark.parametrize("command", ["estimate", "close-loop"])
def test_the_fits_of_an_fmu_are_interrupted(swallowing, command, trusted):
    folder = swallowing("return False")
    arguments = [command, folder / "experiment.toml", "--out", folder / "out", *trusted]
    done = ended(arguments, signal.SIGINT, folder / "begun", folder / "temporary")
    assert done.returncode == 130
    assert "interrupted" in done.stdout
    assert ("--resume" in done.stdout) == (command == "close-loop")
    assert "refused" not in done.stdout
    assert_tidied(folder / "temporary")


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS, ids=lambda n: n.name)
@pytest.mark.parametrize("step", ["calibrated", "detection", "singles"])
def test_a_loop_says_how_to_go_on(tmp_path, step, number):
    (tmp_path / "temporary").mkdir()
    arguments = ["close-loop", SHIPPED / "demo" / "rig-drag", "--out", tmp_path / "out", "--jobs", "2"]
    kept = tmp_path / "out" / ".stages" / f"{step}.checkpoint"
    done = ended(arguments, number, kept, tmp_path / "temporary")
    assert done.returncode == SIGNALS[number]
    assert "--resume" in done.stdout
    assert kept.exists()
    assert_tidied(tmp_path / "temporary")


def test_what_an_fmu_sends_into_the_background_ends_with_the_command(tmp_path, tmp_path_factory):
    """It has left the command's session and its parent, as a daemon does."""
    bad_fmu(tmp_path, Fault("background", "step", ""), tmp_path_factory.mktemp("compiled"))
    (tmp_path / "temporary").mkdir()
    command = ["run", str(tmp_path / "scenario.toml"), "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-m", "scenarios.cli", *command], capture_output=True, text=True, timeout=PATIENCE,
        env=os.environ | {"TMPDIR": str(tmp_path / "temporary")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert_tidied(tmp_path / "temporary")


def test_the_next_command_tidies_up_after_a_killed_one(tmp_path):
    """SIGKILL leaves it no time; a folder that is in use stays."""
    left, used = tmp_path / f"{FOLDER}left", tmp_path / f"{FOLDER}used"
    for folder in (left, used):
        folder.mkdir()
    (left / "library.so").touch()
    with locked(used):
        remove_left(tmp_path, FOLDER)
    assert not left.exists()
    assert used.exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS, ids=lambda n: n.name)
def test_a_build_leaves_no_compiler(tmp_path, number):
    (tmp_path / "temporary").mkdir()
    arguments = ["build", "wheelset", "--kind", "native", "--platform", "all", "--out", tmp_path / "out"]
    folders = tmp_path / "temporary" / "railfmi_*" / "railfmi_*"
    done = ended(arguments, number, folders, tmp_path / "temporary")
    assert done.returncode == SIGNALS[number]
    assert "interrupted" in done.stdout
    assert not (tmp_path / "out").exists()
    assert_tidied(tmp_path / "temporary")


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS, ids=lambda n: n.name)
def test_a_fleet_ends_in_one_line_while_its_workers_start(tmp_path, number):
    """Half of a cluster, which its library cannot close, would end in tracebacks of that library."""
    pytest.importorskip("distributed", reason="the extra 'fleet' is not installed")
    (tmp_path / "temporary").mkdir()
    fleet = SHIPPED / "fleet" / "fleet.toml"
    arguments = ["fleet", fleet, "--workers", "2", "--quiet", "--out", tmp_path / "out"]
    workers = tmp_path / "temporary" / "railfmi_*" / "railfmi_workers_*"
    done = ended(arguments, number, workers, tmp_path / "temporary")
    assert done.returncode == SIGNALS[number]
    assert done.stdout.startswith("railfmi: interrupted")
    assert len(done.stdout.splitlines()) == 1, done.stdout
    assert_tidied(tmp_path / "temporary")


@pytest.fixture
def silent():
    """The address of a scheduler that takes a connection and never says a word, and when it has taken one."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE)
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}", server.accept


@pytest.mark.parametrize(
    ("command", "number"),
    [("campaign", signal.SIGINT), pytest.param("fleet", signal.SIGTERM, marks=pytest.mark.slow)],
)
def test_a_command_that_connects_to_a_scheduler_says_how_to_go_on(command, number, silent, tmp_path):
    """The library would wait a minute to close a client whose start was broken off."""
    pytest.importorskip("distributed", reason="the extra 'fleet' is not installed")
    address, taken = silent
    (tmp_path / "temporary").mkdir()
    arguments = [*command_line(command, tmp_path / "out"), "--scheduler", address, "--quiet"]
    with begun(arguments, tmp_path / "temporary") as process:
        try:
            connection, _ = taken()
            with connection:
                time.sleep(0.5)  # it waits for an answer
                since = time.monotonic()
                process.send_signal(number)
                said, _ = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert time.monotonic() - since < LATEST
    assert process.returncode == SIGNALS[number]
    [line] = said.splitlines()
    assert line.startswith("railfmi: interrupted; ")
    assert line.endswith("the same command goes on from here")
    assert_tidied(tmp_path / "temporary")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fleet", "watch"], "the same command goes on from here"),
        (["watch", "--once"], "from the last window"),
        (["-q", "close-loop", "fleet"], "--resume"),
        (["run", "watch"], "files that were finished before are kept"),
        ([], "files that were finished before are kept"),
    ],
)
def test_what_is_said_of_an_interrupt_is_of_the_command(arguments, words):
    """Not of a file that has the name of another one."""
    assert words in hint(arguments)


@pytest.fixture
def raising():
    """Ctrl-C raises KeyboardInterrupt, as where a script runs in the foreground."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("fails", [False, True])
def test_ctrl_c_comes_after_what_it_must_not_break_off(raising, fails):
    steps = []

    def block():
        with undisturbed():
            signal.raise_signal(signal.SIGINT)
            steps.append("after the signal")
            if fails:
                raise RuntimeError("as of a worker that got the signal too")

    with pytest.raises(KeyboardInterrupt):
        block()
    assert steps == ["after the signal"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_nothing_comes_where_no_ctrl_c_was(raising):
    with undisturbed():
        pass
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_a_job_in_the_background_goes_on_ignoring_ctrl_c(raising):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with undisturbed():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


DROPPED = """
import os, signal, sys, time, weakref
from scenarios.cli.supervision import supervised

class Thing: pass

def command(_):
    try:
        thing = Thing()
        held = weakref.ref(thing, lambda _: os.kill(os.getpid(), signal.SIGINT))
        del thing
        time.sleep(3600)
    except KeyboardInterrupt:
        return 130
    return 0

sys.exit(supervised(command, []))
"""


def test_an_interrupt_that_python_drops_comes_again():
    """In a callback of a reference, such as importlib has, an exception is printed and forgotten."""
    done = subprocess.run(
        [sys.executable, "-c", DROPPED], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
