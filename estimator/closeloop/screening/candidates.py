"""The candidates for a record: effects and sensor faults, each with start values of its shape parameters."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.policy import CandidatePolicy
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.record import Array, Record
from estimator.sensor_faults import FAULTS
from fmus.effects import EFFECTS
from fmus.effects.component_effect import ComponentEffect
from fmus.effects.effect import Effect
from fmus.effects.force_law import ForceLaw
from fmus.effects.input_effect import HOLD, InputEffect
from fmus.effects.parameter_effect import ParameterEffect
from fmus.effects.site import Site
from fmus.variables import Parameter, Variable

SHAPE_CHANGE = 0.1  # scale of a shape parameter, as share of its value


INERTIAS = ("kg", "kg.m2")  # units of what cannot vanish


ONSET_SCALE = 0.01  # scale of an onset time, as share of the record's length


def physical_candidates(
    problem: Problem, offers: Sequence[tuple[str, str]], forces: Sequence[MissingForce]
) -> list[Candidate]:
    """Candidates for each pair of kind and location, one per set of start values of the shape."""
    site, record = problem.builder.outside(), problem.record
    at = {missing.port.name: missing for missing in forces}
    found: list[Candidate] = []
    for kind, location in offers:
        effect = EFFECTS[kind]
        if issubclass(effect, ForceLaw):
            if location in at:
                found += _of_a_force(effect, location, at[location], record.sample)
        elif issubclass(effect, InputEffect):
            if location in record.inputs:
                found += _of_an_input(effect, location, record)
        elif issubclass(effect, ParameterEffect):
            found += _of_a_parameter(effect, location, site, record, problem.policy.candidates)
        elif issubclass(effect, ComponentEffect):
            size = {a: effect.size(_length(record)) for a in effect.amplitudes}
            shapes = effect.guesses(_times(record))
            found += [_candidate(effect, location, size, shape, _length(record)) for shape in shapes]
    return found


def fault_candidates(
    record: Record, noise: Array, limits: CandidatePolicy, shown: Array | None = None
) -> list[Candidate]:
    """Candidates for every kind of sensor fault at every measured output, one per size to start from.

    shown: (N, n_y) simulated outputs of the first run; without them each starts from a realistic size.
    """
    found = []
    y, run = np.vstack([run.y for run in record.runs]), record.runs[0]
    length = max(float(run.t[-1] - run.t[0]) for run in record.runs)
    longest = limits.longest_delay * float(run.t[-1] - run.t[0])
    for j, output in enumerate(record.outputs):
        spread = float(np.std(y[:, j])) + float(noise[j])
        for fault in FAULTS.values():
            sizes = [fault.size(spread, length, run.sample)]
            if shown is not None:
                measured = np.where(run.fit, run.y[:, j], np.nan)
                afar = fault.afar(shown[:, j], measured, run.sample, longest)
                sizes += [afar] if afar is not None and afar > sizes[0] else []
            unknowns = (Unknown(fault.name_at(output), 0.0, fault.low, fault.high, size) for size in sizes)
            found += [Candidate(fault.kind, output, (unknown,)) for unknown in unknowns]
    return found


def _of_a_force(
    effect: type[ForceLaw], location: str, seen: MissingForce, sample: float
) -> Iterator[Candidate]:
    """Candidates of a force law; a turn of it within a sample, in s, is as sudden to the record as any."""
    motion = seen.t - seen.t[0], seen.displacement, seen.velocity
    over = {"displacement": seen.displacement, "velocity": seen.velocity}
    visible = {
        effect.name_at(location, n): sample * _rate(seen.t, over[of]) for n, of in effect.rounded.items()
    }
    for shape in effect.guesses(*motion, seen.force):
        sizes = {a: _size(effect, a, shape, motion, seen.force) for a in effect.amplitudes}
        found = _candidate(effect, location, sizes, shape, float(motion[0][-1]))
        yield replace(found, visible=visible)


def _rate(t: Array, x: Array) -> float:
    """Median of how fast a motion (N,) changes over times t (N,)."""
    return float(np.median(np.abs(np.diff(x)) / np.diff(t))) if len(t) > 1 else 0.0


def _of_an_input(effect: type[InputEffect], location: str, record: Record) -> Iterator[Candidate]:
    run, j = record.runs[0], record.inputs.index(location)
    u, size = run.u[run.fit, j], effect.size(_length(record))
    whole = effect.complete
    for shape in effect.guesses(_times(record), u):
        sizes = {a: whole.get(a, size) for a in effect.amplitudes}
        told = {HOLD: float(run.u[0, j])} if any(p.name == HOLD for p in effect.parameters("1")) else {}
        yield _candidate(effect, location, sizes, {**shape, **told}, _length(record))


def _of_a_parameter(
    effect: type[ParameterEffect], location: str, site: Site, record: Record, limits: CandidatePolicy
) -> Iterator[Candidate]:
    members = effect.locations(site)[location]
    sizes = {}
    for name in members:
        value = site.variables[name].start or site.variables[name].nominal or 1.0
        for a in effect.amplitudes:
            own = a if location == name else f"{a}_{name}"
            sizes[own] = effect.size(value, _length(record))
    for shape in effect.guesses(_times(record)):
        found = _candidate(effect, location, sizes, shape, _length(record))
        pairs = zip(found.amplitudes, members, strict=True)
        limited = tuple(_limited(u, site.variables[n], limits) for u, n in pairs)
        yield replace(found, amplitudes=limited)


def _limited(change: Unknown, of: Variable, limits: CandidatePolicy) -> Unknown:
    """The change with bounds that keep the parameter within its limits, also after calibration."""
    value, most = of.start or 0.0, limits.largest_change * change.scale
    low = -np.inf if of.min is None else of.min - value - limits.near_start * abs(value)
    if of.unit in INERTIAS:
        low = max(low, (limits.least_inertia - 1) * value)
    high = np.inf if of.max is None else of.max - value + limits.near_start * abs(value)
    return replace(change, low=max(low, -most), high=min(high, most))


def _candidate(
    effect: type[Effect], location: str, sizes: Mapping[str, float], shape: Mapping[str, float], length: float
) -> Candidate:
    """A candidate; sizes: scale of each amplitude; shape: start values, or values known from the record."""
    declared = {p.name: p for p in effect.parameters(_ANY[effect.acts_on])}
    fixed = dict(effect.complete)
    fixed |= {n: v for n, v in shape.items() if n in effect.told or n == HOLD}
    amplitudes = tuple(
        _unknown(effect, location, name, declared.get(name, declared.get(name.split("_")[0])), 0.0, abs(size))
        for name, size in sizes.items()
    )
    free = {n: v for n, v in shape.items() if n not in fixed}
    others = tuple(
        _unknown(
            effect,
            location,
            n,
            declared[n],
            v,
            ONSET_SCALE * length if n == "t0" else SHAPE_CHANGE * (abs(v) or 1.0),
        )
        for n, v in free.items()
    )
    named = {effect.name_at(location, n): v for n, v in fixed.items()}
    return Candidate(effect.kind, location, amplitudes, others, named)


_ANY = {"port": "rotation", "component": "", "parameter": "1", "input": "1"}  # the units are not used


def _unknown(
    effect: type[Effect], location: str, name: str, p: Parameter | None, start: float, scale: float
) -> Unknown:
    low = -np.inf if p is None or p.min is None else p.min
    high = np.inf if p is None or p.max is None else p.max
    return Unknown(effect.name_at(location, name), start, low, high, scale)


def _size(
    effect: type[ForceLaw], amplitude: str, shape: Mapping[str, float], motion: tuple[Array, Array, Array],
    force: Array,
) -> float:  # fmt: skip
    """The amplitude for which the law's force has the rms of the missing force."""
    unit = effect.along({**shape, amplitude: 1.0}, *motion)
    rms = float(np.sqrt(np.mean(unit**2)))
    return float(np.sqrt(np.mean(force**2))) / max(rms, 1e-12)


def _times(record: Record) -> Array:
    """Times of the part to identify, in s from the start of the run."""
    run = record.runs[0]
    return np.asarray(run.t[run.fit] - run.t[0])


def _length(record: Record) -> float:
    return float(record.runs[0].t[-1] - record.runs[0].t[0])
