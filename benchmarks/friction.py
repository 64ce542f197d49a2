"""The friction case: six states of the wheelset, mu0 and the alignment, estimated from four noisy outputs.

The wheelset runs at 40 m/s and is sampled at 1 kHz. The alignment is an unknown input with a shaping filter.
There are thus nine unknowns and 19 sigma points.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.history import Samples, samples
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from estimator.filters.unknown_input import Shaped
from estimator.record import Array
from fmus.host.fmu import Fmu

DT, V, MU0 = 1e-3, 40.0, 0.5  # s, m/s, 1
NOISE = {"y": 1e-4, "psi": 1e-5, "y_dot": 1e-3, "psi_dot": 1e-3}
STATES = (
    UnknownState("y", 0.0, 1e-3, 1e-9),
    UnknownState("psi", 0.0, 1e-3, 1e-9),
    UnknownState("y_dot", 0.0, 1e-2, 1e-6),
    UnknownState("psi_dot", 0.0, 1e-2, 1e-6),
    UnknownState("y_m", 0.0, 1e-3, 1e-9),
    UnknownState("y_m_dot", 0.0, 1e-2, 1e-6),
)
FRICTION = UnknownParameter("mu0", 0.4, 0.1, bounded((0.01, 0.6)), walk=0.005)
ALIGNMENT = Shaped("y_irr", 0.8e-3, 1.5, "y_irr_dot", 1.0)
R = np.diag(np.square([*NOISE.values()]))
NOTHING = np.empty(0)  # there are no known inputs besides V


def record(fmu: Path, seconds: float) -> Array:
    """Noisy outputs (N, 4) of a simulation over waves of 6 to 60 m length with random phases."""
    rng, t = np.random.default_rng(1), np.arange(round(seconds / DT) + 1) * DT
    omega = 2 * np.pi * V / np.geomspace(6.0, 60.0, 40)
    waves = np.outer(t, omega) + rng.uniform(0, 2 * np.pi, 40)
    size = ALIGNMENT.std * np.sqrt(2 / 40) * np.minimum(t, 1.0)[:, None]  # grows from zero in 1 s
    y_irr = (size * np.sin(waves)).sum(axis=1)
    inputs = {"y_irr": y_irr, "y_irr_dot": np.gradient(y_irr, DT)}
    with Fmu(fmu) as plant:
        y = plant.simulate(t, inputs, list(NOISE), {"V": V, "mu0": MU0})
    return y + rng.standard_normal(y.shape) * [*NOISE.values()]


def as_samples(y: Array) -> Samples:
    """Outputs (N, 4) as the data of a filter."""
    return samples(np.arange(len(y)) * DT, np.empty((len(y), 0)), y)


def ukf(joint: Joint) -> Ukf:
    """The unscented filter of railfmi at the start of the record."""
    return Ukf(joint, joint.start(), joint.noise, R, DT)


class Ours:
    """The unscented filter of railfmi; more: further unknown parameters."""

    def __init__(self, fmu: Path, compiled: bool = True, more: Sequence[UnknownParameter] = ()) -> None:
        self.joint = Joint(
            fmu, list(NOISE), STATES, [FRICTION, *more], [ALIGNMENT], constants={"V": V}, dt=DT,
            compiled=compiled,
        )  # fmt: skip
        self.filter = ukf(self.joint)
        self.filter.step(NOTHING, np.full(len(NOISE), np.nan))  # the first step does not advance the time

    def step(self, y: Array) -> Array:
        """Predict and correct."""
        return self.filter.step(NOTHING, y).x
