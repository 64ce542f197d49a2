"""Problems of tests, which are not simulated by an FMU."""

from copy import copy
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from estimator.plant import USUAL


def record_with(**given: Any) -> Any:
    """A record with these attributes; its stretches are not asked for as long as noise is white."""
    return SimpleNamespace(stretches=_none, **given)


def _none(part: str) -> list[int]:
    return []


class OneByOne:
    """What the fits ask of a problem whose simulations are made one after the other."""

    at_once = 1
    steps = searched = USUAL
    coupling = 0.0  # s, as of an FMU of ours
    other_forms = ()

    def identify_residuals(self, thetas):
        """See Problem."""
        return None

    def in_steps(self, steps):
        """See Problem."""
        again = copy(self)
        object.__setattr__(again, "steps", steps)
        return again


@dataclass(frozen=True)
class Always:
    """A builder that gives one FMU, whatever the effects; it runs in this process."""

    fmu: Path
    isolation = None
    coupling = 0.0

    def coupled_every(self, step: float) -> "Always":
        """See Builder."""
        return self

    def __call__(self, effects: tuple[tuple[str, str], ...]) -> Path:
        """See Builder."""
        return self.fmu
