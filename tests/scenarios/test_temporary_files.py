"""Temporary files of a command lie where the user said, else on a disk, and are gone when it has ended."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fmus import aside
from scenarios.cli.supervision import ROOMY

SHOWN = """
import sys
import tempfile

from scenarios.cli.supervision import supervised


def command(arguments):
    print(tempfile.gettempdir())
    return 0


sys.exit(supervised(command, []))
"""

needs_roomy = pytest.mark.skipif(not os.access(ROOMY, os.W_OK), reason=f"{ROOMY} cannot be written here")


def shown(**variables):
    """The folder for temporary files of a command in an environment with these variables."""
    given = {name: value for name, value in os.environ.items() if name != "TMPDIR"} | variables
    ran = subprocess.run([sys.executable, "-c", SHOWN], env=given, capture_output=True, text=True, check=True)
    return Path(ran.stdout.strip())


@needs_roomy
def test_long_arrays_of_a_command_lie_on_a_disk():
    assert aside.FOLDER == ROOMY
    folder = shown()
    assert folder.parent == Path(ROOMY)
    assert not folder.exists()


def test_they_lie_where_the_user_said(tmp_path):
    assert shown(TMPDIR=str(tmp_path)).parent == tmp_path
    assert list(tmp_path.iterdir()) == []
