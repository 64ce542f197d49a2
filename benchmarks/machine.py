"""What a measurement depends on: processor, memory, system, versions, compiler, date and commit."""

import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from fmus.export.builders.native.compilers import command, host

ROOT = Path(__file__).parents[1]
LIBRARIES = (
    "railfmi", "numpy", "scipy", "numba", "casadi", "fmpy", "pythonfmu", "filterpy", "ziglang", "ecospy",
    "typer",
)  # fmt: skip
UNKNOWN = "unknown"


def described() -> dict[str, object]:
    """The machine, the software and the product, as JSON holds them."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_GB": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "load": round(os.getloadavg()[0], 1),
        "system": _system(),
        "python": platform.python_version(),
        "libraries": {name: found for name in LIBRARIES if (found := _version(name))},
        "compiler": _compiler(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": _commit(),
    }


def _processor() -> str:
    """The processor's name."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(iter(names), platform.processor() or UNKNOWN)


def _system() -> str:
    """The operating system, without the name of this machine or its kernel's build."""
    try:
        return f"{platform.freedesktop_os_release()['PRETTY_NAME']}, {platform.machine()}"
    except OSError:
        return f"{platform.system()}, {platform.machine()}"


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _compiler() -> str:
    """The compiler's version and the flags with which native FMUs are compiled."""
    call = command(None, [host()])[host().name]
    found = _said([*call[: call.index("cc") + 1], "--version"])
    flags = " ".join(call[call.index("cc") + 1 :])
    return f"zig cc, {found.splitlines()[0]}, {flags}"


def _commit() -> str:
    """The commit of the product, with a mark where files differ from it."""
    try:
        commit = _said(["git", "-C", str(ROOT), "rev-parse", "HEAD"]).strip()
        changed = _said(["git", "-C", str(ROOT), "status", "--porcelain", "--untracked-files=no"]).strip()
    except (OSError, subprocess.CalledProcessError):
        return UNKNOWN
    return f"{commit}{' with changes' if changed else ''}"


def _said(call: list[str]) -> str:
    return subprocess.run(call, capture_output=True, text=True, check=True).stdout
