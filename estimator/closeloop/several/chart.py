"""The unknowns of effects, divided into those of the machine and those of the single run.

An effect declares the unknowns of a run in `of_run`: onset times, phases and states before the start.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.regressors import is_wave
from estimator.record import Array
from fmus.effects import EFFECTS

PHASE, AMPLITUDE = "phase", "amplitude"  # names of the unknowns that replace a sine and a cosine
TURN = 0.1  # rad, scale of a phase


@dataclass(frozen=True)
class Wave:
    """Names of the sine and cosine coefficients, amplitude and phase; sine = amplitude * cos(phase)."""

    sine: str
    cosine: str
    amplitude: str
    phase: str


@dataclass(frozen=True)
class Chart:
    """A change of coordinates from the unknowns of the FMU to those of the machine and those of a run.

    Both are the same, except for sine waves whose phase belongs to the run: these have amplitude and phase
    instead of the coefficients of a sine and a cosine.
    """

    natives: tuple[Unknown, ...]
    machine: tuple[Unknown, ...]
    run: tuple[Unknown, ...]
    waves: tuple[Wave, ...]

    def native(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values by the names of the FMU; values of other unknowns than waves are unchanged."""
        found = dict(values)
        for w in self.waves:
            size, phase = found.pop(w.amplitude), found.pop(w.phase)
            found |= {w.sine: size * np.cos(phase), w.cosine: size * np.sin(phase)}
        return found

    def turned(self, theta: Mapping[str, float]) -> dict[str, float]:
        """The inverse of `native`."""
        found = dict(theta)
        for w in self.waves:
            sine, cosine = found.pop(w.sine), found.pop(w.cosine)
            found |= {w.amplitude: float(np.hypot(sine, cosine)), w.phase: float(np.arctan2(cosine, sine))}
        return found

    def slopes(self, values: Mapping[str, float], native: Sequence[str], names: Sequence[str]) -> Array:
        """Derivatives of the FMU's values with respect to those of the chart, (len(native), len(names))."""
        found = np.array([float(n == name) for n in native for name in names])
        found = found.reshape(len(native), len(names))
        for w in self.waves:
            size, phase = values[w.amplitude], values[w.phase]
            turn = {
                (w.sine, w.amplitude): np.cos(phase),
                (w.sine, w.phase): -size * np.sin(phase),
                (w.cosine, w.amplitude): np.sin(phase),
                (w.cosine, w.phase): size * np.cos(phase),
            }
            for (n, name), slope in turn.items():
                if name in names:
                    found[list(native).index(n), list(names).index(name)] = slope
        return found


def chart(candidates: Sequence[Candidate]) -> Chart:
    """The chart of effects, which must not be sensor faults."""
    natives: list[Unknown] = []
    machine: list[Unknown] = []
    run: list[Unknown] = []
    waves: list[Wave] = []
    for c in candidates:
        own = EFFECTS[c.kind].of_run
        prefix = c.prefix
        left = list(c.unknowns)
        if PHASE in own and is_wave(c):
            cosine, sine = sorted(c.amplitudes, key=lambda u: u.name[-4:])
            wave = Wave(sine.name, cosine.name, prefix + AMPLITUDE, prefix + PHASE)
            size = float(np.hypot(sine.scale, cosine.scale))
            machine.append(Unknown(wave.amplitude, 0.0, 0.0, np.inf, size))
            run.append(Unknown(wave.phase, 0.0, -np.inf, np.inf, TURN))
            waves.append(wave)
            left = [u for u in left if u not in (sine, cosine)]
        run += [u for u in left if u.name.removeprefix(prefix) in own]
        machine += [u for u in left if u.name.removeprefix(prefix) not in own]
        natives += c.unknowns
    return Chart(tuple(natives), tuple(machine), tuple(run), tuple(waves))
