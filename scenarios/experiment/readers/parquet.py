"""Parquet files; a column's unit is its metadata `unit`."""

from collections.abc import Collection
from pathlib import Path
from typing import Any, ClassVar

from fmus.errors import BadInput
from fmus.taken import NUMBER, check_record
from scenarios.experiment.readers.reader import Reader, library
from scenarios.experiment.readers.sheet import Sheet

UNIT_KEYS = (b"unit", b"units")  # of a field's metadata; runs are recorded with the first


class Parquet(Reader):
    """Flat columns; an index that pandas stored is a column like any other."""

    kind: ClassVar[str] = "Parquet"
    suffixes: ClassVar[tuple[str, ...]] = (".parquet",)

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """Only the columns wanted are read from the disk."""
        parquet = library("pyarrow.parquet", "pyarrow", file)
        # what is read ahead takes as much memory as the columns
        with parquet.ParquetFile(file, **{"pre_buffer": False, **options}) as source:
            schema = source.schema_arrow
            twice = [name for name in schema.names if schema.names.count(name) > 1]
            if twice:
                raise BadInput(f"{file}: column '{twice[0]}' occurs twice; rename one")
            wanted = [name for name in schema.names if columns is None or name in columns]
            check_record(file, NUMBER * source.metadata.num_rows * len(wanted))
            cells = source.read(columns=wanted).to_pandas(
                ignore_metadata=True, split_blocks=True, self_destruct=True
            )
        # pyarrow keeps what it has freed
        library("pyarrow", "pyarrow", file).default_memory_pool().release_unused()
        units = {
            f.name: f.metadata[key].decode() for f in schema for key in UNIT_KEYS if key in (f.metadata or {})
        }
        return Sheet(file, cells, tuple(schema.names), units)
