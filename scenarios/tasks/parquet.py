"""Tables in Parquet files; the same rows give the same bytes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

ROWS = 100_000  # of a file
EMPTY = "__HIVE_DEFAULT_PARTITION__"  # how readers of partitioned files call a missing value
Row = Mapping[str, Any]


def write_table(file: Path, rows: Sequence[Row], schema: pa.Schema) -> None:
    """Write rows in their order to one file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    table = pa.Table.from_pylist(list(rows), schema=schema)
    pq.write_table(table, file, compression="zstd", use_dictionary=True, version="2.6")


def write_parts(folder: Path, rows: Sequence[Row], schema: pa.Schema, by: str) -> None:
    """Write rows in their order to `folder`/BY=VALUE/part-N.parquet.

    schema: names and types of all columns, `by` too, which the names of the folders hold in place of the
    files, as Hive does.
    """
    inside = pa.schema([field for field in schema if field.name != by])
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(str(row[by]) or EMPTY, []).append(row)
    for value, members in groups.items():
        for at, first in enumerate(range(0, len(members), ROWS)):
            file = folder / f"{by}={quote(value, safe='')}" / f"part-{at}.parquet"
            write_table(file, members[first : first + ROWS], inside)
