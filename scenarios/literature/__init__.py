"""Repeat estimates of the literature: one module for each row, found by its `ROW`."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from tempfile import TemporaryDirectory

from fmus.errors import BadInput, did_you_mean
from fmus.export.builders.native.build import build_native
from fmus.models import model_class
from scenarios.literature.case import Source, recorded
from scenarios.literature.outcome import Outcome
from scenarios.literature.row import Row, Tell
from scenarios.literature.twin import twin
from scenarios.output import writable

__all__ = ["ROWS", "Outcome", "Row", "run_row"]


def _rows() -> dict[str, Row]:
    found = {}
    for info in iter_modules(__path__, f"{__name__}."):
        row = getattr(import_module(info.name), "ROW", None)
        if isinstance(row, Row):
            found[row.name] = row
    return found


ROWS = _rows()


def run_row(
    name: str,
    out: Path,
    records: Path | Source | None = None,
    fmu: Path | None = None,
    cases: Sequence[str] | None = None,
    tell: Tell = lambda line: None,
) -> Outcome:
    """Run a row and write result.json, table.md and its figures to a folder.

    records: a folder with CASE.csv for each case, or a function that makes the records. By default the FMU,
    or a row whose equations are its own, simulates them. This proves less: model and truth are then the same.
    fmu: by default the row's model as a native build.
    cases: the cases to run, by default all.
    Raises BadInput if a row, a case or a record cannot be used.
    """
    if name not in ROWS:
        raise BadInput(f"row '{name}' is not known; {did_you_mean(name, ROWS)}")
    row = ROWS[name]
    known = {case.name: case for case in row.cases}
    for wanted in cases or ():
        if wanted not in known:
            raise BadInput(f"row {name}: has no case '{wanted}'; {did_you_mean(wanted, known)}")
    chosen = [known[wanted] for wanted in cases] if cases else list(row.cases)
    target = writable(out)
    with TemporaryDirectory(prefix="railfmi_row_") as folder:
        used = fmu or build_native(model_class(row.model)(), Path(folder))
        measured = []
        for case in chosen:
            tell(f"{case.name}: the record")
            measured.append((case, _source(records, row, used)(case)))
        outcome = row.rebuilt(measured, used, tell)
    outcome.write(target)
    return outcome


def _source(records: Path | Source | None, row: Row, fmu: Path) -> Source:
    if records is None:
        return row.simulated or twin(fmu)
    return recorded(records) if isinstance(records, Path) else records
