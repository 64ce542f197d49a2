"""Compile the sources of an FMU to libraries: by ziglang for every platform, by any cc for this one."""

import platform
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from fmus.errors import BadInput, did_you_mean

# no fused multiply-add, so that every build rounds alike; without errno a root is one instruction, of the
# same value; -s leaves symbols of the debugger out
NUMBERS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno")
STRICT = (*NUMBERS, "-fvisibility=hidden", "-shared", "-fPIC")
# nothing but the FMI functions has a name outside, and those have no prefix in a shared library
DEFINED = tuple(f"-DFMI{n}_OVERRIDE_FUNCTION_PREFIX" for n in (2, 3))


@dataclass(frozen=True)
class Platform:
    """A platform by FMI 3.0's name, zig's target, the folder that FMI 2.0 wants, the library's ending."""

    name: str
    target: str
    folder2: str
    suffix: str
    linked: tuple[str, ...] = ()

    def folder(self, fmi: int) -> str:
        """Folder below `binaries`."""
        return self.folder2 if fmi == 2 else self.name


OBJECT = ".o"
ELF = ("-Wl,--build-id=none",)
PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "x86_64-linux-gnu.2.17", "linux64", ".so", ELF),
        Platform("aarch64-linux", "aarch64-linux-gnu.2.17", "aarch64-linux", ".so", ELF),
        Platform("x86_64-windows", "x86_64-windows-gnu", "win64", ".dll"),
        Platform("x86_64-darwin", "x86_64-macos.11.0", "darwin64", ".dylib"),
        Platform("aarch64-darwin", "aarch64-macos.11.0", "darwin64", ".dylib"),
    )
}
MACHINES = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}


def host() -> Platform:
    """The platform of this process; BadInput where no FMU can be built for it."""
    machine = MACHINES.get(platform.machine().lower(), platform.machine())
    name = f"{machine}-{platform.system().lower()}"
    if name not in PLATFORMS:
        raise BadInput(f"no FMU is built for this machine ({name}); name one of {', '.join(PLATFORMS)}")
    return PLATFORMS[name]


def chosen(platforms: str | Sequence[str]) -> list[Platform]:
    """Platforms by name, "host" for this one, "all" for every one; BadInput for other names."""
    names = [platforms] if isinstance(platforms, str) else list(platforms)
    found: dict[str, Platform] = {}
    for name in names or ["host"]:
        if name == "all":
            found |= PLATFORMS
        elif name == "host":
            found[host().name] = host()
        elif name in PLATFORMS:
            found[name] = PLATFORMS[name]
        else:
            known = [*PLATFORMS, "host", "all"]
            raise BadInput(f"platform '{name}' is not known; {did_you_mean(name, known)}")
    return [p for p in PLATFORMS.values() if p.name in found]


def command(compiler: str | None, wanted: Sequence[Platform]) -> dict[str, list[str]]:
    """The compiler's call by platform, up to its files; BadInput where it cannot build for one of them."""
    if compiler is None:
        if find_spec("ziglang") is None:
            raise BadInput("no compiler: install one by 'pip install ziglang', or name one that is here")
        zig = [sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=all", "-g0", "-s"]
        return {p.name: [*zig, "-target", p.target, *STRICT, *p.linked] for p in wanted}
    others = [p.name for p in wanted if p != host()]
    if others:
        raise BadInput(f"'{compiler}' builds for this machine only, not {others[0]}; leave the compiler out")
    return {p.name: [compiler, *STRICT, *p.linked] for p in wanted}


def compile_library(
    call: Sequence[str], sources: Sequence[Path], target: Path, where: Platform, linked: Sequence[str] = ()
) -> None:
    """Compile C files and objects to the library, or the object, `target`; BadInput with the first error.

    linked: libraries of the platform beside that of mathematics.
    """
    target.parent.mkdir(parents=True)
    # a relative name, for the linker writes it into the library
    whole = ["-c"] if target.suffix == OBJECT else ["-lm", *linked]
    files = [*DEFINED, *map(str, sources), "-o", target.name, *whole]
    try:
        done = subprocess.run([*call, *files], cwd=target.parent, capture_output=True, text=True, check=False)
    except OSError as error:
        why = error.strerror
        raise BadInput(f"compiler '{call[0]}' cannot be run ({why}); install it or name another") from error
    if done.returncode or not target.is_file():
        lines = done.stderr.splitlines()
        said = next((line for line in lines if "error" in line.lower()), "".join(lines[:1]))
        reason = said.strip() or f"exit code {done.returncode}"
        raise BadInput(f"{where.name}: the compiler failed ({reason}); try another, or leave this one out")
