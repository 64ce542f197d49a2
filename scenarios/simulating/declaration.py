"""The keys of a scenario file: one class for each table, one field for each key."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import AliasChoices, Field, model_validator

from fmus.contact.forces.conditions import Condition
from scenarios.experiment.table import Interval, Number, Positive, Table

Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
FileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
Whole = Annotated[int, Field(strict=True, ge=0)]


class Member(Table):
    """An FMU: a file, or built from one of our models or from a PythonFMU source.

    options: values of the model's build options, which may also stand in the key 'contact'.
    friction: a row of the thesis's Table 4.1; values in `parameters` replace those of the row.
    step: communication step in s, if it differs from the common step.
    """

    model: str | None = None
    source: str | None = None
    fmu: str | None = None
    effects: tuple[str, ...] = ()
    options: dict[str, str | Number] = Field(
        default_factory=dict, validation_alias=AliasChoices("options", "contact")
    )
    kind: Literal["python", "native"] = "python"
    friction: Condition | None = None
    parameters: dict[str, Number] = Field(default_factory=dict)
    initial: dict[str, Number] = Field(default_factory=dict)
    step: Positive | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if [self.model, self.source, self.fmu].count(None) != 2:
            raise ValueError("needs exactly one of the keys 'model', 'source' and 'fmu'")
        if self.model is None and (self.effects or self.options or self.kind != "python"):
            raise ValueError("has 'effects', 'options' or 'kind', which go with 'model' only")
        return self


class Wire(Table):
    """A connection; see fmus.host.master.connections.Connection."""

    source: str = Field(alias="from")
    target: str = Field(alias="to")
    gain: Number = 1.0
    offset: Number = 0.0
    gain_unit: str = "1"
    delayed: bool = False


class Ride(Table):
    """The FMUs that run over the track, with their geometry, the model that they follow, and the speed.

    V: speed in m/s, a number or {times, speeds}.
    """

    V: Any
    on: Annotated[dict[Name, dict[str, str | Number]], Field(min_length=1)]


class Moment(Table):
    """Parameters that change at a time in s; friction: the new condition of an FMU's contact."""

    time: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
    set: dict[str, Number] = Field(default_factory=dict)
    friction: dict[Name, Condition] = Field(default_factory=dict)


class Recorded(Table):
    """The recording: names 'fmu.variable' (by default all outputs), interval in s, and file format."""

    names: tuple[str, ...] | None = None
    step: Positive | None = None
    format: Literal["parquet", "csv"] = "parquet"


class Geometry(Table):
    """A contact table over the lateral shift, instead of FMUs; see fmus.contact.contact_table."""

    wheel: str = "S1002"
    rail: str = "60E1"
    cant: Number = 1 / 40
    gauge: Positive = 1.435
    r0: Positive = 0.46
    N: Positive = 55e3
    search: str = "quasi_elastic"
    patch: str = "hertz"
    reach: Positive = 0.01
    points: Annotated[int, Field(strict=True, ge=3)] = 401


class Expectation(Table):
    """A statement that must be true, and the reason; for some variants, or for each if none is named."""

    that: str
    because: str
    variants: tuple[Name, ...] = ()


class Panel(Table):
    """Curves on common axes: expressions over x, shown in the units of the axes."""

    draw: Annotated[tuple[str, ...], Field(min_length=1)]
    names: tuple[str, ...] = ()
    label: str
    unit: str | None = None
    x: str | None = None
    x_label: str | None = None
    x_unit: str | None = None
    window: Interval | None = None
    height: Positive = 1.0
    variants: tuple[Name, ...] = ()

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.names and len(self.names) != len(self.draw):
            raise ValueError(f"has {len(self.names)} 'names' for {len(self.draw)} curves; give one each")
        if (self.x is None) != (self.x_label is None):
            raise ValueError("'x' and 'x_label' go together")
        return self


class Picture(Table):
    """A figure: panels below one another."""

    name: FileName
    title: str
    panels: Annotated[tuple[Panel, ...], Field(min_length=1)]


class Declaration(Table):
    """The keys of a scenario file; keys in `variants` replace these keys for one variant."""

    id: FileName
    question: str
    duration: Positive | None = None
    step: Positive | None = None
    order: Literal["jacobi", "gauss_seidel"] = "jacobi"
    extrapolation: Literal["hold", "linear"] = "hold"
    seed: Whole = 0
    fmus: dict[Name, Member] = Field(default_factory=dict)
    connections: tuple[Wire, ...] = ()
    track: dict[str, Any] | None = None
    ride: Ride | None = None
    inputs: dict[str, Any] = Field(default_factory=dict)
    events: tuple[Moment, ...] = ()
    sensors: dict[str, Any] = Field(default_factory=dict)
    record: Recorded = Recorded()
    contact: Geometry | None = None
    variants: tuple[dict[str, Any], ...] = ()
    expect: Annotated[tuple[Expectation, ...], Field(min_length=1)]
    figure: tuple[Picture, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for problem in _contradictions(self):
            raise ValueError(problem)
        return self


MOTION = ("fmus", "connections", "track", "ride", "inputs", "events", "sensors", "duration", "step")


def _contradictions(d: Declaration) -> Iterator[str]:
    """Check conditions that involve several keys."""
    given = [key for key in MOTION if key in d.model_fields_set]
    if d.contact and given:
        yield f"[contact] is a table without motion, but key '{given[0]}' needs FMUs; remove one of the two"
    if not d.contact:
        for key in ("fmus", "duration", "step"):
            if key not in d.model_fields_set:
                yield f"key '{key}' is missing"
    if (d.track is None) != (d.ride is None):
        yield "[track] and [ride] need each other; give both or neither"
    names = [p.name for p in d.figure]
    for name in sorted({n for n in names if names.count(n) > 1}):
        yield f"[[figure]] name '{name}' is used twice"
