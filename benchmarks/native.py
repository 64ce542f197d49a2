"""Computing time of a step and a restart, in C loops: CasADi's C code alone, native FMUs, PythonFMU builds.

Run: python -m benchmarks.native. The variants alternate, and the shortest time of many rounds counts, because
other programs on the machine can only increase a time.
"""

import ctypes
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from ctypes import c_double, c_size_t, c_uint, c_void_p
from math import inf
from pathlib import Path

from fmus.export.builders.native.build import build_native
from fmus.export.builders.native.code import sources
from fmus.export.builders.native.compilers import NUMBERS
from fmus.export.builders.native.table import table
from fmus.export.builders.pythonfmu import build_python
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from fmus.model import Model, equations
from fmus.models import MODELS
from fmus.variables import Input, Parameter, State

STEPS, DT, COPIES, RESTARTS = 500, 1e-3, 15, 4
ROUNDS, SECONDS = 400, 30.0  # limits of each comparison
LOOP = """
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#define CASADI_SYMBOL_EXPORT static
#include "model.h"
#include "equations.c"

void bare(double *x, const double *u, const double *p, double dt, int n) {
    const double *arg[WORK_ARG];
    double *res[WORK_RES], w[WORK_W + 1], next[N_STATES], error;
    int iw[WORK_IW + 1];
    for (int k = 0; k < n; k++) {
        arg[0] = x; arg[1] = u; arg[2] = p; arg[3] = &dt;
        res[0] = next; res[1] = &error;
        step(arg, res, iw, w, 0);
        for (int i = 0; i < N_STATES; i++) x[i] = next[i];
    }
}

typedef int (*Plain)(void *);
typedef int (*Values)(void *, const unsigned *, size_t, double *);
typedef int (*Setup)(void *, int, double, double, int, double);
typedef int (*Step)(void *, double, double, int);
typedef struct { Plain reset, enter, leave; Values set, get; Setup setup; Step step; } Calls;

void steps(const Calls *f, void *c, double dt, int n) {
    for (int k = 0; k < n; k++) f->step(c, k * dt, dt, 1);
}

void restarts(const Calls *f, void **copies, int n, const unsigned *refs, size_t n_x, const double *x,
              double dt) {
    double value[N_STATES];
    for (int k = 0; k < n; k++) {
        void *c = copies[k];
        for (size_t i = 0; i < n_x; i++) value[i] = x[i];
        f->reset(c);
        f->set(c, refs, n_x, value);
        f->setup(c, 0, 0, 0, 0, 0);
        f->enter(c);
        f->leave(c);
        f->step(c, 0, dt, 1);
        f->get(c, refs, n_x, value);
    }
}
"""
CALLS = ("Reset", "EnterInitializationMode", "ExitInitializationMode", "SetReal", "GetReal")
CALLS += ("SetupExperiment", "DoStep")


def begin(model: Model) -> tuple[list[float], list[float], list[float]]:
    """Start values of states, inputs and parameters, away from rest."""
    x = [v.start + 0.1 * (v.nominal or 1.0) for v in model.of(State)]
    return x, [v.start for v in model.of(Input)], [v.start for v in model.of(Parameter)]


def loops(model: Model, folder: Path) -> ctypes.CDLL:
    """The C loops above, compiled together with the generated code of the model."""
    made = equations(model)
    for name, text in sources(table(model, made), made, 2, "{}").items():
        (folder / name).write_text(text)
    (folder / "loops.c").write_text(LOOP)
    flags = [*NUMBERS, "-fno-sanitize=all", "-shared", "-fPIC"]
    call = [sys.executable, "-m", "ziglang", "cc", *flags, "loops.c", "-o", "loops.so", "-lm"]
    subprocess.run(call, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "loops.so"))


def bare(c: ctypes.CDLL, model: Model) -> Callable[[], None]:
    """The generated step function alone."""
    x, u, p = ((c_double * max(len(a), 1))(*a) for a in begin(model))
    first = list(x)

    def run() -> None:
        x[:] = first
        c.bare(x, u, p, c_double(DT), STEPS)

    return run


def calls(fmu: Fmu) -> ctypes.Array[ctypes.c_void_p]:
    """Addresses of an FMU's functions."""
    dll = fmu._instance._slave.dll
    return (c_void_p * len(CALLS))(*(ctypes.cast(getattr(dll, f"fmi2{n}"), c_void_p) for n in CALLS))


def stepped(c: ctypes.CDLL, fmu: Fmu, start: dict[str, float]) -> Callable[[], None]:
    """Steps of one FMU."""
    functions, component = calls(fmu), c_void_p(fmu._instance._slave.component)

    def run() -> None:
        fmu.restart(**start)
        c.steps(functions, component, c_double(DT), STEPS)

    return run


def restarted(c: ctypes.CDLL, fmus: list[Fmu], start: dict[str, float]) -> Callable[[], None]:
    """Reset, set states, initialise, step, read the states of each copy, as a filter does."""
    n, references = len(start), fmus[0].references(start)
    functions = calls(fmus[0])
    components = (c_void_p * len(fmus))(*(fmu._instance._slave.component for fmu in fmus))
    given, refs = (c_double * n)(*start.values()), (c_uint * n)(*references)

    def run() -> None:
        for _ in range(RESTARTS):
            c.restarts(functions, components, len(fmus), refs, c_size_t(n), given, c_double(DT))

    return run


def measured(ways: dict[str, Callable[[], None]], per_run: int) -> dict[str, float]:
    """Shortest time of one unit in µs for each variant; the variants alternate."""
    least = dict.fromkeys(ways, inf)
    over = time.perf_counter() + SECONDS
    for _ in range(ROUNDS):
        for name, run in ways.items():
            begun = time.perf_counter()
            run()
            least[name] = min(least[name], (time.perf_counter() - begun) / per_run * 1e6)
        if time.perf_counter() > over:
            break
    return least


def compare(name: str, folder: Path) -> None:
    """Print the computing times of one model."""
    model = MODELS[name]()
    start = dict(zip((v.name for v in model.of(State)), begin(model)[0], strict=True))
    c = loops(model, folder)
    native, python = build_native(model, folder / "native"), build_python(model, folder / "python")
    with Archive(native) as one, Archive(python) as other:
        copies = {way: [Fmu(a) for _ in range(COPIES)] for way, a in (("native", one), ("PythonFMU", other))}
        ways = {"C alone": bare(c, model), **{w: stepped(c, f[0], start) for w, f in copies.items()}}
        once = measured(ways, STEPS)
        again = measured({w: restarted(c, f, start) for w, f in copies.items()}, RESTARTS)
        for fmus in copies.values():
            for fmu in fmus:
                fmu.close()
    print(f"{name}, communication step {DT * 1e3:g} ms; time, and ratio to the native FMU:")
    for way, us in once.items():
        print(f"  step, {way:32} {us:9.2f} µs {us / once['native']:8.2f}")
    for way, us in again.items():
        print(f"  restart and step of {COPIES} copies, {way:10} {us:9.1f} µs {us / again['native']:8.2f}")


def main() -> None:
    """Measure every model."""
    for name in sorted(MODELS):
        with tempfile.TemporaryDirectory() as folder:
            compare(name, Path(folder))


if __name__ == "__main__":
    main()
