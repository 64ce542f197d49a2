"""A measured benchmark: a model without the effect, an experiment file, and the conversion of its data."""

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
Columns = Mapping[str, Array]  # columns of a data file by name, (N,) each


@dataclass(frozen=True)
class Benchmark:
    """A measured record with a small model that lacks an effect of the record.

    model: the model, which is used as an FMU only; declaration: the experiment.toml; files: data files with
    the functions that convert their columns; missing: the missing effect according to the literature; known:
    kind and location of the library's effects that describe it; target: largest error after by output, in the
    FMU's unit, if one is set; rank: order by importance.
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
        """Write FMU, experiment.toml and converted data into a folder; returns the path of the experiment.

        Raises BadInput if a file is missing in the data folder.
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
    """The columns of a CSV file with names in its first line, (N,) each."""
    table = pd.read_csv(file)
    return {str(name): table[name].to_numpy(float) for name in table}


def of_held(name: str) -> Callable[[Columns], Columns]:
    """A conversion of a column that was held constant from sample to sample.

    Each sample becomes the mean of its value and the one before. An input acts over a step with the mean of
    its ends, so that unconverted samples would act half a step too early.
    """

    def convert(data: Columns) -> Columns:
        u = data[name]
        return {**data, name: (u + np.concatenate([u[:1], u[:-1]])) / 2}

    return convert


def as_they_are(data: Columns) -> Columns:
    """No conversion."""
    return data
