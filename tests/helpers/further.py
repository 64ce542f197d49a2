"""Files of a user's own beside the package, by RAILFMI_PATH, in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

from tests.helpers.paths import ROOT


class Further:
    """A folder that mirrors the packages; what is written there counts as part of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "mine"
        self.work = folder

    def write(self, path: str, text: str) -> Path:
        """Write one file of the mirror."""
        file = self.folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(dedent(text), encoding="utf-8")
        return file

    def python(self, *arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
        """Run Python with the folder on RAILFMI_PATH, in the working folder or another one."""
        told = {"RAILFMI_PATH": str(self.folder), "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
        command = [sys.executable, *arguments]
        return subprocess.run(
            command, env=os.environ | told, cwd=folder or self.work, capture_output=True, text=True
        )

    def railfmi(self, *arguments: str) -> str:
        """What a command of railfmi writes, which must succeed."""
        done = self.python("-m", "scenarios.cli", *arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def refused(self, *arguments: str) -> str:
        """The one line with which a command of railfmi ends that must fail for its input."""
        done = self.python("-m", "scenarios.cli", *arguments)
        assert done.returncode == 2, done.stderr
        assert len(done.stderr.splitlines()) == 1, done.stderr
        return done.stderr

    def says(self, script: str, *arguments: str) -> str:
        """What a Python script prints, which must succeed."""
        done = self.python("-c", dedent(script), *arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def passes(self, *arguments: str) -> int:
        """How many tests of the repository pass, of which none may fail."""
        done = self.python("-m", "pytest", "-n0", "-p", "no:cacheprovider", *arguments, folder=ROOT)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
        words = done.stdout.split("\n")[-2].split()
        return int(
            words[words.index("passed") - 1] if "passed" in words else words[words.index("passed,") - 1]
        )
