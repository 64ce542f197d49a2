"""What a measured benchmark is: a base model without the effect, an experiment, and where its data lie."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from fmus.errors import BadInput
from fmus.export.builders.native.build import build_native
from fmus.model import Model

Array = NDArray[np.float64]
Columns = Mapping[str, Array]  # of a data file, by name, (N,) each


@dataclass(frozen=True)
class Benchmark:
    """A measured record with a model of a few lines that knows nothing of what the record shows.

    model: the base; it is used through its FMU alone. declaration: the experiment.toml; files: of the data
    folder, with what makes the columns that the experiment names from those there. missing: what the
    literature says that the base lacks; known: the effects (kind, location) of the library that stand for it;
    target: the largest error after, by output, in the FMU's unit, where one was set. rank: of importance.
    """

    name: str
    title: str
    model: type[Model]
    declaration: Path
    files: Mapping[str, Callable[[Columns], Columns]]
    missing: str
    known: frozenset[tuple[str, str]]
    source: str
    target: Mapping[str, float]
    rank: int

    def missing_files(self, data: Path) -> list[str]:
        """Files that are not in the data folder."""
        return [name for name in self.files if not (data / name).is_file()]

    def prepare(self, data: Path, work: Path) -> Path:
        """Write base FMU, experiment.toml and converted data into a folder; the path of the experiment.

        Raises BadInput where the data folder lacks a file.
        """
        absent = self.missing_files(data)
        if absent:
            raise BadInput(f"{data}: {absent[0]} of {self.title} is not there; name the folder with the data")
        work.mkdir(parents=True, exist_ok=True)
        build_native(self.model(), work)
        for name, convert in self.files.items():
            made = convert(columns(data / name))
            pd.DataFrame(dict(made)).to_csv(work / name, index=False, float_format="%.12g")
        experiment = work / "experiment.toml"
        experiment.write_bytes(self.declaration.read_bytes())
        return experiment


def columns(file: Path) -> Columns:
    """The columns of a CSV file with names in line 1, (N,) each."""
    table = pd.read_csv(file)
    return {str(name): table[name].to_numpy(float) for name in table}


def of_held(name: str) -> Callable[[Columns], Columns]:
    """Makes of a column that is held from sample to sample the samples of its staircase.

    At a jump that is the mean of both sides. The means of neighbours, which act over a step, are then
    centred on what was held; as they are they would come half a step early.
    """

    def convert(data: Columns) -> Columns:
        u = data[name]
        return {**data, name: (u + np.concatenate([u[:1], u[:-1]])) / 2}

    return convert


def as_they_are(data: Columns) -> Columns:
    """No conversion."""
    return data
