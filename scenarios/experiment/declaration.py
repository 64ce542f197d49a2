"""What an experiment.toml may say: one class a table, one field a key."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Self

from pydantic import AfterValidator, ConfigDict, Field, PlainValidator, model_validator

from scenarios.experiment.estimated import Estimate
from scenarios.experiment.table import Interval, Number, Positive, Share, Table, Truth, is_number


def key_of(column: str, file: str | None) -> str:
    """How a column is called within an experiment: with its file, if it is one of [files]."""
    return f"{file}: {column}" if file else column


def _a_name(value: str) -> str:
    if not value.strip() or not value.isprintable():
        raise ValueError("must be a name in one line, not an empty one")
    return value


def _not_zero(value: float) -> float:
    if value == 0:
        raise ValueError("must not be 0, with which every value would be the same")
    return value


class Measured(Table):
    """A column of the record, or of one of [files]; what is measured is scale * column + offset."""

    column: str
    file: str | None = None
    scale: Annotated[Number, AfterValidator(_not_zero)] = 1.0
    offset: Number = 0.0

    @property
    def key(self) -> str:
        """See key_of."""
        return key_of(self.column, self.file)

    @property
    def is_scaled(self) -> bool:
        """Whether its unit is that of the scaled value, and not of the column in the file."""
        return (self.scale, self.offset) != (1.0, 0.0)

    def converted(self, factor: float, offset: float) -> tuple[float, float]:
        """Factor and offset from the column, where these convert what is measured."""
        return factor * self.scale, factor * self.offset + offset


class InputColumn(Measured):
    """A measured input: its column, its unit, and the FMU's where the FMU states none.

    Without `unit` the column has the unit that the file states, else that of the FMU; a scaled one always has
    that of the FMU then. noise_std: standard deviation of its white noise, in its unit.
    """

    unit: str | None = None
    model_unit: str | None = None
    noise_std: Positive | None = None


def _column_or_number(value: object) -> str | float | InputColumn:
    if isinstance(value, str):
        return value
    if isinstance(value, int | float) and is_number(value):
        return float(value)
    if isinstance(value, dict):
        return InputColumn.model_validate(value)
    raise ValueError(
        "must be a column name in quotes or a number, or a table {column, unit, model_unit, file, scale, "
        "offset, noise_std}, "
        f"not {value!r}"
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


class Output(Measured):
    """A measured output: its column, its unit, and the standard deviation of its noise in that.

    model_unit: the FMU's unit, to be said where the FMU states none; the column is converted to it.
    """

    unit: str
    model_unit: str | None = None
    noise_std: Positive | None = None


class Derived(Table):
    """A column made from another one: its time derivative by central differences."""

    derivative: str
    file: str | None = None

    @property
    def key(self) -> str:
        """The column that it is made from, see key_of."""
        return key_of(self.derivative, self.file)


class Port(Table):
    """A location on a foreign FMU: a force input and the outputs conjugate to it.

    Without a displacement, only laws over velocity and time are tried there. integrate: whether it is
    integrated from the velocity, from 0 at the start of a simulation, since no output gives it.
    """

    name: str
    force: str
    velocity: str
    displacement: str | None = None
    integrate: Truth = False

    @model_validator(mode="after")
    def _integrated_or_given(self) -> Self:
        if self.integrate and self.displacement is not None:
            raise ValueError("has a displacement, so 'integrate' is not needed; leave one of the two out")
        return self


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


class OtherClock(Table):
    """`[files.NAME]`: channels of the same run with times of their own; options as in [data].

    file: by default that of the record itself, in which they have another time column. offset: s, is added
    to their times, which then are those of the record.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    file: str | None = None
    time: str
    time_unit: str | None = None
    offset: Number = 0.0

    @property
    def options(self) -> dict[str, Any]:
        """Options of the library that reads the file, by name."""
        return dict(self.model_extra or {})


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
    sensors: dict[str, Positive] = Field(default_factory=dict)
    inputs: tuple[str, ...] | None = None


class Declaration(Table):
    """The keys of experiment.toml.

    rate: Hz, to which a record is thinned, behind a low-pass filter; by default all its rows are used.
    """

    id: Annotated[str, AfterValidator(_a_name)]
    model: str | None = None
    fmu: str | None = None
    data: Annotated[str | DataFile, PlainValidator(_data)] | None = None
    time: str
    time_unit: str | None = None
    rate: Positive | None = None
    files: dict[str, OtherClock] = Field(default_factory=dict)
    split: Split | None = None
    parameters: dict[str, Number] = Field(default_factory=dict)
    calibrate: dict[str, Interval] = Field(default_factory=dict)
    initial: dict[str, Number] = Field(default_factory=dict)
    inputs: dict[str, Channel] = Field(default_factory=dict)
    outputs: Annotated[dict[str, Output], Field(min_length=1)]
    derived: dict[str, Derived] = Field(default_factory=dict)
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
    yield from _wrong_files(d)
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


def _wrong_files(d: Declaration) -> Iterator[str]:
    """Channels of files that are not declared, and files that cannot go with the split."""
    named = {f"[inputs] {name}": c.file for name, c in d.input_columns.items()}
    named |= {f"[outputs.{name}]": o.file for name, o in d.outputs.items()}
    named |= {f"[derived.{name}]": c.file for name, c in d.derived.items()}
    for where, file in named.items():
        if file is not None and file not in d.files:
            known = f"they are {', '.join(d.files)}" if d.files else "add [files.NAME] with its file and time"
            yield f"{where} file = '{file}' is none of [files]; {known}"
    for name, other in d.files.items():
        if other.file is not None and d.split and d.split.files:
            yield (
                f"[files.{name}] file = '{other.file}' beside [split] with files of its own; give the parts "
                "as windows of one record in seconds"
            )
