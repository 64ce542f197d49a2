"""Commands on a disk that fails at one of their changes of files; run as a module, under full_disk.c.

The process loads everything once; each command runs in a fork of it.
"""

import ctypes
import errno
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).parent / "c" / "full_disk.c"
NEVER = 1 << 40
OUT, EVERYWHERE, TEMPORARY = "out", "everywhere", "temporary"
ENDINGS = {
    ".png": b"IEND\xaeB`\x82", ".html": b"</html>", ".svg": b"</svg>", ".csv": b"\n", ".md": b"\n",
    ".parquet": b"PAR1",
}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What a command did on such a disk: exit code, what it printed, its files, and which are not whole."""

    changes: int
    code: int
    said: str
    files: list[str]
    broken: list[str]


def library(folder: Path) -> Path:
    """The compiled disk."""
    made = folder / "full_disk.so"
    options = ["-O1", "-Wall", "-shared", "-fPIC", "-ldl"]
    subprocess.run(["cc", str(SOURCE), "-o", str(made), *options], check=True)
    return made


def tried(arguments: Sequence[str], out: Path, most: int, disk: Path, where: str = OUT) -> list[Outcome]:
    """A command that writes to `out`: with a sound disk, then with up to `most` others, spread evenly.

    where: OUT for what this process changes in the folder of results, EVERYWHERE for what those that it
    starts change there, too; TEMPORARY for what they all change in the folder of temporary files.
    """
    about = [str(disk), str(out), str(most), where]
    asked = [sys.executable, "-m", "tests.helpers.full_disk", *about, *arguments]
    done = subprocess.run(
        asked, env=os.environ | {"LD_PRELOAD": str(disk)}, stdout=subprocess.PIPE, check=True, text=True
    )
    return [Outcome(**json.loads(line)) for line in done.stdout.splitlines()]


def whole(file: Path) -> bool:
    """Whether a file is complete, by its form."""
    if file.suffix == ".claim":  # a lock, which holds nothing
        return True
    data = file.read_bytes()
    try:
        match file.suffix:
            case ".json":
                json.loads(data)
                return True
            case ".toml":
                tomllib.loads(data.decode())
            case ".fmu" | ".ssp" | ".checkpoint":
                with zipfile.ZipFile(file) as packed:
                    return packed.testzip() is None
        ending = ENDINGS.get(file.suffix, b"\n")
        return data.endswith(ending) or data.rstrip().endswith(ending)
    except (ValueError, zipfile.BadZipFile):
        return False


def main(disk: str, out: str, most: str, where: str, *arguments: str) -> None:
    """Print an outcome a line."""
    from scenarios.cli.app import loaded

    del os.environ["LD_PRELOAD"]
    loaded()
    sound = _outcome(disk, arguments, Path(out), where, NEVER)
    print(json.dumps(sound))
    n = sound["changes"]
    for k in sorted({i * n // int(most) for i in range(int(most))}):
        print(json.dumps(_outcome(disk, arguments, Path(out), where, k)))


def _outcome(disk: str, arguments: Sequence[str], out: Path, where: str, k: int) -> dict[str, Any]:
    shutil.rmtree(out, ignore_errors=True)
    if where == TEMPORARY:
        out.mkdir()
    with tempfile.TemporaryDirectory() as name:
        said, counted = Path(name) / "said", Path(name) / "counted"
        sys.stdout.flush()
        child = os.fork()
        if not child:
            _command(disk, arguments, out, where, k, said, counted)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        files = sorted(file for file in out.rglob("*") if file.is_file()) if out.exists() else []
        return {
            "changes": int(counted.read_text()),
            "code": code,
            "said": said.read_text(),
            "files": [str(file.relative_to(out)) for file in files],
            "broken": [str(file.relative_to(out)) for file in files if not whole(file)],
        }


def _command(
    disk: str, arguments: Sequence[str], out: Path, where: str, k: int, said: Path, counted: Path
) -> None:  # of the child
    from scenarios.cli.app import run_safely

    os.setsid()
    output = os.open(said, os.O_WRONLY | os.O_CREAT)
    for number in (1, 2):
        os.dup2(output, number)
    code, full = 99, ctypes.CDLL(disk)
    try:
        if where != OUT:
            _everywhere(full, disk, out, k, said.with_name("count"))
        full.disk_fails(os.fsencode(out), ctypes.c_long(k), errno.ENOSPC)
        if where == TEMPORARY:
            os.environ["TMPDIR"] = tempfile.tempdir = str(out)
            code = run_safely(arguments)
        else:
            code = run_safely([*arguments, "--out", str(out)])
    finally:
        changes = full.disk_changes()
        full.disk_fails(b"", ctypes.c_long(-1), 0)
        sys.stdout.flush()
        counted.write_text(str(changes))
        from multiprocessing.util import _exit_function  # ends the process of the FMUs

        _exit_function()
        os._exit(code)


def _everywhere(full: Any, disk: str, out: Path, k: int, count: Path) -> None:
    """Let the processes that are started from now on have this disk, too."""
    count.write_bytes(bytes(ctypes.sizeof(ctypes.c_long)))
    os.environ |= {
        "LD_PRELOAD": disk, "DISK_COUNT": str(count), "DISK_FOLDER": str(out), "DISK_FROM": str(k),
        "DISK_ERROR": str(errno.ENOSPC),
    }  # fmt: skip
    full.disk_everywhere(os.fsencode(count))


if __name__ == "__main__":
    main(*sys.argv[1:])
