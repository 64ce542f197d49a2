"""Values that parameter bindings of an SSP package give, with the mappings between names."""

import re
from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import unquote

from fmus.errors import BadInput
from fmus.export.ssp.elements import every, number, one, parsed
from fmus.export.ssp.system import Start

BRACKETED = re.compile(r"\[[^\[\]]+\]")  # '[m]', as tables head their columns, is the unit m
WHOLE = tuple(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))  # of SSP 2.0
NUMBERS = ("Real", "Float64", "Float32", "Integer", "Boolean", *WHOLE)
STARTS = dict[str, Start]


def bound(node: Any, files: Mapping[str, bytes]) -> STARTS:
    """Values of all parameter bindings of an element; what comes later counts."""
    found: STARTS = {}
    for binding in every(node, "ssd:ParameterBindings/ssd:ParameterBinding"):
        prefix = binding.get("prefix", "")
        within = every(binding, "ssd:ParameterValues/ssv:ParameterSet")
        sets = _file(binding, f"parameters of '{node.get('name')}' are in", files) or within
        entries = _mapping(one(binding, "ssd:ParameterMapping"), node.get("name"), files)
        for values in sets:
            given = {f"{prefix}{name}": value for name, value in _parameters(values)}
            found |= {name: value for name, value in given.items() if name not in entries}
            found |= {
                entry.get("target"): _mapped(given[name], entry, node.get("name"))
                for name, targets in entries.items()
                if name in given
                for entry in targets
            }
    return found


def _file(node: Any, what: str, files: Mapping[str, bytes]) -> list[Any]:
    """The root of the file that an element refers to; none where it holds its content itself."""
    source = unquote(node.get("source") or "").removeprefix("./")  # some tools write an empty one
    if source and source not in files:
        raise BadInput(f"{what} '{source}', which is missing; add it")
    return [parsed(files[source], source)] if source else []


def _mapping(node: Any, owner: str, files: Mapping[str, bytes]) -> dict[str, list[Any]]:
    """The entries that say where values of a parameter set go, by their name in the set."""
    if node is None:
        return {}
    entries: dict[str, list[Any]] = {}
    within = every(node, "ssm:ParameterMapping")
    whole = _file(node, f"the mapping of parameters of '{owner}' is", files) or within
    for entry in (e for mapping in whole for e in every(mapping, "ssm:MappingEntry")):
        entries.setdefault(entry.get("source"), []).append(entry)
    return entries


def _mapped(given: Start, node: Any, owner: str) -> Start:
    """A value behind an entry of a mapping, which converts its unit first unless it says otherwise."""
    name = f"the mapping of parameter '{node.get('source')}' of '{owner}'"
    for other in ("Boolean", "Integer", "Enumeration"):
        if one(node, f"ssc:{other}MappingTransformation") is not None:
            raise BadInput(f"{name} maps values one by one; only factor and offset can be used here")
    if node.get("suppressUnitConversion", "false") in ("true", "1"):
        given = Start(given.value)
    line = one(node, "ssc:LinearTransformation")
    gain, offset = (number(line, key) for key in ("factor", "offset"))
    return given.times(1.0 if gain is None else gain, offset or 0.0)


def _parameters(values: Any) -> Iterator[tuple[str, Start]]:
    """Numbers of a parameter set, truths as 1 and 0; BadInput for words."""
    for p in every(values, "ssv:Parameters/ssv:Parameter"):
        kind = next((k for k in NUMBERS if one(p, f"ssv:{k}") is not None), None)
        if kind is None:
            raise BadInput(f"parameter '{p.get('name')}' is no number; only numbers can be set here")
        value = one(p, f"ssv:{kind}")
        if value.get("value") in ("true", "false"):
            yield p.get("name"), Start(float(value.get("value") == "true"))
            continue
        found = number(value, "value")
        if found is None:
            raise BadInput(f"parameter '{p.get('name')}' has no value; only single numbers can be set here")
        unit = value.get("unit") or None
        yield p.get("name"), Start(found, unit and (unit[1:-1] if BRACKETED.fullmatch(unit) else unit))
