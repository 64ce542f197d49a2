"""An experiment: measured data and what is declared about it, read from its experiment.toml.

The keys are those of the classes below; `load_experiment` turns a file into an Experiment, `check_names`
holds it against the FMU. All that is wrong with a file is a BadInput of one line.
"""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError, model_validator
from pydantic_core import ErrorDetails

from fmus.errors import BadInput, did_you_mean
from fmus.host.description import Causality, FmuDescription, FmuVariable
from fmus.models import model_class


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < float("inf")


def _interval(value: object) -> tuple[float, float]:
    if not (isinstance(value, list | tuple) and len(value) == 2 and all(map(_is_number, value))):
        raise ValueError(f"must be two numbers [lower, upper], not {value!r}")
    if not value[0] < value[1]:
        raise ValueError(f"must increase, [lower, upper], not {list(value)}")
    return float(value[0]), float(value[1])


def _column_or_number(value: object) -> str | float:
    if isinstance(value, str):
        return value
    if isinstance(value, int | float) and _is_number(value):
        return float(value)
    raise ValueError(f"must be a column name in quotes or a number, not {value!r}")


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
Interval = Annotated[tuple[float, float], PlainValidator(_interval)]
Channel = Annotated[str | float, PlainValidator(_column_or_number)]


class Table(BaseModel):
    """A table of the file: its keys are the fields, no others."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys_only(cls, table: Any) -> Any:
        for key in table if isinstance(table, dict) else ():
            if key not in cls.model_fields:
                raise ValueError(f"key '{key}' is not known; {did_you_mean(key, cls.model_fields)}")
        return table


class Split(Table):
    """Which data identify and which are held out: two windows [s] of one file, or two files."""

    identify: Interval | None = None
    test: Interval | None = None
    identify_data: str | None = None
    test_data: str | None = None

    @model_validator(mode="after")
    def _windows_or_files(self) -> Self:
        given = self.model_fields_set
        if given not in ({"identify", "test"}, {"identify_data", "test_data"}):
            raise ValueError("needs either 'identify' and 'test', or 'identify_data' and 'test_data'")
        if self.identify and self.test:
            first, second = sorted((self.identify, self.test))
            if second[0] < first[1]:
                raise ValueError(f"'identify' and 'test' overlap from {second[0]:g} s to {first[1]:g} s")
        return self


class Output(Table):
    """A measured output: its column, the column's unit, and the standard deviation of its noise in it."""

    column: str
    unit: str
    noise_std: Positive | None = None


class Derived(Table):
    """A column made from another one: its time derivative by central differences."""

    derivative: str


class Port(Table):
    """A location on a foreign FMU: a force input and the outputs conjugate to it."""

    name: str
    force: str
    velocity: str
    displacement: str | None = None


class EstimatedParameter(Table):
    """A parameter the filter estimates; start and bounds default to the declared and the FMU's."""

    start: Number | None = None
    std: Positive | None = None
    bounds: Interval | None = None


class EstimatedInput(Table):
    """An unknown input: a random process of that standard deviation about that frequency [Hz]."""

    std: Positive
    frequency: Positive
    rate_input: str | None = None


class Estimate(Table):
    """What the filter estimates beside the states it needs anyway; `rate` in Hz."""

    parameters: dict[str, EstimatedParameter] = {}
    states: tuple[str, ...] = ()
    rate: Positive | None = None
    inputs: dict[str, EstimatedInput] = {}


class Declaration(Table):
    """The keys of experiment.toml."""

    id: str
    model: str | None = None
    fmu: str | None = None
    data: str | None = None
    time: str
    split: Split | None = None
    parameters: dict[str, Number] = {}
    calibrate: dict[str, Interval] = {}
    initial: dict[str, Number] = {}
    inputs: dict[str, Channel] = {}
    outputs: Annotated[dict[str, Output], Field(min_length=1)]
    derived: dict[str, Derived] = {}
    ports: tuple[Port, ...] = ()
    estimate: Estimate | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for problem in _contradictions(self):
            raise ValueError(problem)
        return self


class Experiment(Declaration):
    """A declaration with its place: the file it was read from and the folder its data are read from."""

    file: Path
    data_dir: Path

    @property
    def folder(self) -> Path:
        """The folder of the experiment file."""
        return self.file.parent

    @property
    def fmu_path(self) -> Path | None:
        """The foreign FMU, relative to the experiment file."""
        return self.folder / self.fmu if self.fmu else None

    @property
    def data_files(self) -> tuple[Path, ...]:
        """One file, or that to identify and that to test."""
        if self.split and self.split.identify_data and self.split.test_data:
            return self.data_dir / self.split.identify_data, self.data_dir / self.split.test_data
        return (self.data_dir / (self.data or ""),)


def _contradictions(d: Declaration) -> Iterator[str]:
    """What each key for itself does not show."""
    if (d.model is None) == (d.fmu is None):
        yield "needs exactly one of the keys 'model' and 'fmu'"
    if d.ports and d.model:
        yield "[[ports]] are for a foreign 'fmu' only; our own models have theirs"
    files = {d.split.identify_data, d.split.test_data} - {None} if d.split else set()
    if not files and d.data is None:
        yield "key 'data' is missing"
    if files and d.data is not None and d.data not in files:
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
    for name in unknown.keys() & d.inputs.keys():
        yield f"input '{name}' stands in [inputs] and in [estimate.inputs]; it is either known or estimated"


def load_experiment(path: str | Path, data_dir: str | Path | None = None) -> Experiment:
    """The experiment in a file; data are read from `data_dir`, by default the file's own folder.

    Raises BadInput, one line that names the file, the key and the way out.
    """
    file = Path(path)
    try:
        with file.open("rb") as stream:
            raw = tomllib.load(stream)
        declared = Declaration.model_validate(raw)
        if declared.model is not None:
            model_class(declared.model)
    except OSError as error:
        raise BadInput(
            f"{file}: cannot be read ({error.strerror}); give the path of an experiment.toml"
        ) from error
    except UnicodeDecodeError as error:
        raise BadInput(f"{file}: is not UTF-8 text; save it as UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{file}: is not valid TOML: {str(error).lower()}") from error
    except ValidationError as error:
        raise BadInput(f"{file}: {_one_line(error)}") from None
    except BadInput as error:
        raise BadInput(f"{file}: key 'model': {error}") from error
    place = {"file": file, "data_dir": file.parent if data_dir is None else Path(data_dir)}
    return Experiment.model_construct(**dict(declared), **place)


def _one_line(error: ValidationError) -> str:
    """The first problem of a validation in one sentence, and how many more there are."""
    problems = error.errors()
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return _sentence(problems[0]) + more


def _sentence(problem: ErrorDetails) -> str:
    key = ".".join(str(part) for part in problem["loc"])
    kind, value, message = problem["type"], problem["input"], problem["msg"]
    if kind == "value_error":
        ours = str(problem["ctx"]["error"])
        table = isinstance(value, dict | Table)
        return ours if not key else f"[{key}] {ours}" if table else f"key '{key}' {ours}"
    if kind == "missing":
        return f"key '{key}' is missing"
    if kind in ("dict_type", "model_type"):
        return f"key '{key}' must be a table, not {value!r}"
    if key == "outputs":
        return "needs at least one table [outputs.NAME]"
    said = message.replace("Input should", "must").replace("a valid ", "a ")
    return f"key '{key}' {said}, not {value!r}"
