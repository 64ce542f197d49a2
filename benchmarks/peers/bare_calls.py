"""The calls of a native FMU in a bare C loop, and the arithmetic of an effect alone in another."""

import ctypes
import subprocess
from collections.abc import Mapping, Sequence
from ctypes import c_double, c_int, c_size_t, c_void_p
from dataclasses import dataclass
from pathlib import Path

import casadi as cs
import numpy as np

from estimator.record import Array
from fmus.export.around.outside import Laws
from fmus.export.builders.native.compilers import command, host
from fmus.host.fmu import Fmu

CALLS = Path(__file__).with_name("calls.c")


@dataclass(frozen=True)
class BareCalls:
    """The compiled loops, with the laws of one effect."""

    library: ctypes.CDLL

    @classmethod
    def of(cls, laws: Laws, folder: Path) -> "BareCalls":
        """Generate the code of the laws, and compile it by the compiler and flags of native FMUs."""
        folder.mkdir(parents=True)
        functions = [laws.push, laws.go_on]
        generator = cs.CodeGenerator("laws.c", {"casadi_int": "int"})
        for function in functions:
            generator.add(function)
        sizes = {
            n: max(getattr(f, f"sz_{n.lower()}")() for f in functions) for n in ("ARG", "RES", "IW", "W")
        }
        defined = [f"#define WORK_{n} {max(size, 1)}" for n, size in sizes.items()]
        defined += [f"#define N_TOLD {len(laws.told)}", f"#define N_MEMORY {len(laws.states)}"]
        code = ["#define CASADI_SYMBOL_EXPORT static", generator.dump(), *defined, CALLS.read_text()]
        (folder / "calls.c").write_text("\n".join(code), encoding="utf-8")
        call = command(None, [host()])[host().name]
        subprocess.run([*call, "calls.c", "-o", "calls.so", "-lm"], cwd=folder, check=True)
        return cls(ctypes.CDLL(str(folder / "calls.so")))

    def steps(self, fmu: Fmu, t: Array, start: Mapping[str, float]) -> None:
        """Restart an FMU and make its steps through t (N,), with the inputs of its start."""
        fmu.restart(float(t[0]), **start)
        self.library.steps(*_instance(fmu), *_steps(t))

    def simulate(self, fmu: Fmu, t: Array, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Array:
        """Restart an FMU and set, step and read it: outputs (N-1, n_y) for inputs (N-1,) each."""
        u, y = np.column_stack([*inputs.values()]), np.empty((len(t) - 1, len(outputs)))
        into, read = (np.array(fmu.references(names), np.uint32) for names in (inputs, outputs))
        fmu.restart(float(t[0]))
        self.library.calls(*_instance(fmu), *_steps(t), *_values(into, u), *_values(read, y))
        return y

    def arithmetic(self, motion: Array, z: Array, dt: float) -> None:
        """What the laws compute along a motion (N, n_m), given z (n_z,)."""
        n, n_m = motion.shape
        self.library.arithmetic(_address(motion), c_int(n_m), _address(z), c_double(dt), c_int(n - 1))


def _instance(fmu: Fmu) -> tuple[c_int, ctypes.Array[c_void_p], c_void_p]:
    called = (getattr(fmu.instance.library, name) for name in fmu.instance.CALLS)
    functions = (c_void_p * 3)(*(ctypes.cast(f, c_void_p) for f in called))
    return c_int(3 if fmu.instance.FMI3 else 2), functions, c_void_p(fmu.instance.component)


def _steps(t: Array) -> tuple[c_void_p, c_int]:
    return _address(t), c_int(len(t) - 1)


def _values(references: np.typing.NDArray[np.uint32], values: Array) -> tuple[c_void_p, c_size_t, c_void_p]:
    return _address(references), c_size_t(len(references)), _address(values)


def _address(values: np.typing.NDArray[np.generic]) -> c_void_p:
    return c_void_p(values.ctypes.data)
