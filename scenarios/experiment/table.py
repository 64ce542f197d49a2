"""What tables of declared files are made of: their class, and numbers and intervals with their limits."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, PlainValidator


def is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def interval_of(value: object) -> tuple[float, float]:
    if not (isinstance(value, list | tuple) and len(value) == 2 and all(map(is_number, value))):
        raise ValueError(f"must be two numbers [lower, upper], not {value!r}")
    if not value[0] < value[1]:
        raise ValueError(f"must increase, [lower, upper], not {list(value)}")
    return float(value[0]), float(value[1])


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Share = Annotated[float, Field(strict=True, gt=0, lt=1)]
Truth = Annotated[bool, Field(strict=True)]
Interval = Annotated[tuple[float, float], PlainValidator(interval_of)]


class Table(BaseModel):
    """A table of the file: its keys are the fields, no others."""

    model_config = ConfigDict(extra="forbid", frozen=True)
