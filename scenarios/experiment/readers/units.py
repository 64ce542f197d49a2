"""Compare the units that a file states for its columns with the units declared for them."""

from math import isclose
from types import MappingProxyType

import numpy as np

from estimator.record import Array, Note
from fmus.errors import BadInput
from fmus.units import base_exponents, column_conversion, conversion
from scenarios.experiment.readers.sheet import Sheet

# usual in measured files, but not in the grammar of units
SPELLINGS = MappingProxyType(
    {"-": "1", "Nm": "N.m", "kNm": "kN.m", "°C": "degC", "U/min": "rpm", "1/min": "rpm", "sec": "s"}
)
SAME = (1.0, 0.0)  # factor and offset


class StatedUnits:
    """The units that a file states; notes on conversions are appended to `notes`."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._file = sheet.file
        self.notes: list[Note] = []

    def check(self, column: str, derived: int, declared: str, where: str) -> None:
        """Raise BadInput if the file contradicts the unit declared at `where` for a measured output.

        derived: how many times the column is differentiated to become the output.
        """
        if not derived and self._sheet.units.get(column) == declared:
            return
        stated = self._known(column, f"it is taken as {declared}, as declared")
        if stated is None:
            return
        for _ in range(derived):
            stated = f"({stated})/s"
        try:
            found = conversion(stated, declared, where)
        except BadInput:
            found = None
        if found is None or not (isclose(found[0], 1.0, rel_tol=1e-9) and found[1] == 0):
            raise BadInput(
                f"{where} unit = \"{declared}\", but {self._file} states '{stated}' for it; "
                f'write unit = "{stated}", or correct the file'
            )

    def to(self, column: str, target: str | None, where: str, derived: int = 0) -> tuple[float, float]:
        """Factor and offset from the file's unit to another; identity if the file states no known unit.

        derived: how many times the column is differentiated before. Raises BadInput if the units cannot be
        converted, or if a unit is stated but there is no unit to convert to.
        """
        stated = self._known(column, f"it is taken as {target or 'it is'}")
        if stated is None:
            return SAME
        for _ in range(derived):
            stated = f"({stated})/s"
        place = f"{where}: column '{column}' of {self._file}"
        found = column_conversion(stated, target, "the input", place)
        if found != SAME:
            said = f"{self._file.name}: column '{column}' is converted from {stated}, as the file states"
            self.notes.append(Note("unit", column, f"{said}, to {target}"))
        return found

    def seconds(self, column: str, where: str) -> Array:
        """The time column (N,) s: dates count from the first one, numbers are in the unit stated, else s."""
        cells = self._sheet.cells[column]
        if cells.dtype.kind == "M":
            said = f"{self._file.name}: column '{column}' holds dates; 0 s is {cells.min()}"
            self.notes.append(Note("unit", column, said))
            cells = cells - cells.min()
        if cells.dtype.kind == "m":
            return np.asarray(cells.dt.total_seconds(), dtype=np.float64)
        factor, offset = self.to(column, "s", where)
        return self._sheet.numbers(column) * factor + offset

    def _known(self, column: str, instead: str) -> str | None:
        """The unit stated in the file, in railfmi's spelling; an unknown unit causes a note."""
        unit = self._sheet.units.get(column, "").strip()
        unit = SPELLINGS.get(unit, unit)
        if not unit:
            return None
        try:
            base_exponents(unit)
        except BadInput:
            said = (
                f"{self._file.name}: column '{column}' has the unit '{unit}', which is not known; {instead}"
            )
            self.notes.append(Note("unit", column, said))
            return None
        return unit
