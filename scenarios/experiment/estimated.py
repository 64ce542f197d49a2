"""`[estimate]`: what the filter estimates, and how."""

from typing import Annotated, Final, Literal, Self

from pydantic import Field, PlainValidator, model_validator

from scenarios.experiment.table import Interval, NotNegative, Number, Positive, Share, Table, Truth, is_number


def _filter(value: object) -> str:
    from estimator.filters import filters  # they take a second to load, and few files name one

    if not (isinstance(value, str) and value in filters()):
        raise ValueError(f"must be one of {', '.join(filters())}, not {str(value)[:60]!r}")
    return value


Filter = Annotated[str, PlainValidator(_filter)]


class EstimatedParameter(Table):
    """A parameter the filter estimates; start and bounds default to the declared and the FMU's."""

    start: Number | None = None
    std: Positive | None = None
    bounds: Interval | None = None

    @model_validator(mode="after")
    def _start_within_bounds(self) -> Self:
        if self.start is not None and self.bounds and not self.bounds[0] <= self.start <= self.bounds[1]:
            raise ValueError(f"start {self.start:g} is outside its bounds {list(self.bounds)}")
        return self


class EstimatedInput(Table):
    """An unknown input: a random process of that standard deviation about that frequency [Hz]."""

    std: Positive
    frequency: Positive
    rate_input: str | None = None


ESTIMATED: Final = "estimated"  # in place of a number that the record is to say


def _or_estimated(value: object) -> float | str:
    if value == ESTIMATED:
        return ESTIMATED
    if is_number(value) and isinstance(value, int | float) and value > 0:
        return float(value)
    raise ValueError(f'must be a number above 0, or "{ESTIMATED}", not {value!r}')


OrEstimated = Annotated[float | str, PlainValidator(_or_estimated)]


class OutputNoise(Table):
    """Noise of an output, beside its noise_std. What is "estimated" is what makes the record likeliest.

    std: "estimated" where noise_std is uncertain; time: s, over which the correlation of the noise falls to
    1/e; share: of its variance that is correlated in time, the rest of which is white.
    """

    std: Literal["estimated"] | None = None
    time: OrEstimated | None = None
    share: OrEstimated = 1.0

    @model_validator(mode="after")
    def _says_what_is_correlated(self) -> Self:
        if self.time is None and "share" in self.model_fields_set:
            raise ValueError(f'has a share but no time of correlation; add time = ... in s, or "{ESTIMATED}"')
        if self.time is None and self.std is None:
            raise ValueError(f'says nothing; add time = ... in s, or std = "{ESTIMATED}"')
        if isinstance(self.share, float) and self.share > 1:
            raise ValueError(f"share {self.share:g} is above 1; it is a part of the noise's variance")
        return self


class Alarm(Table):
    """Tell when a quantity is below or above a limit with at least that probability, for `hold` s on end."""

    below: Number | None = None
    above: Number | None = None
    probability: Share = 0.95
    hold: NotNegative = 1.0

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.below is None and self.above is None:
            raise ValueError("needs 'below' or 'above', the limit in the quantity's unit")
        return self


class Options(Table):
    """How an estimate is made: filter, noise, gating, smoothing, alarms; the rest is derived from the data.

    process_std: noise that drives a state, its unit/sqrt(s). walk: how far a parameter wanders in a second,
    its unit/sqrt(s). initial_std: what is known of a state's start. damping: of an unknown input's process.
    input_parts: in how many parts inputs act between two samples. alarms: in place of those that the model
    declares. form: whether what the form of the model leaves open is estimated too.
    """

    filter: Filter = "ukf"
    smooth: Truth = False
    process_std: dict[str, NotNegative] = Field(default_factory=dict)
    walk: dict[str, Positive] = Field(default_factory=dict)
    initial_std: dict[str, Positive] = Field(default_factory=dict)
    damping: dict[str, Positive] = Field(default_factory=dict)
    random_walk: tuple[str, ...] = ()
    clip: tuple[str, ...] = ()
    gate: Positive | None = None
    adapt: tuple[Literal["measurement", "process"], ...] = ()
    input_parts: Annotated[int, Field(strict=True, ge=1)] | None = None
    form: Truth = True
    alpha: Annotated[float, Field(strict=True, gt=0, le=1)] = 1.0
    beta: Number = 2.0
    kappa: Number = 0.0
    alarms: dict[str, Alarm] = Field(default_factory=dict)


class Estimate(Table):
    """What the filter estimates beside the states it needs anyway, and how; `rate` in Hz.

    delay: by output, how much later than the motion that it shows it is measured, s.
    """

    parameters: dict[str, EstimatedParameter] = Field(default_factory=dict)
    states: tuple[str, ...] = ()
    rate: Positive | None = None
    inputs: dict[str, EstimatedInput] = Field(default_factory=dict)
    noise: dict[str, OutputNoise] = Field(default_factory=dict)
    delay: dict[str, Positive] = Field(default_factory=dict)
    options: Options = Options()
