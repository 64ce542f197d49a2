"""How an estimate is made, beyond what the experiment must say: the keys of [estimate.options]."""

from typing import Annotated, Literal

from pydantic import Field

from scenarios.declaration import Positive, Table

Share = Annotated[float, Field(strict=True, gt=0, lt=1)]


class Alarm(Table):
    """Tell when a quantity is below or above a limit with at least that probability."""

    below: float | None = None
    above: float | None = None
    probability: Share = 0.95


class Options(Table):
    """Filter, noise, gating, smoothing and alarms; what is left out is derived from the data.

    process_std: noise that drives a state, its unit/sqrt(s). walk: how far a parameter wanders in a second,
    its unit/sqrt(s). initial_std: what is known of a state's start. damping: of an unknown input's process.
    input_parts: in how many parts inputs act between two samples.
    """

    filter: Literal["ukf", "ekf", "dual"] = "ukf"
    smooth: bool = False
    process_std: dict[str, Annotated[float, Field(ge=0)]] = Field(default_factory=dict)
    walk: dict[str, Positive] = Field(default_factory=dict)
    initial_std: dict[str, Positive] = Field(default_factory=dict)
    damping: dict[str, Positive] = Field(default_factory=dict)
    random_walk: tuple[str, ...] = ()
    clip: tuple[str, ...] = ()
    gate: Positive | None = None
    adapt: tuple[Literal["measurement", "process"], ...] = ()
    input_parts: Annotated[int, Field(ge=1)] | None = None
    alpha: Annotated[float, Field(gt=0, le=1)] = 1.0
    beta: float = 2.0
    kappa: float = 0.0
    alarms: dict[str, Alarm] = Field(default_factory=lambda: {"mu0": Alarm(below=0.15)})
