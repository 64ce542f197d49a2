"""Checksums by which a task is known: of files, of tables, and of the code that answers."""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from scenarios.experiment.beside import read_with

ROOT = Path(__file__).parents[2]
# what an answer follows from; pages, commands and the assembly of results are no part of it
ANSWERING = (
    "fmus", "estimator", "scenarios/closing", "scenarios/estimating", "scenarios/experiment",
    "scenarios/simulating", "scenarios/track", "scenarios/fleet/work.py", "scenarios/campaign/work.py",
)  # fmt: skip


def hash_of_file(file: Path) -> str:
    """SHA-256 of a file, read in blocks; raises OSError."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def hash_of_data(data: Path) -> str:
    """SHA-256 over a data file and those beside it that say how it is read; raises OSError."""
    return hash_of(
        [hash_of_file(file) if file == data or file.is_file() else None for file in read_with(data)]
    )


def hash_of(value: Any) -> str:
    """SHA-256 of a value that TOML can hold, the same for tables in any order of their keys."""
    text = json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"), default=str)
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def hash_of_program() -> str:
    """SHA-256 of the Python files that decide an answer, those of RAILFMI_PATH among them."""
    digest = hashlib.sha256()
    for name, file in _sources():
        digest.update(f"{name}\0".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _sources() -> Iterator[tuple[str, Path]]:
    for package in ANSWERING:
        yield from _below(ROOT / package, ROOT)
    for place in filter(None, os.environ.get("RAILFMI_PATH", "").split(os.pathsep)):
        yield from _below(Path(place), Path(place))


def _below(place: Path, root: Path) -> Iterable[tuple[str, Path]]:
    files = [place] if place.is_file() else place.rglob("*.py")
    return sorted((file.relative_to(root).as_posix(), file) for file in files)
