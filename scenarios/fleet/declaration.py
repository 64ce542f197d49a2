"""The keys of a fleet file: one class for each table, one field for each key."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from scenarios.experiment.table import Table

CALIBRATED = "calibrated"  # kind of the rows of a parameter that close-loop has calibrated
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$")]
Command = Literal["check", "estimate", "close-loop"]
Whole = Annotated[int, Field(strict=True, ge=0)]


class Model(Table):
    """A model that takes the place of the one that a setup's experiment names: an FMU, or one of ours."""

    model: str | None = None
    fmu: str | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if (self.model is None) == (self.fmu is None):
            raise ValueError("needs exactly one of the keys 'model' and 'fmu'")
        return self


class Setup(Table):
    """What is done with each record.

    experiment: an experiment.toml whose data each record replaces; commands: what is run; models: names of
    [models], by default all of them, or the experiment's own model if there are none.
    triage: close-loop only on records that estimate rejects, those on which its filter fails a test or
    diverges.
    """

    experiment: str
    commands: Annotated[tuple[Command, ...], Field(min_length=1)] = ("close-loop",)
    models: tuple[Name, ...] = ()
    seed: Whole = 0
    triage: bool = False

    @model_validator(mode="after")
    def _triage_needs_both(self) -> Self:
        if self.triage and not {"estimate", "close-loop"} <= {*self.commands}:
            raise ValueError("'triage' needs both commands, 'estimate' and 'close-loop'")
        return self


class Declaration(Table):
    """The keys of a fleet file; the paths in it are relative to its folder.

    records: a table of the records, CSV or Parquet; ignore: columns of it that have nothing to say here.
    level: rate of false alarms among all that is said to drift, change or deviate.
    """

    id: str
    records: str
    setups: Annotated[dict[Name, Setup], Field(min_length=1)]
    models: dict[Name, Model] = Field(default_factory=dict)
    ignore: tuple[str, ...] = ()
    mileage_unit: str = "km"
    level: Annotated[float, Field(strict=True, gt=0, lt=1)] = 0.05
