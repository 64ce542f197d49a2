"""Measured outputs whose declared unit or sign may be wrong, found by comparison with a simulation."""

from collections.abc import Iterator

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.record import Array, Record
from fmus.errors import BadInput
from fmus.host.fmu import FmuError
from fmus.units import conversion

SAME_COURSE = 0.5  # correlation from which on two signals have the same course
APART = 2.0  # factor between measured and simulated values beyond which a wrong unit is suspected
NEAR = 0.1  # relative difference of two factors that may be the same, before the parameters are calibrated
LIKELY = (  # units that columns of loggers are in
    *("rpm", "1/min", "Hz", "rad/s", "deg/s", "rad", "deg", "mrad", "m", "cm", "mm", "um", "m/s", "km/h"),
    *("mm/s", "m/s2", "g_0", "mm/s2", "N", "kN", "N.m", "mN.m", "kN.m", "V", "mV", "A", "mA", "Pa", "kPa"),
    "bar",
)


def simulated_twice(problem: Problem) -> tuple[Array, Array]:
    """Outputs of the first run (N, n_y) with the declared values, and the same from the FMU's own start.

    The first one begins where the record does, which may be in a wrong unit. Raises FmuError if the FMU
    cannot be simulated.
    """
    theta = {**problem.declared, **_first_states(problem)}
    [simulated, *_] = problem.simulate(theta)
    try:
        [other, *_] = problem.simulate(problem.declared)
    except FmuError:
        other = simulated
    return simulated, other


def suspicions(problem: Problem) -> list[str]:
    """A sentence for each output whose declared unit or sign may be wrong."""
    try:
        both = simulated_twice(problem)
    except FmuError:  # the run that follows says what is wrong
        return []
    return [
        f"{name}: {said}"
        for name, factor in zip(problem.record.outputs, factors(problem.record, *both), strict=True)
        if (said := told(problem.record, name, factor))
    ]


def factors(record: Record, *simulated: Array) -> Iterator[float | None]:
    """For each output the factor between the first run's measured and simulated values, see `factor_of`."""
    run = record.runs[0]
    used = run.fit | run.unseen  # what lies before the split may show how the FMU starts
    for j in range(run.y.shape[1]):
        yield factor_of(run.y[used, j], *(x[used, j] for x in simulated))


def factor_of(measured: Array, *simulated: Array) -> float | None:
    """Factor between two signals (N,) of the same course, by their spreads; None if they have not the same.

    It is negative if one goes up where the other goes down. Of several simulated signals the one counts whose
    course is most alike.
    """
    best, found = SAME_COURSE, None
    for x in simulated:
        spreads = float(np.std(measured)), float(np.std(x))
        if np.all(np.isfinite(spreads)) and min(spreads) > 0:
            course = float(np.corrcoef(measured, x)[0, 1])
            if abs(course) > best:
                best, found = abs(course), float(np.copysign(spreads[0] / spreads[1], course))
    return found


def told(record: Record, name: str, factor: float | None) -> str:
    """What is said of an output whose measured values have another size or sign than simulated ones."""
    if factor is None or 1 / APART < factor < APART:
        return ""
    times = f"measured values are {factor:.3g} times the simulated ones{_as_if(record, name, factor)}"
    return f"{times}: look at unit, model_unit, scale and the column of this output"


def _as_if(record: Record, name: str, factor: float) -> str:
    """The unit in which a column would have to be for measured values of the right size, in words."""
    stated = next((c for c in record.conversions if c.variable == name), None)
    if stated is None or stated.model_unit is None or 1 / APART < abs(factor) < APART:
        return ""
    wanted, found = abs(stated.factor / factor), []
    for unit in LIKELY:
        try:
            found.append((conversion(unit, stated.model_unit, "")[0], unit))
        except BadInput:  # of another kind
            continue
    near = [(abs(np.log(f / wanted)), unit) for f, unit in found if unit != stated.unit]
    best = min(near, default=(np.inf, ""))
    return f", as if the column were in {best[1]}" if best[0] < NEAR else ""


def _first_states(problem: Problem) -> dict[str, float]:
    return {name: value for name, (value, _) in problem.start_states(problem.record.runs[0]).items()}
