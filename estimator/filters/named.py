"""Base class of the filters that an experiment can choose by the key `filter` of [estimate.options]."""

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
    """The settings of a filter from the experiment file.

    R: covariance of the measurement noise, (m, m); dt: usual time step, s; u: inputs of the first sample,
    (n_u,); gate, adapt: options of the filter, None if not used; spread: sigma points of a UKF.
    """

    R: Array
    dt: float
    u: Array
    gate: Gate | None
    adapt: Adaptation | None
    spread: Spread


class Estimator(ABC):
    """A filter that an experiment can choose; `name` is the value of the key `filter`.

    moments: whether mean and covariance are all that it knows. If not, its estimates cannot be smoothed, and
    `watch` cannot carry it over a gap. noises: whether x may hold noise of inputs and outputs.
    """

    name: ClassVar[str]
    moments: ClassVar[bool] = True
    noises: ClassVar[bool] = True

    @classmethod
    @abstractmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Steps:
        """The filter for an FMU as a joint system; raises BadInput for an option that it does not support."""
