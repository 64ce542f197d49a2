"""Changes of the planned inputs that may split what the planned ones do not: a few that fit any FMU."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.record import Array, Run

LEVEL = 0.2  # share of an input's mean by which its level is changed, if it does not vary by more
STEPS = 4  # levels of an input with steps
RAMP = 0.02  # share of the record over which a step is rounded, so that its rate exists
SLOWEST, SAMPLES_PER_PERIOD = 2.0, 20.0  # periods of a sweep in the record at its start; its end
GOLDEN = (5**0.5 - 1) / 2  # share of a period between the phases of two inputs; no two come together
RANGE_LEFT = 10.0  # times the planned largest value, beyond which the FMU has left the planned motion


@dataclass(frozen=True)
class Excitation:
    """A change of one input: its name, the change in words, and the run with it."""

    input: str
    change: str
    run: Run


Change = Callable[[Array, Array], Array]  # of an input (N,) over times from 0 to 1 (N,)


def _amplitude(u: Array, nominal: float) -> float:
    """Realistic size of a change of an input: its spread, a share of its mean, or of its nominal value."""
    return max(float(np.std(u)), LEVEL * abs(float(np.mean(u)))) or LEVEL * nominal


def _sweep(s: Array, samples: int, phase: float = 0.0) -> Array:
    """A sine (N,) of growing frequency over times from 0 to 1 (N,); phase in periods."""
    last = samples / SAMPLES_PER_PERIOD
    return np.asarray(np.sin(2 * np.pi * (phase + SLOWEST * s + (last - SLOWEST) * s**2 / 2)))


def changes(u: Array, s: Array, samples: int, nominal: float) -> dict[str, Array]:
    """The changed inputs (N,) by the change in words; s: (N,) time over the record, from 0 to 1."""
    a, mean = _amplitude(u, nominal), float(np.mean(u))
    sweep = _sweep(s, samples)
    levels = np.sign(np.sin(2 * np.pi * (STEPS / 2) * (s + 1e-9)))
    width = max(1, round(RAMP * samples))
    smooth = np.convolve(np.pad(levels, (width, width), "edge"), np.ones(width) / width, "same")[width:-width]
    found = {
        f"raised by {a:.3g}": u + a,
        f"lowered by {a:.3g}": u - a,
        "reversed in sign": -u,
        f"with a sweep of {a:.3g} added": u + a * sweep,
        f"with steps of {a:.3g} up and down added": u + a * smooth,
        "reversed in the second half": u * np.clip((0.5 - s) / RAMP, -1.0, 1.0),
    }
    if np.ptp(u) > 0:
        found["with its variation doubled"] = mean + 2 * (u - mean)
        found["with its variation halved"] = mean + (u - mean) / 2
    return found


def excitations(problem: Problem, inputs: Sequence[str]) -> tuple[list[Excitation], dict[str, str]]:
    """The runs with one input changed, and why other changes are not possible.

    inputs: those that may be changed. A rate input NAME_dot follows its input.
    """
    run, names = problem.record.runs[0], problem.record.inputs
    known = problem.plant.fmu.description.variables
    s = (run.t - run.t[0]) / (run.t[-1] - run.t[0])
    found, refused = [], {}
    for name in inputs:
        j, v = names.index(name), known[name]
        for words, u in changes(run.u[:, j], s, len(s), v.nominal or 1.0).items():
            low = -np.inf if v.min is None else v.min
            high = np.inf if v.max is None else v.max
            if u.min() < low or u.max() > high:
                refused[f"{name} {words}"] = f"outside of the FMU's limits {low:g} to {high:g}"
                continue
            given = run.u.copy()
            _put(given, names, j, u, run)
            found.append(Excitation(name, words, replace(run, u=given)))
    return found, refused


def _put(given: Array, names: Sequence[str], j: int, u: Array, run: Run) -> None:
    """Write an input u (N,) into those of a run (N, n_u), and its rate if that is an input too."""
    given[:, j] = u
    if f"{names[j]}_dot" in names:
        given[:, names.index(f"{names[j]}_dot")] += np.gradient(u - run.u[:, j], run.t)


def shaken(problem: Problem) -> Run:
    """The run with a sweep added to every input, each with a phase of its own, within the FMU's limits.

    No two inputs move alike then, so that only what acts alike under any inputs acts alike under these.
    """
    run, names = problem.record.runs[0], problem.record.inputs
    known = problem.plant.fmu.description.variables
    s, given = (run.t - run.t[0]) / (run.t[-1] - run.t[0]), run.u.copy()
    for i, name in enumerate(changeable(problem)):
        j, v = names.index(name), known[name]
        sweep = _sweep(s, len(s), GOLDEN * i)
        moved = run.u[:, j] + _amplitude(run.u[:, j], v.nominal or 1.0) * sweep
        low, high = (end if end is not None else side * np.inf for end, side in ((v.min, -1), (v.max, 1)))
        _put(given, names, j, np.clip(moved, low, high), run)
    return replace(run, u=given)


def bearable(problem: Problem, theta: Mapping[str, float], planned: Array) -> bool:
    """Whether the FMU can be simulated with the inputs of a problem, near to the planned outputs (N, n_y)."""
    [y] = problem.simulate(theta)
    most = RANGE_LEFT * (np.abs(planned).max(axis=0) + np.ptp(planned, axis=0)) + 1e-300
    return bool(np.all(np.isfinite(y)) and np.all(np.abs(y) <= most))


def with_run(problem: Problem, run: Run) -> Problem:
    """The problem with another run in the record."""
    return replace(problem, record=replace(problem.record, runs=(run,)))


def changeable(problem: Problem) -> Iterator[str]:
    """The inputs of the record that may be changed: all but rates of others."""
    names = problem.record.inputs
    yield from (n for n in names if not (n.endswith("_dot") and n.removesuffix("_dot") in names))
