"""Files beside a data file that say how it is read: when one changes, its numbers mean something else."""

from pathlib import Path

from scenarios.experiment.readers.csv import Csv

UNITS = ".units.json"  # behind the whole name of a text file


def read_with(data: Path) -> list[Path]:
    """A data file, and those beside it that its reader looks for, whether they are there or not."""
    text = data.name.lower().endswith(Csv.suffixes)
    return [data, data.with_name(data.name + UNITS)] if text else [data]
