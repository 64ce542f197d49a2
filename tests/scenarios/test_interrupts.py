"""SIGINT and SIGTERM end every command, in words, and leave no process and no folder behind."""

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from fmus.files import remove_left
from fmus.host.master.recording import read_recording
from scenarios.cli.supervision import FOLDER
from tests.helpers.interrupting import PATIENCE, SIGNALS, orphans
from tests.helpers.misbehaving import EXPERIMENT, SCENARIO, Fault, bad_fmu, write_data
from tests.helpers.paths import SHIPPED

SWALLOWS = """if t > 0.05:
    open({mark!r}, "w").close()
    while True:
        try:
            time.sleep(0.01)
        except BaseException:
            {then}
self.x += dt * (self.u - self.k * self.x)"""


def ended(
    arguments: Sequence[str | Path], number: int, begun: Path, folder: Path
) -> subprocess.CompletedProcess[str]:
    """A command to which a signal was sent as soon as a file was there; its temporary files in `folder`."""
    command = [sys.executable, "-m", "scenarios.cli", *map(str, arguments)]
    process = subprocess.Popen(
        command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        env=os.environ | {"TMPDIR": str(folder)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    until = time.monotonic() + PATIENCE
    while not any(Path("/").glob(str(begun)[1:])) and process.poll() is None and time.monotonic() < until:
        time.sleep(0.05)
    assert process.poll() is None, process.communicate()[0]
    process.send_signal(number)
    said, _ = process.communicate(timeout=PATIENCE)
    return subprocess.CompletedProcess(command, process.returncode, said, "")


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
    begun = tmp_path / "out" / ".stages" / f"{step}.checkpoint"
    done = ended(arguments, number, begun, tmp_path / "temporary")
    assert done.returncode == SIGNALS[number]
    assert "--resume" in done.stdout
    assert begun.exists()
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
    begun = tmp_path / "temporary" / "railfmi_*" / "railfmi_*"
    done = ended(arguments, number, begun, tmp_path / "temporary")
    assert done.returncode == SIGNALS[number]
    assert "interrupted" in done.stdout
    assert not (tmp_path / "out").exists()
    assert_tidied(tmp_path / "temporary")
