"""Filters that an experiment asks for by name: the key `filter` of [estimate.options]."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from estimator.filters.estimator import Adaptation, Estimate, Gate
from estimator.record import Array

if TYPE_CHECKING:
    from estimator.filters.history import Steps
    from estimator.filters.system import Joint
    from estimator.filters.ukf import Spread


@dataclass(frozen=True)
class Request:
    """What an experiment says to a filter beside the system and its start.

    R: measurement noise as a covariance (m, m); dt: usual step, s; u: inputs (n_u,) of the first sample;
    gate, adapt: None where they are not wanted; spread: of sigma points.
    """

    R: Array
    dt: float
    u: Array
    gate: Gate | None
    adapt: Adaptation | None
    spread: Spread


class Estimator(ABC):
    """A filter that an experiment can ask for; `name` is the value of the key `filter`."""

    name: ClassVar[str]

    @classmethod
    @abstractmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Steps:
        """The filter of an FMU as a joint system; BadInput for an option that it does not have."""
