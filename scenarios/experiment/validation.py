"""Reads a declared file or table into its class; any error is a BadInput of one line."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from fmus.errors import BadInput, did_you_mean
from fmus.taken import check_text
from scenarios.experiment.table import Table

T = TypeVar("T", bound=Table)

# the messages for problems, by pydantic's name
SAID = MappingProxyType(
    {
        "dict_type": "must be a table",
        "model_type": "must be a table",
        "tuple_type": "must be a list",
        "int_type": "must be a whole number",
        "too_short": "must hold at least one entry",
        "string_pattern_mismatch": "must begin with a letter or digit and hold letters, digits, _ . - only",
        "bool_type": "must be true or false",
    }
)


def read_toml(file: Path, kind: str) -> dict[str, Any]:
    """The top table of a TOML file; `kind` is the word for the file in messages, "an experiment.toml"."""
    check_text(file)
    try:
        return tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise BadInput(f"{file}: cannot be read ({error.strerror}); give the path of {kind}") from error
    except UnicodeDecodeError as error:
        raise BadInput(f"{file}: is not UTF-8 text; save it as UTF-8") from error
    except RecursionError as error:
        raise BadInput(f"{file}: its tables are nested too deeply; write them flatter") from error
    except ValueError as error:  # TOMLDecodeError, or a number too long for Python
        raise BadInput(f"{file}: is not valid TOML: {error}") from error


def read_file(cls: type[T], file: Path, kind: str) -> T:
    """A whole TOML file as an object of its class."""
    with of_file(file):
        return read_table(cls, read_toml(file, kind))


@contextmanager
def of_file(file: Path) -> Iterator[None]:
    """Add the name of the file to errors about its content."""
    try:
        yield
    except BadInput as error:
        said = str(error)
        raise BadInput(said if said.startswith(f"{file}: ") else f"{file}: {said}") from error


def read_table(cls: type[T], table: object, key: str = "") -> T:
    """The table at `key` of a file, or the whole file, as an object of its class."""
    try:
        return cls.model_validate(table)
    except ValidationError as error:
        raise BadInput(_one_line(cls, error, key)) from None


def _one_line(cls: type[Table], error: ValidationError, key: str) -> str:
    """The first problem in one sentence, and how many more there are.

    Unknown keys go first: a misspelt key is also a missing one.
    """
    problems = sorted(error.errors(), key=lambda problem: problem["type"] != "extra_forbidden")
    missing = [".".join([key, *map(str, p["loc"])]).lstrip(".") for p in problems if p["type"] == "missing"]
    if len(missing) > 1 and len(missing) == len(problems):
        return f"keys {', '.join(map(repr, missing))} are missing"
    return " ".join(_sentence(cls, problems[0], key).split()) + and_more(len(problems))


def and_more(problems: int) -> str:
    """The tail of an error about the first of some problems."""
    return f" (and {problems - 1} more)" if problems > 1 else ""


def _sentence(cls: type[Table], problem: ErrorDetails, root: str) -> str:
    """One problem found by pydantic, in terms of the file."""
    loc, kind, value = problem["loc"], problem["type"], problem["input"]
    # pydantic marks the key of a table, beside its value, as [key]
    parts = [part for part in loc if part != "[key]"]
    key = root + "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts)
    key = key.lstrip(".")
    if kind == "extra_forbidden":
        known = [field.alias or name for name, field in _table_at(cls, loc).model_fields.items()]
        return f"key '{key}' is not known; {did_you_mean(str(loc[-1]), known)}"
    if kind == "missing":
        return f"key '{key}' is missing"
    if kind == "literal_error":
        names = [str(name) for name in _literals(problem)]
        return f"key '{key}' must be one of {', '.join(names)}, not {str(value)[:60]!r}"
    if kind == "value_error":
        ours = str(problem["ctx"]["error"])
        if isinstance(value, dict):
            return f"[{key}] {ours}" if key else ours
        return f"key '{key}' {ours}"
    said = SAID.get(kind) or problem["msg"].replace("Input should", "must").replace("a valid ", "a ")
    return f"key '{key}' {said}, not {str(value)[:60]!r}"


def _literals(problem: ErrorDetails) -> list[str]:
    """The choices of a literal: pydantic gives them as "'a', 'b' or 'c'"."""
    return [c.strip().strip("'") for c in problem["ctx"]["expected"].replace(" or ", ", ").split(",")]


def _table_at(cls: type[Table], loc: tuple[int | str, ...]) -> type[Table]:
    """The table in which the key at that place stands."""
    table = cls
    for part in loc:
        if isinstance(part, str) and part in table.model_fields:
            table = next(_tables_in(table.model_fields[part].annotation), table)
    return table


def _tables_in(annotation: Any) -> Iterator[type[Table]]:
    """The classes of tables within a field's type, as Column in dict[str, Column]."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    yield from chain.from_iterable(_tables_in(argument) for argument in get_args(annotation))
