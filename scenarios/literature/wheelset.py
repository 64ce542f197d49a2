"""Shared parts of the wheelset's rows: measurements, filters with and without the alignment, shaping."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from estimator.filters.unknown_input import Shaped
from scenarios.literature.case import Record
from scenarios.literature.following import Followed, follow

V = 40.0  # m/s, thesis 4.6.1
DT = 1e-3  # s
ALIGNMENT = ("y_irr", "y_irr_dot")
NOISE = {"y": 1e-4, "psi": 1e-5, "y_dot": 1e-3, "psi_dot": 1e-3}
MEASURED = tuple(NOISE)

# start deviations, and process noise per second^1/2; a run begins at rest
STATES = (
    UnknownState("y", 0.0, std=1e-3, noise=1e-9),
    UnknownState("psi", 0.0, std=1e-3, noise=1e-9),
    UnknownState("y_dot", 0.0, std=1e-2, noise=1e-6),
    UnknownState("psi_dot", 0.0, std=1e-2, noise=1e-6),
    UnknownState("y_m", 0.0, std=1e-3, noise=1e-9),
    UnknownState("y_m_dot", 0.0, std=1e-2, noise=1e-6),
)
LEARNT = 15.0  # s of a record from which the alignment's shaping is learnt
DEVIATION = 0.8e-3  # m, of the alignment: thesis Table 3.1
SHAPES = tuple((f, d) for f in (1.0, 1.5, 2.0, 2.5) for d in (0.7, 1.0, 1.5))  # Hz and damping to choose from


@dataclass(frozen=True)
class Task:
    """The problem of a wheelset filter: one unknown parameter, the others as declared."""

    fmu: Path
    parameter: UnknownParameter
    declared: Mapping[str, float]

    def known(self, record: Record) -> Followed:
        """With the alignment known."""
        with self._joint((), ALIGNMENT) as joint:
            return self._followed(joint, record, record.table(ALIGNMENT))

    def along(self, record: Record, shape: Shaped) -> Followed:
        """Run the filter on the outputs alone, with the alignment estimated as well."""
        with self._joint((shape,), ()) as joint:
            return self._followed(joint, record, record.table(()))

    def shaped(self, record: Record) -> Shaped:
        """The shaping filter of the alignment for which the first seconds of a record are likeliest."""
        part = record.t < record.t[0] + LEARNT
        first = Record({name: samples[part] for name, samples in record.columns.items()})
        shapes = [Shaped("y_irr", DEVIATION, f, "y_irr_dot", d) for f, d in SHAPES]
        return max(shapes, key=lambda shape: self.along(first, shape).log_likelihood)

    def _joint(self, unknown: tuple[Shaped, ...], inputs: tuple[str, ...]) -> Joint:
        constants = {"V": V, **self.declared}
        return Joint(self.fmu, MEASURED, STATES, [self.parameter], unknown, inputs, constants, DT)

    def _followed(self, joint: Joint, record: Record, u: np.ndarray) -> Followed:
        filter = Ukf(joint, joint.start(), joint.noise, variances(NOISE), DT)
        return follow(filter, joint, record.t, u, record.table(MEASURED))


def variances(noise: Mapping[str, float]) -> np.ndarray:
    """Covariance (m, m) of white noise of these standard deviations."""
    return np.diag(np.square([*noise.values()]))
