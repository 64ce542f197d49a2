"""Candidates: what could explain a residual, each with its unknowns and a first size to try."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np
from scipy.signal import find_peaks

from estimator.closeloop import sensors
from estimator.closeloop.missing_force import MissingForce
from estimator.closeloop.problem import Unknown
from estimator.record import Array, Record
from fmus.effects import EFFECTS
from fmus.effects.effect import Effect

ORDERS = 2  # lines of a missing force's spectrum that are tried at each port
MAX_ORDER = 60.0  # cycles per turn, beyond which nothing on a shaft is looked for
FINE = 8  # points of the grids over a period of the highest order, and over a line of the spectrum


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
        if location in at:
            effect, missing = EFFECTS[kind], at[location]
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
    effect: type[Effect], location: str, missing: MissingForce, shape: dict[str, float]
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


def _size(effect: type[Effect], amplitude: str, missing: MissingForce, shape: dict[str, float]) -> float:
    """The amplitude with which the law's force has the rms of the missing one."""
    unit = _law(effect, missing, {**shape, amplitude: 1.0})
    rms = float(np.sqrt(np.mean(unit**2)))
    return float(np.sqrt(np.mean(missing.force**2))) / max(rms, 1e-12)


def _law(effect: type[Effect], missing: MissingForce, values: dict[str, float]) -> Array:
    """The force of a law along the motion (n,), with the amplitudes not named at 0."""
    q, v = cs.SX.sym("q"), cs.SX.sym("v")
    parameters = effect.parameters("rotation")
    symbols = {p.name: cs.SX(values.get(p.name, p.start)) for p in parameters}
    law = cs.Function("law", [q, v], [effect(symbols).force(q, v)]).map(len(missing.t))
    return np.array(law(missing.displacement[None, :], missing.velocity[None, :])).ravel()


def _shapes(effect: type[Effect], missing: MissingForce) -> list[dict[str, float]]:
    """Start values of an effect's shape parameters worth trying; one empty set where it has none to find."""
    if effect.kind != "periodic_force":
        return [{}]
    return [{"order": order} for order in orders(missing)]


def orders(missing: MissingForce) -> list[float]:
    """Strongest lines of the missing force over its displacement, in rad per unit of displacement."""
    q, v = missing.displacement, missing.velocity
    smooth = np.column_stack([np.ones_like(v), v, np.abs(v) * v, np.sign(v)])
    rest = missing.force - smooth @ np.linalg.lstsq(smooth, missing.force, rcond=None)[0]
    span, step = float(np.ptp(q)), float(np.median(np.abs(np.diff(q))))
    if span <= 0 or step <= 0 or not np.any(rest):
        return []
    low = 2 * np.pi / span * 3  # three periods in the record, to tell a line from a slow change
    high = min(np.pi / step, MAX_ORDER * max(1.0, low))
    if high <= low:
        return []
    cell = 2 * np.pi / high / FINE
    place = ((q - q.min()) / cell).astype(int)
    gathered = np.bincount(place, rest)  # the motion may turn round: what falls on one place adds up
    power = np.abs(np.fft.rfft(gathered, FINE * len(gathered)))
    grid = 2 * np.pi * np.fft.rfftfreq(FINE * len(gathered), cell)
    power[(grid < low) | (grid > high)] = 0.0
    peaks, _ = find_peaks(power, distance=2 * FINE)
    strongest = peaks[np.argsort(power[peaks])[::-1][:ORDERS]]
    return [float(grid[i]) for i in strongest]
