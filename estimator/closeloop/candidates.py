"""Candidates: what could explain a residual, each with its unknowns and a first size to try."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.closeloop import sensors
from estimator.closeloop.missing_force import MissingForce
from estimator.closeloop.problem import Unknown
from estimator.record import Array, Record
from fmus.effects import EFFECTS, spectrum
from fmus.effects.force_law import ForceLaw

TRIED = (  # laws whose shape is nothing or the line of a spectrum
    "constant_force",
    "coulomb_friction",
    "cubic_stiffness",
    "periodic_force",
    "quadratic_damping",
    "viscous_damping",
)


@dataclass(frozen=True)
class Candidate:
    """An effect at a location, or a fault of a sensor.

    amplitudes: the unknowns it is proportional to, with a realistic size as scale;
    shape: further unknowns, with their start values.
    """

    kind: str
    location: str
    amplitudes: tuple[Unknown, ...]
    shape: tuple[Unknown, ...] = ()

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """All its unknowns."""
        return self.amplitudes + self.shape

    @property
    def is_fault(self) -> bool:
        """A fault of a sensor, not physics."""
        return self.kind in sensors.KINDS

    @property
    def label(self) -> str:
        """kind@location."""
        return f"{self.kind}@{self.location}"


def physical_candidates(offers: Sequence[tuple[str, str]], forces: Sequence[MissingForce]) -> list[Candidate]:
    """Every effect on offer, (kind, location), its amplitudes sized by the missing force there."""
    at = {missing.port.name: missing for missing in forces}
    found = []
    for kind, location in offers:
        effect = EFFECTS[kind]
        if location in at and kind in TRIED and issubclass(effect, ForceLaw):
            missing = at[location]
            found += [_candidate(effect, location, missing, shape) for shape in _shapes(effect, missing)]
    return found


def fault_candidates(record: Record, noise: Array) -> list[Candidate]:
    """Bias, gain, delay and drift of each measured output."""
    found = []
    y = np.vstack([run.y for run in record.runs])
    length = max(float(run.t[-1] - run.t[0]) for run in record.runs)
    step = float(np.median(np.diff(record.runs[0].t)))
    for j, output in enumerate(record.outputs):
        spread = float(np.std(y[:, j])) + float(noise[j])
        size = {"sensor_bias": 0.05 * spread, "sensor_gain": 0.05, "sensor_delay": 3 * step}
        size["sensor_drift"] = 0.05 * spread / length
        for kind in sensors.KINDS:
            low = 0.0 if kind == "sensor_delay" else -np.inf
            unknown = Unknown(sensors.parameter(kind, output), 0.0, low, np.inf, size[kind])
            found.append(Candidate(kind, output, (unknown,)))
    return found


def _candidate(
    effect: type[ForceLaw], location: str, missing: MissingForce, shape: dict[str, float]
) -> Candidate:
    parameters = {p.name: p for p in effect.parameters("rotation")}
    amplitudes, others = [], []
    for name, p in parameters.items():
        low = -np.inf if p.min is None else p.min
        high = np.inf if p.max is None else p.max
        full = effect.name_at(location, name)
        if name in effect.amplitudes:
            size = _size(effect, name, missing, shape)
            amplitudes.append(Unknown(full, 0.0, low, high, size))
        elif name in shape:
            scale = 1.0 / max(float(np.ptp(missing.displacement)), 1e-9)
            others.append(Unknown(full, shape[name], low, high, scale))
    return Candidate(effect.kind, location, tuple(amplitudes), tuple(others))


def _size(effect: type[ForceLaw], amplitude: str, missing: MissingForce, shape: dict[str, float]) -> float:
    """The amplitude with which the law's force has the rms of the missing one."""
    unit = _law(effect, missing, {**shape, amplitude: 1.0})
    rms = float(np.sqrt(np.mean(unit**2)))
    return float(np.sqrt(np.mean(missing.force**2))) / max(rms, 1e-12)


def _law(effect: type[ForceLaw], missing: MissingForce, values: dict[str, float]) -> Array:
    """The force of a law along the motion (n,), with the amplitudes not named at 0."""
    return effect.along(values, missing.t, missing.displacement, missing.velocity)


def _shapes(effect: type[ForceLaw], missing: MissingForce) -> list[dict[str, float]]:
    """Start values of an effect's shape parameters worth trying; one empty set where it has none to find."""
    if effect.kind != "periodic_force":
        return [{}]
    return effect.guesses(missing.t, missing.displacement, missing.velocity, missing.force)


def orders(missing: MissingForce) -> list[float]:
    """Strongest lines of the missing force over its displacement, in rad per unit of displacement."""
    return spectrum.orders(missing.displacement, missing.velocity, missing.force)
