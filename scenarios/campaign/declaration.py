"""The keys of a campaign file: one class for each table, one field for each key."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from scenarios.experiment.table import Number, Positive, Table
from scenarios.simulating.declaration import FileName, Name, Whole


class Range(Table):
    """What a key of the scenario is varied over.

    low, high: uniform between them, or with scale = "log" uniform in the logarithm; with whole = true whole
    numbers from low to high, for seeds; mean, std: a normal distribution; values: a choice among these, also
    lists and tables; points: how many of low to high a grid has.
    """

    low: Number | None = None
    high: Number | None = None
    scale: Literal["linear", "log"] = "linear"
    whole: bool = False
    mean: Number | None = None
    std: Positive | None = None
    values: Annotated[tuple[Any, ...], Field(min_length=1)] | None = None
    points: Annotated[int, Field(strict=True, ge=2)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        for problem in self._contradictions():
            raise ValueError(problem)
        return self

    def _contradictions(self) -> Iterator[str]:
        ways = [self.low is not None or self.high is not None, self.mean is not None or self.std is not None]
        if [*ways, self.values is not None].count(True) != 1:
            yield "needs either 'low' and 'high', or 'mean' and 'std', or 'values'"
        if ways[0]:
            if self.low is None or self.high is None or not self.low < self.high:
                yield "needs 'low' and 'high', the first the smaller one"
            elif self.scale == "log" and self.low <= 0:
                yield f"'low' = {self.low:g} has no logarithm; give one above 0, or scale = \"linear\""
            elif self.whole and not (float(self.low).is_integer() and float(self.high).is_integer()):
                yield "'whole' goes with whole numbers 'low' and 'high'"
            elif self.whole and (self.points or self.scale == "log"):
                yield "'whole' takes each whole number from 'low' to 'high', without 'points' and 'scale'"
        if ways[1] and (self.mean is None or self.std is None):
            yield "needs 'mean' and 'std'"


class Declaration(Table):
    """The keys of a campaign file; the path of the scenario is relative to its folder.

    sample: how points are placed. "grid": all combinations; "latin-hypercube": `n` points, one in each n-th
    of every range; "sobol": `n` base points, a power of two, and n (k + 2) simulations for Sobol's indices of
    k varied keys. vary: by the key of the scenario, as TOML writes it; set: keys with one value at all
    points; measure: by name, a formula over the signals whose value is a number; variant: of the
    scenario, if it has some.
    """

    id: FileName
    scenario: str
    sample: Literal["grid", "latin-hypercube", "sobol"] = "sobol"
    n: Annotated[int, Field(strict=True, ge=1)] | None = None
    seed: Whole = 0
    variant: str | None = None
    vary: Annotated[dict[str, Range], Field(min_length=1)]
    set: dict[str, Any] = Field(default_factory=dict)
    measure: Annotated[dict[Name, str], Field(min_length=1)]

    @model_validator(mode="after")
    def _size(self) -> Self:
        for problem in self._contradictions():
            raise ValueError(problem)
        return self

    def _contradictions(self) -> Iterator[str]:
        if self.sample == "grid":
            if self.n is not None:
                yield "'n' is not for a grid, whose size follows from 'values' and 'points'"
            for key, r in self.vary.items():
                if r.values is None and not r.whole and (r.points is None or r.mean is not None):
                    yield f"[vary] '{key}' needs 'values', or 'low', 'high' and 'points', in a grid"
        elif self.n is None:
            yield f"key 'n' is missing; sample = \"{self.sample}\" needs it"
        elif self.sample == "sobol" and (self.n < 2 or self.n & (self.n - 1)):
            yield f"'n' = {self.n} is no power of two, by which alone Sobol's points are balanced"
