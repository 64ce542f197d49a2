"""Point files of profiles: two columns, mm, in the order of the measurement. Read and held against the rules.

Lines before the first numbers are a header; comments begin with # % ! " or //. Columns are parted by commas,
semicolons, tabs or blanks; where they are not parted by commas, a comma may be the decimal sign.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.geometry.profile import Kind
from fmus.errors import BadInput
from fmus.taken import check_text

COMMENT = re.compile(r'\s*(?:[#%!"]|//)')
FEWEST = 30  # points a profile needs
WIDTH = {"wheel": (0.07, 0.2), "rail": (0.04, 0.2)}  # m, how wide profiles are, with overhangs
UNITS = {"metres": 1000.0, "inches": 25.4, "centimetres": 10.0, "micrometres": 1e-3}  # mm


@dataclass(frozen=True)
class Points:
    """Measured points in the file's order and axes: y, z (n,), m; line: where each stands in the file."""

    file: str
    y: Array
    z: Array
    line: Array

    def part(self, which: slice | Array) -> "Points":
        """Some of the points."""
        return Points(self.file, self.y[which], self.z[which], self.line[which])


def read_points(path: str | Path, kind: Kind) -> Points:
    """The points of a file in metres; BadInput, one sentence with file and line, for what is no profile."""
    file = Path(path)
    check_text(file)
    try:
        text = file.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise BadInput(f"{file}: cannot be read ({error.strerror}); give the path of a point file") from error
    rows, lines = _rows(file, text)
    table = np.array(rows, dtype=float).reshape(-1, 2)
    if len(table) < FEWEST:
        raise BadInput(f"{file}: holds {len(table)} points, too few; a profile needs at least {FEWEST}")
    _check_unit(file, table, kind)
    return Points(str(file), table[:, 0] * 1e-3, table[:, 1] * 1e-3, np.array(lines, dtype=float))


def _rows(file: Path, text: str) -> tuple[list[list[float]], list[int]]:
    """The first two numbers of each line that has numbers, and the numbers of these lines."""
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or COMMENT.match(line):
            continue
        try:
            values = [float(cell) for cell in _cells(line)[:2]]
        except ValueError:
            if rows:
                raise BadInput(
                    f"{file}: line {number} is not two numbers ({line.strip()[:40]!r}); correct or remove it"
                ) from None
            continue  # of the header
        if len(values) < 2:
            raise BadInput(f"{file}: line {number} has one column; a profile needs two, y and z in mm")
        if not np.isfinite(values).all():
            raise BadInput(f"{file}: line {number} holds a number that is not finite; remove the line")
        rows.append(values)
        lines.append(number)
    return rows, lines


def _cells(line: str) -> list[str]:
    """The columns of a line, with points in the decimals."""
    line = line.strip()
    for separator in (";", "\t"):
        if separator in line:
            return [cell.strip().replace(",", ".") for cell in line.split(separator) if cell.strip()]
    blanks = line.split()
    if len(blanks) > 1 and not any(cell.endswith(",") or cell.startswith(",") for cell in blanks):
        return [cell.replace(",", ".") for cell in blanks]
    return [cell.strip() for cell in line.split(",") if cell.strip()]


def _check_unit(file: Path, table: Array, kind: Kind) -> None:
    """Refuse what is no profile in mm by its width, with the unit it would fit."""
    width = float(np.ptp(table[:, 0]))
    low, high = (1e3 * w for w in WIDTH[kind])
    if low <= width <= high:
        return
    for unit, size in UNITS.items():
        if low <= width * size <= high:
            raise BadInput(
                f"{file}: is {width:.4g} wide, which is no {kind} in mm and looks like {unit}; multiply both "
                f"columns by {size:g}"
            )
    if width < low:
        raise BadInput(f"{file}: is too short, {width:.4g} mm wide; a {kind} needs at least {low:g} mm")
    raise BadInput(f"{file}: is {width:.4g} mm wide, more than any {kind}; give y and z of a profile in mm")
