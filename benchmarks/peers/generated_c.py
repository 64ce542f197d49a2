"""CasADi's own C code of a model's step function, compiled like native FMUs, and C loops over FMUs."""

import ctypes
from collections.abc import Mapping, Sequence
from ctypes import c_double, c_int, c_size_t, c_uint, c_void_p
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.peers.compiled import address, compiled
from benchmarks.timing import Run
from estimator.record import Array
from fmus.host.fmu import Fmu
from fmus.model import Model, equations
from fmus.variables import Input, Parameter, State

LOOPS = Path(__file__).with_name("loops.c")
FUNCTIONS = (
    "Reset", "EnterInitializationMode", "ExitInitializationMode", "SetReal", "GetReal", "SetupExperiment",
    "DoStep",
)  # fmt: skip


# the rig rolls: at rest its creep is so stiff that the FMU takes more internal steps than the bare code
ROLLING = {"omega_w": 12.16, "omega_r": 9.36, "T_P": 300.0, "f_sync": 7.5}


def begin(model: Model) -> tuple[Array, Array, Array]:
    """Start values of states, inputs and parameters, away from rest."""
    x = {v.name: v.start + 0.1 * (v.nominal or 1.0) for v in model.of(State)}
    u, p = ({v.name: v.start for v in model.of(kind)} for kind in (Input, Parameter))

    def column(values: dict[str, float]) -> Array:
        return np.array([ROLLING.get(name, value) for name, value in values.items()])

    return column(x), column(u), column(p)


def start_of(model: Model) -> dict[str, float]:
    """The same start values of states and inputs by name."""
    names = [v.name for v in model.of(State, Input)]
    return dict(zip(names, np.concatenate(begin(model)[:2]).tolist(), strict=True))


@dataclass(frozen=True)
class Loops:
    """The compiled loops of one model."""

    library: ctypes.CDLL

    @classmethod
    def of(cls, model: Model, folder: Path) -> "Loops":
        """Compile the loops with the code of the model's step."""
        step = equations(model).step
        return cls(compiled(LOOPS, [step], {"N_STATES": step.size1_in(0)}, folder))

    def bare(self, x: Array, u: Array, p: Array, dt: float, steps: int) -> Array:
        """States (n,) after some internal steps of the generated function."""
        x, u, p = (np.array(a, dtype=float) for a in (x, u, p))
        self.library.bare(*map(address, (x, u, p)), c_double(dt), c_int(steps))
        return x

    def rows(self, X: Array, u: Array, p: Array, dt: float, times: int) -> None:
        """One internal step from each row of X (k, n), repeated; the results are not kept."""
        X, u, p = (np.ascontiguousarray(a, dtype=float) for a in (X, u, p))
        self.library.rows(*map(address, (X, u, p)), c_double(dt), c_int(len(X)), c_int(times))

    def steps(self, fmu: Fmu, start: Mapping[str, float], dt: float, steps: int) -> None:
        """Restart an FMU and make communication steps."""
        fmu.restart(**start)
        self.library.steps(_calls(fmu), c_void_p(fmu.instance.component), c_double(dt), c_int(steps))

    def restarts(self, fmus: Sequence[Fmu], start: Mapping[str, float], dt: float, times: int) -> Run:
        """A call that resets, sets, initialises, steps and reads each FMU, as a filter does, some times."""
        n, references = len(start), fmus[0].references(start)
        functions, refs = _calls(fmus[0]), (c_uint * n)(*references)
        components = (c_void_p * len(fmus))(*(fmu.instance.component for fmu in fmus))
        given = (c_double * n)(*start.values())

        def run() -> None:
            for _ in range(times):
                self.library.restarts(
                    functions, components, c_int(len(fmus)), refs, c_size_t(n), given, c_double(dt)
                )

        return run


def _calls(fmu: Fmu) -> ctypes.Array[c_void_p]:
    """Addresses of an FMU's functions, in the order of the structure in loops.c."""
    dll = fmu.instance.library
    found = (ctypes.cast(getattr(dll, f"fmi2{n}"), c_void_p) for n in FUNCTIONS)
    return (c_void_p * len(FUNCTIONS))(*found)
