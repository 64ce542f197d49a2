"""The [track] table of a scenario: a source, and the defects and sources added to it."""

from collections.abc import Mapping
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.validation import read_table
from scenarios.track.defects import DEFECTS
from scenarios.track.sources import SOURCES
from scenarios.track.sources.source import Source
from scenarios.track.track import Track

DEFECT = "defect"  # the kind of a table that has a shape


def read_track(table: Mapping[str, Any], folder: Path, key: str = "track") -> Track:
    """The track declared by a table; files are read relative to a folder.

    `key` is where the table stands in its file. Raises BadInput with one line for any error.
    """
    tables = _tables(table, key)
    return reduce(add, (_part(part, folder, place) for part, place in tables))


def read_source(table: Mapping[str, Any], key: str = "track") -> Source:
    """The source of a track that is not a defect, without the tables added to it."""
    return _source(_tables(table, key)[0][0], key)


def _tables(table: Mapping[str, Any], key: str) -> list[tuple[dict[str, Any], str]]:
    """The table itself and those added to it, each with its place in the file."""
    if not isinstance(table, Mapping):
        raise BadInput(f"key '{key}' must be a table, not {str(table)[:60]!r}")
    added = table.get("add", [])
    if not isinstance(added, list) or not all(isinstance(part, Mapping) for part in added):
        raise BadInput(f"key '{key}.add' must be one or more tables [[{key}.add]]")
    first = {name: value for name, value in table.items() if name != "add"}
    more = [({"kind": DEFECT, **part}, f"{key}.add[{i}]") for i, part in enumerate(added)]
    return [(first, key), *more]


def _part(table: dict[str, Any], folder: Path, key: str) -> Track:
    if table.get("kind") != DEFECT:
        source = _source(table, key)
        try:
            return source.track(folder)
        except BadInput as error:
            raise BadInput(f"[{key}] {error}") from error
    shape = _choice(table, "shape", DEFECTS, key)
    rest = {name: value for name, value in table.items() if name not in ("kind", "shape")}
    return Track((read_table(DEFECTS[shape], rest, key),))


def _source(table: dict[str, Any], key: str) -> Source:
    kind = _choice(table, "kind", {*SOURCES, DEFECT}, key)
    if kind == DEFECT:
        raise BadInput(f"[{key}] is a defect, which has no source")
    return read_table(SOURCES[kind], {k: v for k, v in table.items() if k != "kind"}, key)


def _choice(table: dict[str, Any], name: str, known: Any, key: str) -> str:
    """The value of a key, which must be one of the known names."""
    if name not in table:
        raise BadInput(f"key '{key}.{name}' is missing; known are {', '.join(sorted(known))}")
    chosen = table[name]
    if chosen not in [*known]:
        raise BadInput(
            f"key '{key}.{name}' = {str(chosen)[:60]!r} is not known; {did_you_mean(str(chosen), known)}"
        )
    return str(chosen)
