"""The code that answers: the files that close-loop reads while it answers a record, and their digests.

A scoreboard keeps the digests of its commit, so that anybody can see whether the tree at hand still answers
with the same code. `python -m benchmarks.challenge.code RECORD` prints the files, one a line.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

ROOT = Path(__file__).parents[2]
WRITTEN = {".so", ".json"}  # what a run writes itself
COMPILED = "__pycache__"  # and the folder of its compiled modules and functions


def read_for(records: Iterable[Path]) -> list[str]:
    """Files of the repository that are read while these records are answered, relative to its folder, sorted.

    Each record is closed again, in a process of its own. Raises CalledProcessError where that fails.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return sorted(set().union(*pool.map(_read, records)) - {""})


def _read(record: Path) -> set[str]:
    own = [sys.executable, "-m", "benchmarks.challenge.code", str(record)]
    return set(subprocess.run(own, cwd=ROOT, check=True, text=True, capture_output=True).stdout.split("\n"))


def digests(files: Iterable[str], root: Path = ROOT) -> dict[str, str]:
    """SHA-256 of each file, its first 16 digits; empty for a file that does not exist."""
    return {f: _digest(root / f) for f in files}


def changed(kept: Mapping[str, str], root: Path = ROOT) -> list[str]:
    """The files whose digests are no longer those that were kept, sorted."""
    return sorted(f for f, digest in digests(kept, root).items() if digest != kept[f])


def _digest(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest()[:16] if file.is_file() else ""


def _trace(record: Path) -> set[str]:
    """The files that this process reads while it answers a record."""
    opened: set[str] = set()

    def heard(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str):
            opened.add(arguments[0])

    sys.addaudithook(heard)
    from benchmarks.challenge import answer

    with tempfile.TemporaryDirectory() as folder:
        sys.argv = ["answer", str(record), str(Path(folder) / "answer.json"), "1"]
        answer.main()
    opened |= {m.__file__ for m in list(sys.modules.values()) if getattr(m, "__file__", None)}  # type: ignore[misc]
    inside = {Path(f).absolute() for f in opened} - {Path(__file__).absolute()}  # which only listens
    tops = {ROOT / top for top in ("fmus", "estimator", "scenarios", "benchmarks", "tests")}
    return {
        p.relative_to(ROOT).as_posix()
        for p in inside
        if p.is_file()
        and p.suffix not in WRITTEN
        and COMPILED not in p.parts
        and not tops.isdisjoint(p.parents)
    }


if __name__ == "__main__":
    print("\n".join(sorted(_trace(Path(sys.argv[1])))))
