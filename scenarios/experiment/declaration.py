"""What an experiment.toml may say: one class a table, one field a key."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, model_validator


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _interval(value: object) -> tuple[float, float]:
    if not (isinstance(value, list | tuple) and len(value) == 2 and all(map(_is_number, value))):
        raise ValueError(f"must be two numbers [lower, upper], not {value!r}")
    if not value[0] < value[1]:
        raise ValueError(f"must increase, [lower, upper], not {list(value)}")
    return float(value[0]), float(value[1])


def _filter(value: object) -> str:
    from estimator.filters import filters  # they take a second to load, and few files name one

    if not (isinstance(value, str) and value in filters()):
        raise ValueError(f"must be one of {', '.join(filters())}, not {str(value)[:60]!r}")
    return value


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Share = Annotated[float, Field(strict=True, gt=0, lt=1)]
Interval = Annotated[tuple[float, float], PlainValidator(_interval)]
Filter = Annotated[str, PlainValidator(_filter)]


class Table(BaseModel):
    """A table of the file: its keys are the fields, no others."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class InputColumn(Table):
    """A measured input: its column, the column's unit, and the FMU's where the FMU states none.

    Without `unit` the column has the unit that the file states, else that of the FMU.
    """

    column: str
    unit: str | None = None
    model_unit: str | None = None


def _column_or_number(value: object) -> str | float | InputColumn:
    if isinstance(value, str):
        return value
    if isinstance(value, int | float) and _is_number(value):
        return float(value)
    if isinstance(value, dict):
        return InputColumn.model_validate(value)
    raise ValueError(
        f"must be a column name in quotes or a number, or a table {{column, unit, model_unit}}, not {value!r}"
    )


Channel = Annotated[str | float | InputColumn, PlainValidator(_column_or_number)]


class Split(Table):
    """Which data effects are fitted on, chosen on and tested on: windows [s] of one file, or files.

    `choose` may be left out: a fifth of what identifies is then taken for it, in pieces spread over it.
    """

    identify: Interval | None = None
    choose: Interval | None = None
    test: Interval | None = None
    identify_data: str | None = None
    choose_data: str | None = None
    test_data: str | None = None

    @model_validator(mode="after")
    def _windows_or_files(self) -> Self:
        given = self.model_fields_set - {"choose", "choose_data"}
        files = "identify_data" in given
        if given not in ({"identify", "test"}, {"identify_data", "test_data"}):
            raise ValueError("needs either 'identify' and 'test', or 'identify_data' and 'test_data'")
        if self.choose and files:
            raise ValueError("'choose' is a window of one file; beside 'identify_data' write 'choose_data'")
        if self.choose_data and not files:
            raise ValueError("'choose_data' is a file; beside 'identify' write 'choose', a window in seconds")
        windows = sorted((w, key) for key, w in self.windows.items())
        for (first, one), (second, other) in pairwise(windows):
            if second[0] < first[1]:
                raise ValueError(f"'{one}' and '{other}' overlap from {second[0]:g} s to {first[1]:g} s")
        return self

    @property
    def windows(self) -> dict[str, tuple[float, float]]:
        """The windows that are given, by key, s."""
        given = {"identify": self.identify, "choose": self.choose, "test": self.test}
        return {key: window for key, window in given.items() if window}

    @property
    def files(self) -> dict[str, str]:
        """The files that are given, by the part of the record that they hold."""
        given = {"identify": self.identify_data, "choose": self.choose_data, "test": self.test_data}
        return {part: file for part, file in given.items() if file}


class Output(Table):
    """A measured output: its column, the column's unit, and the standard deviation of its noise in it.

    model_unit: the FMU's unit, to be said where the FMU states none; the column is converted to it.
    """

    column: str
    unit: str
    model_unit: str | None = None
    noise_std: Positive | None = None


class Derived(Table):
    """A column made from another one: its time derivative by central differences."""

    derivative: str


class Port(Table):
    """A location on a foreign FMU: a force input and the outputs conjugate to it.

    Without a displacement, only laws over velocity and time are tried there.
    """

    name: str
    force: str
    velocity: str
    displacement: str | None = None


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


class Guess(Table):
    """Start value and standard deviation of an unknown, in the FMU's unit."""

    start: Number
    std: Positive


class ModeOf(Table):
    """A mode of the filters `imm` and `rbpf`: where unknowns start, and the factor of the process noise."""

    at: dict[str, Guess] = {}
    process: Positive = 1.0


class CorrelatedNoise(Table):
    """Noise of an output that is correlated in time, beside its white noise; time: s, to 1/e."""

    std: Positive
    time: Positive


class Options(Table):
    """How an estimate is made: filter, noise, gating, smoothing, alarms; the rest is derived from the data.

    process_std: noise that drives a state, its unit/sqrt(s). walk: how far a parameter wanders in a second,
    its unit/sqrt(s). initial_std: what is known of a state's start. damping: of an unknown input's process.
    input_parts: in how many parts inputs act between two samples. alarms: in place of those that the model
    declares. form: whether what the form of the model leaves open is estimated too. correlated, delay (s): of
    outputs. tune: noise that is found by likelihood. modes, stay (s), members, seed, iterations: of filters
    that take them.
    """

    filter: Filter = "ukf"
    smooth: bool = False
    process_std: dict[str, NotNegative] = {}
    walk: dict[str, Positive] = {}
    initial_std: dict[str, Positive] = {}
    damping: dict[str, Positive] = {}
    random_walk: tuple[str, ...] = ()
    clip: tuple[str, ...] = ()
    gate: Positive | None = None
    adapt: tuple[Literal["measurement", "process"], ...] = ()
    input_parts: Annotated[int, Field(strict=True, ge=1)] | None = None
    form: bool = True
    alpha: Annotated[float, Field(strict=True, gt=0, le=1)] = 1.0
    beta: Number = 2.0
    kappa: Number = 0.0
    alarms: dict[str, Alarm] = {}
    correlated: dict[str, CorrelatedNoise] = {}
    delay: dict[str, Positive] = {}
    tune: tuple[Literal["measurement", "process"], ...] = ()
    modes: tuple[ModeOf, ...] = ()
    stay: Positive | None = None
    members: Annotated[int, Field(strict=True, ge=1)] | None = None
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    iterations: Annotated[int, Field(strict=True, ge=1)] = 10


class Estimate(Table):
    """What the filter estimates beside the states it needs anyway, and how; `rate` in Hz."""

    parameters: dict[str, EstimatedParameter] = {}
    states: tuple[str, ...] = ()
    rate: Positive | None = None
    inputs: dict[str, EstimatedInput] = {}
    options: Options = Options()


class DataFile(Table):
    """`[data]`: the file, and options of the library that reads its format (of pandas.read_csv for CSV)."""

    model_config = ConfigDict(extra="allow", frozen=True)
    file: str | None = None


def _data(value: object) -> str | DataFile:
    if isinstance(value, str):
        return value
    if isinstance(value, dict):
        return DataFile.model_validate(value)
    raise ValueError(f"must be a file name in quotes, or a table {{file = ..., option = ...}}, not {value!r}")


class Plan(Table):
    """What `plan` assumes of a record that is not taken yet.

    ratio: size of the effects to be told apart, as rms of the residual over the noise where that is largest;
    power: probability with which they must be; noise_share: noise of outputs for which none is declared, as
    share of their rms; sensors: noise, in the FMU's unit, of outputs that could be measured, by default of
    all outputs of the FMU; inputs: those that may be changed, by default all of [inputs].
    """

    ratio: Positive = 1.0
    power: Share = 0.8
    noise_share: Positive = 0.01
    sensors: dict[str, Positive] = {}
    inputs: tuple[str, ...] | None = None


class Declaration(Table):
    """The keys of experiment.toml."""

    id: str
    model: str | None = None
    fmu: str | None = None
    data: Annotated[str | DataFile, PlainValidator(_data)] | None = None
    time: str
    time_unit: str | None = None
    split: Split | None = None
    parameters: dict[str, Number] = {}
    calibrate: dict[str, Interval] = {}
    initial: dict[str, Number] = {}
    inputs: dict[str, Channel] = {}
    outputs: Annotated[dict[str, Output], Field(min_length=1)]
    derived: dict[str, Derived] = {}
    ports: tuple[Port, ...] = ()
    estimate: Estimate | None = None
    plan: Plan = Plan()

    @property
    def data_file(self) -> str | None:
        """The one data file, if it is named."""
        return self.data.file if isinstance(self.data, DataFile) else self.data

    @property
    def data_options(self) -> dict[str, Any]:
        """Options of the library that reads the data, by name."""
        return dict(self.data.model_extra or {}) if isinstance(self.data, DataFile) else {}

    @property
    def input_columns(self) -> dict[str, InputColumn]:
        """The measured inputs; the others are constants."""
        named = {n: InputColumn(column=c) if isinstance(c, str) else c for n, c in self.inputs.items()}
        return {name: c for name, c in named.items() if isinstance(c, InputColumn)}

    @property
    def input_constants(self) -> dict[str, float]:
        """The inputs that are constant, in the FMU's unit."""
        return {name: c for name, c in self.inputs.items() if isinstance(c, float)}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for problem in _contradictions(self):
            raise ValueError(problem)
        return self


def _contradictions(d: Declaration) -> Iterator[str]:
    """What each key for itself does not show."""
    if (d.model is None) == (d.fmu is None):
        yield "needs exactly one of the keys 'model' and 'fmu'"
    if d.ports and d.model:
        yield "[[ports]] are for a foreign 'fmu' only; our own models have theirs"
    files = set(d.split.files.values()) if d.split else set()
    if not files and d.data_file is None:
        yield "key 'data' is missing" if d.data is None else "[data] has no key 'file'; name the data file"
    if files and d.data_file is not None and d.data_file not in files:
        yield "key 'data' beside [split] identify_data and test_data; leave one of the two out"
    made: set[str] = set()
    for name, derived in d.derived.items():
        if derived.derivative in d.derived and derived.derivative not in made:
            yield f"[derived.{name}] derivative '{derived.derivative}' must be declared above it"
        made.add(name)
    names = [port.name for port in d.ports]
    for name in sorted({n for n in names if names.count(n) > 1}):
        yield f"[[ports]] name '{name}' is used twice"
    unknown = d.estimate.inputs if d.estimate else {}
    for name in sorted(unknown.keys() & d.inputs.keys()):
        yield f"input '{name}' stands in [inputs] and in [estimate.inputs]; it is either known or estimated"
