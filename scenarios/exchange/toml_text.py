"""Writes plain tables as TOML, which Python's own library only reads."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(table: Mapping[str, Any]) -> str:
    """A table of numbers, truths, strings, lists and tables as a TOML document; None is left out."""
    return "\n".join(_lines(table, "")) + "\n"


def _lines(table: Mapping[str, Any], path: str) -> Iterator[str]:
    """Values first, then each table under a heading of its own."""
    given = {k: v for k, v in table.items() if v is not None}
    for key, value in given.items():
        if not _has_heading(value):
            yield f"{_key(key)} = {_value(value)}"
    for key, value in given.items():
        full = f"{path}.{_key(key)}" if path else _key(key)
        if isinstance(value, Mapping):
            yield from ("", f"[{full}]", *_lines(value, full))
        elif _has_heading(value):
            for entry in value:
                yield from ("", f"[[{full}]]", *_lines(entry, full))


def _has_heading(value: Any) -> bool:
    tables = isinstance(value, Sequence) and value and all(isinstance(entry, Mapping) for entry in value)
    return isinstance(value, Mapping) or bool(tables)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items() if v is not None)
        return f"{{{inner}}}"
    if isinstance(value, Sequence):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    return repr(value)


def _key(key: str) -> str:
    return key if BARE.fullmatch(key) else _value(key)
