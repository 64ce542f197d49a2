"""C loops on top of the code that CasADi generates, compiled by the compiler and flags of native FMUs."""

import ctypes
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as cs
import numpy as np

from fmus.export.builders.native.compilers import command, host


def compiled(
    loops: Path, functions: Sequence[cs.Function], counts: Mapping[str, int], folder: Path
) -> ctypes.CDLL:
    """The library of a C file that calls some functions; `folder` must not exist yet.

    The file finds the largest work sizes of the functions as WORK_ARG, WORK_RES, WORK_IW and WORK_W, each at
    least 1, and the counts by their names.
    """
    folder.mkdir(parents=True)
    generator = cs.CodeGenerator(loops.name, {"casadi_int": "int"})
    for function in functions:
        generator.add(function)
    defined = {
        f"WORK_{n}": max(1, *(getattr(f, f"sz_{n.lower()}")() for f in functions))
        for n in ("ARG", "RES", "IW", "W")
    }
    sizes = [f"#define {name} {size}" for name, size in {**defined, **counts}.items()]
    code = ["#define CASADI_SYMBOL_EXPORT static", generator.dump(), *sizes, loops.read_text()]
    (folder / loops.name).write_text("\n".join(code), encoding="utf-8")
    call = command(None, [host()])[host().name]
    subprocess.run([*call, loops.name, "-o", "loops.so", "-lm"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "loops.so"))


def address(values: np.typing.NDArray[np.generic]) -> ctypes.c_void_p:
    """The address of an array's first value."""
    return ctypes.c_void_p(values.ctypes.data)
