"""Commands that get signals at random moments; run as a module, this tries some and says what goes wrong.

From a shell: python -m tests.helpers.interrupting SEED TIMES COMMAND [COMMAND ...]
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.helpers.full_disk import whole
from tests.helpers.small_commands import command_line, prepare

PATIENCE = 180  # s, for a busy machine; a command that hangs is named
LONGEST = 25.0  # s, within which signals come
SIGNALS = {signal.SIGINT: 130, signal.SIGTERM: 143}
WHOLE = 1800.0  # s, within which a command that is left alone comes to its end
LEAVING = 60.0  # s, within which what a killed command had started is gone
AGAIN = 0.5  # s, within which an impatient user sends the signal again
GOES_ON = {"close-loop": ("--resume",)}  # what a command is given to go on after a kill


def interrupted(
    arguments: Sequence[str], folder: Path, temporary: Path, number: int, *after: float
) -> tuple[int, str]:
    """Exit code and output of a command that got a signal after each of these times [s], if it still ran."""
    process = subprocess.Popen(
        [sys.executable, "-m", "scenarios.cli", *arguments], text=True, cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=os.environ | {"TMPDIR": str(temporary)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    for wait in after:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(wait)
        process.send_signal(number)
    try:
        said, _ = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()  # what it had started is found as an orphan
        said, _ = process.communicate(timeout=PATIENCE)
    return process.returncode, said


def orphans(temporary: Path) -> list[str]:
    """Processes that have been given this folder for temporary files."""
    mark, found = f"TMPDIR={temporary}".encode(), []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended, or belongs to another user
            if mark in (process / "environ").read_bytes():
                found.append((process / "cmdline").read_bytes().replace(b"\0", b" ").decode())
    return found


def faults(code: int, said: str, number: int, out: Path, temporary: Path) -> list[str]:
    """What is wrong with a command that was interrupted, in words."""
    told = [line for line in said.splitlines() if line.startswith("railfmi: ")]
    found = []
    if code not in (0, 1, SIGNALS[signal.Signals(number)], -number):  # finished, told, or not even begun
        found.append(f"exit code {code}")
    if code == SIGNALS[signal.Signals(number)] and not (len(told) == 1 and "interrupted" in told[0]):
        found.append(f"{len(told)} lines in place of one")
    if code == -number and said:
        found.append("the signal ended it after it had begun to speak")
    if "Traceback" in said:
        found.append("a traceback")
    found += [f"orphan: {one}" for one in orphans(temporary)]
    found += [f"left in TMPDIR: {one.name}" for one in temporary.iterdir()]
    files = [file for file in out.rglob("*") if file.is_file()]
    found += [f"half file: {file.name}" for file in files if not whole(file)]
    found += [f"left: {file}" for file in out.rglob(".writing_*")]
    return found


def tried(command: str, seed: int, times: int, folder: Path) -> list[str]:
    """Faults of a command with signals at so many random moments of its run, in a folder with its inputs."""
    temporary, out = folder / f"temporary-{command}", folder / f"out-{command}"
    temporary.mkdir()
    arguments, rng = command_line(command, out), np.random.default_rng(seed)
    begun = time.monotonic()
    code, said = interrupted(arguments, folder, temporary, signal.SIGINT, LONGEST)
    lasts, found = min(time.monotonic() - begun, LONGEST), []
    if code not in (0, 1, SIGNALS[signal.SIGINT]):
        return [f"{command} is not sound: exit code {code}: {said}"]
    for i in range(times):
        shutil.rmtree(out, ignore_errors=True)
        number = [*SIGNALS][i % len(SIGNALS)]
        after = [rng.uniform(0.05, lasts), *([rng.uniform(0.0, AGAIN)] if rng.random() < 0.3 else [])]
        code, said = interrupted(arguments, folder, temporary, number, *after)
        wrong = faults(code, said, number, out, temporary)
        when = " and ".join(f"{t:.2f} s" for t in after)
        found += [f"{command}, {number.name} after {when} of {lasts:.1f} s: {one}: {said}" for one in wrong]
    return found


def killed(command: str, seed: int, times: int, folder: Path) -> list[str]:
    """Faults of a command that is killed at so many random moments, and of the next one, which goes on.

    What it leaves beside the results, under names that begin with a dot, the next command may remove.
    """
    temporary, out = folder / f"temporary-killed-{command}", folder / f"out-killed-{command}"
    temporary.mkdir()
    arguments, rng = command_line(command, out), np.random.default_rng(seed)
    begun = time.monotonic()
    code, said = interrupted(arguments, folder, temporary, signal.SIGINT, LONGEST)
    lasts, found = min(time.monotonic() - begun, LONGEST), []
    for _ in range(times):
        shutil.rmtree(out, ignore_errors=True)
        after = rng.uniform(0.05, lasts)
        interrupted(arguments, folder, temporary, signal.SIGKILL, after)
        until = time.monotonic() + LEAVING
        while (left := orphans(temporary)) and time.monotonic() < until:
            time.sleep(0.2)
        wrong = [f"orphan: {one}" for one in left]
        files = [file for file in out.rglob("*") if file.is_file() and not _is_aside(file, out)]
        wrong += [f"half file: {file.name}" for file in files if not whole(file)]
        found += [f"{command}, killed after {after:.2f} s of {lasts:.1f} s: {one}" for one in wrong]
    again = [*arguments, *GOES_ON.get(command, ())]
    code, said = interrupted(again, folder, temporary, signal.SIGINT, WHOLE)
    wrong = [f"left: {file}" for file in (*temporary.iterdir(), *out.rglob(".writing_*"))]
    wrong += [] if code in (0, 1) else [f"exit code {code}: {said}"]
    return found + [f"{command}, after it was killed: {one}" for one in wrong]


def _is_aside(file: Path, out: Path) -> bool:
    """Whether a file is written beside the results, to be renamed or moved when it is whole."""
    parts = file.relative_to(out).parts
    return any(part.startswith(".writing_") for part in parts) or (
        file.name.startswith(".") or file.suffix == ".part"
    )


def main(seed: int, times: int, commands: Sequence[str]) -> None:
    """Print faults as they are found."""
    with tempfile.TemporaryDirectory() as name:
        folder, compiled = Path(name) / "inputs", Path(name) / "compiled"
        compiled.mkdir()
        prepare(folder, compiled)
        for command in commands:
            begun = time.monotonic()
            found = tried(command, seed, times, folder)
            print(f"{command}: {times} moments, {len(found)} faults, {time.monotonic() - begun:.0f} s")
            print(*found, sep="\n", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
