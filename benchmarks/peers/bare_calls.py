"""The calls of a native FMU in a bare C loop, and the arithmetic of an effect alone in another."""

import ctypes
from collections.abc import Mapping, Sequence
from ctypes import c_double, c_int, c_size_t, c_void_p
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.peers.compiled import address, compiled
from estimator.record import Array
from fmus.export.around.outside import Laws
from fmus.host.fmu import Fmu

CALLS = Path(__file__).with_name("calls.c")


@dataclass(frozen=True)
class BareCalls:
    """The compiled loops, with the laws of one effect."""

    library: ctypes.CDLL

    @classmethod
    def of(cls, laws: Laws, folder: Path) -> "BareCalls":
        """Compile the loops with the code of the laws."""
        counts = {"N_TOLD": len(laws.told), "N_MEMORY": len(laws.states)}
        return cls(compiled(CALLS, [laws.push, laws.go_on], counts, folder))

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
        self.library.arithmetic(address(motion), c_int(n_m), address(z), c_double(dt), c_int(n - 1))


def _instance(fmu: Fmu) -> tuple[c_int, ctypes.Array[c_void_p], c_void_p]:
    called = (getattr(fmu.instance.library, name) for name in fmu.instance.CALLS)
    functions = (c_void_p * 3)(*(ctypes.cast(f, c_void_p) for f in called))
    return c_int(3 if fmu.instance.FMI3 else 2), functions, c_void_p(fmu.instance.component)


def _steps(t: Array) -> tuple[c_void_p, c_int]:
    return address(t), c_int(len(t) - 1)


def _values(references: np.typing.NDArray[np.uint32], values: Array) -> tuple[c_void_p, c_size_t, c_void_p]:
    return address(references), c_size_t(len(references)), address(values)
