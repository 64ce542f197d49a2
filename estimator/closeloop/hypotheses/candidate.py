"""A candidate: what could explain a residual, with its unknowns and a first size to try."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from estimator.closeloop.question.problem import Unknown
from estimator.sensor_faults import FAULTS


@dataclass(frozen=True)
class Candidate:
    """An effect at a location, or a fault of a sensor.

    amplitudes: the unknowns it is proportional to, with a realistic size as scale; shape: further
    unknowns, with their start values; fixed: values that no fit has to find. An amplitude with a fixed
    value is one that a true effect of this kind has: it serves the screening alone.
    """

    kind: str
    location: str
    amplitudes: tuple[Unknown, ...]
    shape: tuple[Unknown, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict, hash=False)

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What a fit has to find."""
        return (*(u for u in self.amplitudes if u.name not in self.fixed), *self.shape)

    @property
    def given(self) -> dict[str, float]:
        """Shape and fixed values, amplitudes left out."""
        own = {u.name for u in self.amplitudes}
        shape = {u.name: u.start for u in self.shape}
        return shape | {n: v for n, v in self.fixed.items() if n not in own}

    @property
    def is_fault(self) -> bool:
        """A fault of a sensor, not physics."""
        return self.kind in FAULTS

    @property
    def label(self) -> str:
        """kind@location."""
        return f"{self.kind}@{self.location}"

    @property
    def prefix(self) -> str:
        """How the names of its unknowns begin; of a sensor's fault they do not."""
        return f"{self.kind}_{self.location}_"
