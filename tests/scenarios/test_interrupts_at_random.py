"""SIGINT and SIGTERM at random moments of every command, some of them twice, as an impatient user does."""

import pytest

from tests.helpers.interrupting import killed, tried
from tests.helpers.small_commands import EVERY_COMMAND, command_line, prepare

SEED = 1
KILLED = ("build", "close-loop", "estimate", "run")  # commands that users wait for
MOMENTS = {command: 30 if command in KILLED else 12 for command in EVERY_COMMAND}  # of both signals


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    prepare(folder, tmp_path_factory.mktemp("compiled"))
    return folder


@pytest.mark.parametrize("command", EVERY_COMMAND)
def test_every_command_has_a_small_input(command, tmp_path):
    assert command_line(command, tmp_path)[0] == command


@pytest.mark.slow
@pytest.mark.parametrize("command", EVERY_COMMAND)
def test_an_interrupt_at_any_moment_leaves_nothing(command, inputs):
    """The exit code of the signal and one line; no traceback, no part of a file, no process, no folder."""
    assert tried(command, SEED, MOMENTS[command], inputs) == []


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("command", KILLED)
def test_a_kill_at_any_moment_leaves_no_half_file(command, inputs):
    """Nor a process; and the next command goes on, and removes what the killed ones have left beside."""
    assert killed(command, SEED, MOMENTS[command], inputs) == []
