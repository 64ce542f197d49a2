"""The table of a fleet's records: which vehicle, where, at which mileage, and what is declared anew."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq

from fmus.errors import BadInput, did_you_mean
from fmus.taken import NUMBER, check_file, check_record
from scenarios.fleet.declaration import Declaration

NEEDED = ("record", "vehicle", "data")
KNOWN = (*NEEDED, "class", "place", "mileage", "setup")
DECLARED = ("parameters", "initial", "inputs")  # tables of an experiment; a column 'parameters.m1' is a key


@dataclass(frozen=True)
class FleetRecord:
    """A row of the table; data: its data file; declared: values in place of those of the setup.

    mileage: None where it is not known; setup: the only one that is run on it, "" for all.
    """

    id: str
    vehicle: str
    data: Path
    kind: str = ""
    place: str = ""
    mileage: float | None = None
    setup: str = ""
    declared: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def read_records(d: Declaration, file: Path) -> list[FleetRecord]:
    """The records of a table; paths are relative to its folder. BadInput names the row and the column."""
    table = _table(file)
    _check_columns(table, d, file)
    found: dict[str, FleetRecord] = {}
    for number, row in enumerate(table.to_dict("records"), 2):
        record = _record({str(k): v for k, v in row.items()}, file, f"{file} row {number}", d)
        if record.id in found:
            raise BadInput(f"{file} row {number}: record '{record.id}' occurs twice; give each its own name")
        found[record.id] = record
    if not found:
        raise BadInput(f"{file}: holds no records; give each a row")
    return [*found.values()]


def _table(file: Path) -> pd.DataFrame:
    check_file(file)
    try:
        if file.suffix == ".parquet":
            about = pq.read_metadata(file)
            check_record(file, NUMBER * about.num_rows * about.num_columns)
            table = pd.read_parquet(file)
            return table.astype(object).where(table.notna(), "").astype(str)
        return pd.read_csv(file, dtype=str, keep_default_na=False, skipinitialspace=True)
    except FileNotFoundError as error:
        raise BadInput(f"{file}: does not exist; name the table of records in key 'records'") from error
    except BadInput:
        raise
    except (OSError, ValueError) as error:  # also a parser's or Arrow's errors
        why = " ".join(str(error).split())[:200]
        raise BadInput(f"{file}: cannot be read as a table ({why}); write it as CSV or Parquet") from error


def _check_columns(table: pd.DataFrame, d: Declaration, file: Path) -> None:
    columns = [str(c) for c in table.columns]
    for name in NEEDED:
        if name not in columns:
            raise BadInput(f"{file}: column '{name}' is missing; each record needs {', '.join(NEEDED)}")
    for name in columns:
        head, _, key = name.partition(".")
        if name not in (*KNOWN, *d.ignore) and not (head in DECLARED and key):
            raise BadInput(
                f"{file}: column '{name}' is not known; {did_you_mean(name, KNOWN)} (or one as "
                "'parameters.NAME'); what has nothing to say here is listed in key 'ignore'"
            )


def _record(row: Mapping[str, str], file: Path, where: str, d: Declaration) -> FleetRecord:
    cells = {name: value.strip() for name, value in row.items()}
    for name in NEEDED:
        if not cells[name]:
            raise BadInput(f"{where}: column '{name}' is empty; fill it in")
    setup = cells.get("setup", "")
    if setup and setup not in d.setups:
        raise BadInput(f"{where}: there is no setup '{setup}'; {did_you_mean(setup, d.setups)}")
    declared: dict[str, dict[str, float]] = {}
    for name, text in cells.items():
        head, _, key = name.partition(".")
        if key and text and head in DECLARED:
            declared.setdefault(head, {})[key] = _number(text, f"{where}: column '{name}'")
    mileage = cells.get("mileage", "")
    return FleetRecord(
        cells["record"], cells["vehicle"], file.parent / cells["data"], cells.get("class", ""),
        cells.get("place", ""), _number(mileage, f"{where}: column 'mileage'") if mileage else None, setup,
        declared,
    )  # fmt: skip


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise BadInput(f"{where} holds '{text[:40]}', not a number; use a point for decimals and no words")
    return value


def with_record(table: Mapping[str, Any], record: FleetRecord) -> dict[str, Any]:
    """The experiment of a setup with a record's own values and data."""
    made = dict(table)
    for head, values in record.declared.items():
        made[head] = {**made.get(head, {}), **values}
    data = made.get("data")
    options = {k: v for k, v in data.items() if k != "file"} if isinstance(data, Mapping) else {}
    made |= {"id": record.id, "data": {**options, "file": str(record.data)} if options else str(record.data)}
    return made
