"""A candidate effect that could explain a residual, with its unknowns and their start values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from estimator.closeloop.question.problem import Unknown
from estimator.sensor_faults import FAULTS

REACH, REACH_STEPS = 0.05, 25  # half width of the grid, as share of the fitted length; steps per side
HALVINGS = 6  # of a step, for the onset times beside the best one


@dataclass(frozen=True)
class Candidate:
    """An effect at a location, or a fault of a sensor.

    amplitudes: unknowns to which the effect is proportional, with a realistic size as scale; shape: further
    unknowns, with their start values; fixed: values that are not fitted. An amplitude with a fixed value is
    used in the screening only; its value holds for every true effect of this kind. visible: values of shapes
    below which the record shows no difference, by name.
    """

    kind: str
    location: str
    amplitudes: tuple[Unknown, ...]
    shape: tuple[Unknown, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict, hash=False)
    visible: Mapping[str, float] = field(default_factory=dict, hash=False)

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """The unknowns that are fitted."""
        return (*(u for u in self.amplitudes if u.name not in self.fixed), *self.shape)

    @property
    def given(self) -> dict[str, float]:
        """Shape and fixed values by name, without the amplitudes."""
        own = {u.name for u in self.amplitudes}
        shape = {u.name: u.start for u in self.shape}
        return shape | {n: v for n, v in self.fixed.items() if n not in own}

    @property
    def is_fault(self) -> bool:
        """Whether it is a fault of a sensor."""
        return self.kind in FAULTS

    @property
    def label(self) -> str:
        """kind@location."""
        return f"{self.kind}@{self.location}"

    @property
    def prefix(self) -> str:
        """Prefix of the names of its unknowns; sensor faults do not use it."""
        return f"{self.kind}_{self.location}_"

    @property
    def onset(self) -> float | None:
        """Onset time, in s; None if it acts from the start."""
        return next((u.start for u in self.shape if u.is_onset), None)

    @property
    def duration_name(self) -> str:
        """Name of the unknown that is the duration of a change which sets in at a time."""
        return f"{self.prefix}T_r"

    def with_onset(self, t: float) -> Candidate:
        """The candidate with its onset at time t, in s."""
        return replace(self, shape=tuple(replace(u, start=t) if u.is_onset else u for u in self.shape))


def onsets_near(now: float, length: float) -> list[float]:
    """A grid of onset times about `now`, in s, ascending and within the fitted length."""
    grid = now + REACH * length * np.arange(-REACH_STEPS, REACH_STEPS + 1) / REACH_STEPS
    return [float(t) for t in np.unique(np.clip(grid, 0.0, length))]


def onsets_beside(now: float, length: float) -> list[float]:
    """Onset times on both sides of `now`, in s, closer than those of the grid, within the fitted length."""
    away = REACH * length / REACH_STEPS / 2.0 ** np.arange(1, HALVINGS + 1)
    return [float(t) for t in (*(now - away), *(now + away)) if 0.0 < t < length]
