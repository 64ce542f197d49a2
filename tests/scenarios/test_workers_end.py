"""Workers of a command that is killed end too, though nobody tells them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SHOWN = """
import os
import sys
import time

from joblib import Parallel, delayed

from estimator.workers import workers_end_too
from scenarios.cli.supervision import supervised


def busy():
    os.write(1, f"{os.getpid()}\\n".encode())
    time.sleep(600)


def command(arguments):
    with workers_end_too():
        Parallel(n_jobs=2)(delayed(busy)() for _ in range(2))
    return 0


sys.exit(supervised(command, []))
"""
PATIENCE = 60.0  # s


def runs(process):
    """Whether a process has not ended; one that nobody waits for has."""
    try:
        about = Path(f"/proc/{process}/stat").read_text(errors="replace")
    except OSError:
        return False
    return about.rpartition(")")[2].split()[0] != "Z"


@pytest.mark.skipif(sys.platform != "linux", reason="what runs is read from /proc")
def test_workers_end_with_a_command_that_is_killed():
    with subprocess.Popen([sys.executable, "-c", SHOWN], stdout=subprocess.PIPE, text=True) as command:
        workers = [int(command.stdout.readline()) for _ in range(2)]
        assert all(map(runs, workers))
        command.send_signal(signal.SIGKILL)
    until = time.monotonic() + PATIENCE
    while any(map(runs, workers)) and time.monotonic() < until:
        time.sleep(0.1)
    left = [worker for worker in workers if runs(worker)]
    for worker in left:
        os.kill(worker, signal.SIGKILL)
    assert not left
