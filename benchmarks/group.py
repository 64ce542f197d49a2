"""What a group of measurements is: it yields rows of the table, and curves of the figure."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

import benchmarks.groups
from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.models import MODELS
from fmus.registry import by_name, classes_in

BUILDS = {"native": build_native, "PythonFMU": build_python}


@dataclass(frozen=True)
class Row:
    """A measurement beside that of a peer from the same run.

    ours, value: of railfmi and of the peer, in `unit`; ratio: ours over the peer's; spread: quartiles of the
    ratio over the rounds, None for a single round; how: what was compared, in words. Without the peer, value
    and ratio are None and `how` says what is missing.
    """

    name: str
    ours: float
    peer: str
    value: float | None
    ratio: float | None
    unit: str
    how: str
    spread: tuple[float, float] | None = None


@dataclass(frozen=True)
class Curve:
    """Cost y against a number x, a line in a panel of the figure; label: what was measured, with unit."""

    panel: str
    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass(frozen=True)
class Work:
    """A folder for files, with the FMUs that several groups use; quick: few rounds of short runs."""

    folder: Path
    quick: bool = False
    _built: dict[tuple[str, str], Path] = field(default_factory=dict)

    def of(self, usual: int, quick: int) -> int:
        """A number of rounds or steps."""
        return quick if self.quick else usual

    def fmu(self, model: str, build: str = "native") -> Path:
        """A model's FMU, built when it is first needed; build: "native" or "PythonFMU"."""
        if (model, build) not in self._built:
            self._built[model, build] = BUILDS[build](MODELS[model](), self.folder / build)
        return self._built[model, build]


class Group(ABC):
    """Measurements that belong together; every file of benchmarks/groups defines one."""

    name: ClassVar[str]

    @abstractmethod
    def measure(self, work: Work) -> Iterator[Row | Curve]:
        """Measure, and yield each row and curve when it is known."""


def groups() -> dict[str, type[Group]]:
    """All groups by name."""
    return by_name(classes_in(benchmarks.groups, Group), "name")


def chosen(names: list[str]) -> list[type[Group]]:
    """Groups by name, all if none is given; raises BadInput for an unknown name."""
    known = groups()
    for name in names:
        if name not in known:
            raise BadInput(f"--only {name}: is no group of benchmarks; {did_you_mean(name, known)}")
    return [known[name] for name in names] if names else list(known.values())


class Disagreement(RuntimeError):
    """Ours and a peer computed different results, so that their times must not be compared."""


def agreed(ours: Array, peer: Array, share: float, what: str) -> None:
    """Raise Disagreement where results differ by more than a share of the largest value of their column."""
    size = np.abs(peer).max(axis=0) + 1e-300
    apart = float(np.max(np.abs(np.asarray(ours) - peer) / size))
    if not apart <= share:
        raise Disagreement(f"{what}: results differ by {apart:.2g} of the largest value, above {share:g}")
