"""Excel files: names in the first row of a worksheet, units in brackets or in the row below them."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, ClassVar
from zipfile import ZipFile

import pandas as pd

from fmus.errors import BadInput
from fmus.taken import NUMBER, check_packed, check_record
from scenarios.experiment.readers.header import is_line_of_units, units_in_line
from scenarios.experiment.readers.reader import Reader, library
from scenarios.experiment.readers.sheet import Sheet


class Excel(Reader):
    """One worksheet, the first by default; options are those of pandas.read_excel, as `sheet_name`."""

    kind: ClassVar[str] = "Excel"
    suffixes: ClassVar[tuple[str, ...]] = (".xlsx", ".xlsm")

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """All columns of the worksheet, without rows that are blank at its end."""
        _check_size(library("openpyxl", "openpyxl", file), file, options)
        above = int(options.get("skiprows", 0))
        cells: pd.DataFrame = pd.read_excel(file, **{"engine": "openpyxl", **options})
        cells.columns = pd.Index([str(name).strip() for name in cells.columns])
        names = [str(name) for name in cells.columns]
        wanted = {*names} if columns is None else {time, *columns}
        if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1 and name in wanted]:
            raise BadInput(f"{file} row {above + 1}: column '{twice[0]}' occurs twice; rename one")
        if cells.dropna(how="all").empty:
            raise BadInput(f"{file}: has no data below row {above + 1}; record some")
        top = ["" if pd.isna(cell) else str(cell) for cell in cells.iloc[0]]
        units = top if len(cells) > 1 and is_line_of_units(top) else []
        if units:
            cells = cells.iloc[1:].infer_objects()
        last = int(cells.notna().any(axis=1).to_numpy().nonzero()[0][-1]) + 1
        known = units_in_line(names, units)
        return Sheet(file, cells.iloc[:last], tuple(names), known, first=above + 2 + bool(units))


def _check_size(openpyxl: Any, file: Path, options: Mapping[str, Any]) -> None:
    """Raise BadInput for a worksheet too large; one cell far out makes as many as lie before it."""
    with ZipFile(file) as packed:
        check_packed(packed, file)
    with closing(openpyxl.load_workbook(file, read_only=True, data_only=True)) as book:
        for worksheet in _chosen(book, options.get("sheet_name", 0)):
            worksheet.reset_dimensions()  # which the file states, and which need not be so
            widest = 0
            for number, row in enumerate(worksheet.iter_rows(values_only=True), 1):
                widest = max(widest, len(row))
                check_record(file, NUMBER * number * widest)


def _chosen(book: Any, which: object) -> Iterator[Any]:
    """The worksheets that pandas would read; none for a name that is not there, which it tells itself."""
    for i, worksheet in enumerate(book.worksheets):
        if which is None or which in (i, worksheet.title):
            yield worksheet
