"""Every FMU of ours, with start values off those of rest, and the trajectories that importers must give.

Two sets of start values: one is written into the FMU, for tools that set none, the other is set by the tool.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.host.fmu import Fmu
from fmus.model import Model, equations
from fmus.models import MODELS
from fmus.variables import Input, Output, Parameter, State
from tests.contracts.interop.importer import Case, Importer
from tests.helpers.everything import near_start
from tests.helpers.runs import names, start_of

Array = NDArray[np.float64]
STEP = {
    "": (0.01, 50),
    "cvode": (0.01, 20),
    "euler": (1e-4, 500),
}  # s and number, by solver of model exchange
WRITTEN, SET = 12, 29  # seeds of the two sets of start values


@dataclass(frozen=True)
class Build:
    """A model built in one way."""

    model: str
    build: str  # "native", "python"
    fmi: int


BUILDS = [Build(m, b, v) for m in MODELS for b, v in (("native", 2), ("native", 3), ("python", 2))]


def runs(tool: type[Importer]) -> Iterator[tuple[Build, str]]:
    """All FMUs that a tool reads, with the kind of simulation."""
    for build in BUILDS:
        for kind, fmi in sorted(tool.reads):
            if fmi == build.fmi and (kind == "CS" or build.build == "native"):
                yield build, kind


def moved(name: str, seed: int) -> dict[str, float]:
    """Values of states and inputs off those of rest."""
    model = MODELS[name]()
    values = start_of(model, near_start(model, np.random.default_rng(seed)))
    return {n: v for n, v in values.items() if n in names(model, (State, Input))}


def begun(name: str) -> Model:
    """The model with start values off those of rest, which its FMUs carry."""
    model = MODELS[name]()
    for variable, value in moved(name, WRITTEN).items():
        model.variables[variable] = replace(model.variables[variable], start=value)
    return model


@cache
def folder() -> tempfile.TemporaryDirectory[str]:
    """Where the FMUs lie, until the process ends."""
    return tempfile.TemporaryDirectory(prefix="railfmi_importers_")


@cache
def built(build: Build) -> Path:
    """The path of an FMU."""
    place = Path(folder().name) / f"{build.build}{build.fmi}"
    if build.build == "python":
        return build_python(begun(build.model), place)
    return build_native(begun(build.model), place, build.fmi)


def case(tool: type[Importer], build: Build, kind: str) -> Case:
    """What a tool is asked to run."""
    step, steps = STEP[tool.solver if kind == "ME" else ""]
    start = moved(build.model, SET) if tool.sets_start else {}
    outputs = names(MODELS[build.model](), (State, Output))
    return Case(str(built(build)), kind, build.fmi, step, steps, start, outputs)


@cache
def expected(name: str, solver: str, sets_start: bool) -> Array:
    """The trajectory by solver of model exchange, "" for co-simulation, (steps, outputs)."""
    model = MODELS[name]()
    start = moved(name, SET if sets_start else WRITTEN)
    step, steps = STEP[solver]
    if not solver:
        return _by_our_host(name, start, step, steps)
    compiled = equations(model)
    u, p = (np.array([start.get(v.name, v.start) for v in model.of(k)]) for k in (Input, Parameter))
    x = np.array([start[v.name] for v in model.of(State)])

    def f(_: float, x: Array) -> Array:
        return compiled.f(x, u, p).full().ravel()

    if solver == "euler":
        states = [x]
        for _ in range(steps):
            states.append(states[-1] + step * f(0.0, states[-1]))
        rows = np.array(states[1:])
    else:
        times = step * np.arange(1, steps + 1)
        found = solve_ivp(f, (0, times[-1]), x, "LSODA", times, rtol=1e-12, atol=1e-13)
        rows = found.y.T
    return np.array([[*row, *compiled.h(row, u, p).full().ravel()] for row in rows])


def _by_our_host(name: str, start: dict[str, float], step: float, steps: int) -> Array:
    """What the native FMI 2.0 build gives in the host of railfmi."""
    outputs = names(MODELS[name](), (State, Output))
    with Fmu(built(Build(name, "native", 2))) as fmu:
        fmu.restart(**start)
        rows = []
        for _ in range(steps):
            fmu.step(step)
            rows.append(fmu.read(outputs))
    return np.array(rows)


def difference(rows: list[list[float]], wanted: Array, resolution: float = 0.0) -> float:
    """Largest difference of any signal, relative to the largest value of that signal.

    resolution: absolute, smaller differences are not seen.
    """
    found = np.array(rows)
    if found.shape != wanted.shape:
        raise ValueError(f"rows of shape {found.shape} instead of {wanted.shape}")
    size = np.abs(wanted).max(axis=0)
    off = np.maximum(np.abs(found - wanted).max(axis=0) - resolution, 0.0)
    return float(np.max(off / np.where(size > 0, size, 1.0)))
