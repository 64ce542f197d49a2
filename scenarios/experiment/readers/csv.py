"""CSV files, with units in a file beside them, if any: those of data.csv in data.csv.units.json."""

import json
from collections.abc import Collection
from pathlib import Path
from typing import ClassVar

from fmus.errors import BadInput
from scenarios.experiment.csv_file import read_csv
from scenarios.experiment.readers.reader import Reader
from scenarios.experiment.readers.sheet import Sheet


class Csv(Reader):
    """CSV files; a row is identified by its line in the file, and the names are in line 1."""

    kind: ClassVar[str] = "CSV"
    suffixes: ClassVar[tuple[str, ...]] = (".csv",)

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None) -> Sheet:
        """All columns, up to the last row that is not blank."""
        cells = read_csv(file)
        return Sheet(file, cells, tuple(map(str, cells.columns)), _units(file), row="line", first=2)


def _units(file: Path) -> dict[str, str]:
    """Units by column from the file beside it, empty if there is none."""
    beside = file.with_name(file.name + ".units.json")
    try:
        units = json.loads(beside.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise BadInput(f"{beside}: cannot be read as JSON ({error}); correct it or remove it") from error
    if not isinstance(units, dict):
        raise BadInput(f'{beside}: must hold units by column, as {{"F": "N"}}; mend it or take it away')
    return {column: unit for column, unit in units.items() if isinstance(unit, str) and unit}
