"""What the record of importers knows of a tool that somebody else wrote, and of one run in it."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar

from tests.helpers.paths import ROOT

EXACT = MappingProxyType({"CS": 1e-9, "ME": 1e-9})  # of a signal's largest value, by kind of simulation
SOLVED = MappingProxyType({"CS": 1e-9, "ME": 1e-3})  # where the tool's solver makes an error of its own
NOTHING: Mapping[tuple[str, str, int], str] = MappingProxyType({})
TIMEOUT = 300  # s, for one run
DEADLY = "the process ended with code {code}"


@dataclass(frozen=True)
class Case:
    """One run: an FMU, how it is run, what is set before the start, and which outputs are told."""

    fmu: str
    kind: str  # "CS", "ME"
    fmi: int
    step: float  # s
    steps: int
    start: Mapping[str, float]  # empty where the tool sets none
    outputs: list[str]

    @property
    def stop(self) -> float:
        """End of the run, s."""
        return self.step * self.steps


class Importer(ABC):
    """A tool. A file in the folder `importers` defines one; that is all that is needed."""

    name: ClassVar[str]  # as its authors write it
    about: ClassVar[str]  # written in what, around what
    reads: ClassVar[frozenset[tuple[str, int]]]  # kind and FMI version
    packages: ClassVar[tuple[str, ...]] = ()  # of the Python index; the first one gives the version
    program: ClassVar[str] = ""  # an executable on the path
    solver: ClassVar[str] = ""  # of model exchange: "cvode", "euler"
    sets_start: ClassVar[bool] = True
    resolution: ClassVar[float] = 0.0  # of what it prints, absolute
    tolerance: ClassVar[Mapping[str, float]] = EXACT
    # build, kind, FMI version: why it cannot run it
    fails: ClassVar[Mapping[tuple[str, str, int], str]] = NOTHING
    remark: ClassVar[str] = ""  # for the page

    @classmethod
    def missing(cls) -> str:
        """Why the tool cannot be run here; empty where it can."""
        for package in cls.packages:
            try:
                version(package)
            except PackageNotFoundError:
                return f"package {package} is not installed"
        if cls.program and not shutil.which(cls.program):
            return f"program {cls.program} is not on the path"
        return ""

    @classmethod
    def version(cls) -> str:
        """Version of the tool that is here."""
        return version(cls.packages[0])

    @abstractmethod
    def run(self, case: Case, folder: Path) -> list[list[float]]:
        """Outputs after each step, (steps, outputs), in a process of its own; folder: empty, to write to."""


def importers() -> list[type[Importer]]:
    """All tools, by name."""
    folder = Path(__file__).parent / "importers"
    for file in sorted(folder.glob("*.py")):
        importlib.import_module(f"{__package__}.importers.{file.stem}")
    found = [c for c in every(Importer) if c.__module__.startswith(f"{__package__}.importers.")]
    return sorted(found, key=lambda c: c.name.lower())


def every(kind: type[Any]) -> list[type[Any]]:
    """Classes derived from one that can be made."""
    return [c for s in kind.__subclasses__() for c in (s, *every(s)) if "name" in vars(c)]


class Failed(Exception):
    """A tool did not run an FMU; the message says what it said."""


def run(tool: type[Importer], case: Case, folder: Path) -> list[list[float]]:
    """The rows of a run in a process of its own, so that a crash is that run's alone."""
    call = [sys.executable, "-m", f"{__package__}.child", tool.__module__, str(folder)]
    try:
        done = subprocess.run(
            call, input=json.dumps(asdict(case)), cwd=ROOT, capture_output=True, text=True, timeout=TIMEOUT
        )
    except subprocess.TimeoutExpired as error:
        raise Failed(f"no end after {TIMEOUT} s") from error
    rows = [line for line in done.stdout.splitlines() if line.startswith("ROWS ")]
    if done.returncode or not rows:
        said = (done.stderr + done.stdout).strip().splitlines()
        raise Failed("\n".join([DEADLY.format(code=done.returncode), *said[-8:]]))
    return json.loads(rows[-1].removeprefix("ROWS "))


def with_python() -> dict[str, str]:
    """The environment in which a program that is not Python can run a PythonFMU build."""
    library = Path(sysconfig.get_config_var("LIBDIR")) / sysconfig.get_config_var("LDLIBRARY")
    return {
        **os.environ,
        "LD_PRELOAD": str(library),
        "PYTHONPATH": sysconfig.get_path("purelib"),
        "PYTHONHOME": sys.base_prefix,
    }


def told(*command: str | Path, folder: Path) -> str:
    """What a program prints; Failed where it ends with an error."""
    done = subprocess.run(
        [str(c) for c in command],
        cwd=folder,
        env=with_python(),
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    if done.returncode:
        raise Failed(f"{DEADLY.format(code=done.returncode)}: {(done.stdout + done.stderr).strip()[-500:]}")
    return done.stdout + done.stderr


def table(file: Path, case: Case, prefix: str = "", early: float = 0.0) -> list[list[float]]:
    """Rows of a CSV file at the ends of the steps of a run; names may be in quotes and have a prefix.

    early: by how much the times of the file are too early, s.
    """
    head, *lines = file.read_text().splitlines()
    names = [re.sub(r'^"|"$', "", n.strip()) for n in head.split(",")]
    rows = [[float(v) for v in line.split(",")[: len(names)]] for line in lines if line.strip()]
    wanted = [names.index(prefix + n) for n in case.outputs]
    found = []
    for k in range(1, case.steps + 1):
        time = k * case.step - early
        nearest = min(rows, key=lambda row: abs(row[0] - time))
        if abs(nearest[0] - time) > 1e-6 * case.step:
            raise Failed(f"no row at {time:g} s")
        found.append([nearest[i] for i in wanted])
    return found
