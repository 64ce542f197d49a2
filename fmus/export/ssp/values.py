"""Values that parameter bindings of an SSP package give, with the mappings between names."""

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from fmus.errors import BadInput
from fmus.export.ssp.elements import every, number, one, parsed

BRACKETED = re.compile(r"\[[^\[\]]+\]")  # '[m]', as tables head their columns, is the unit m
WHOLE = tuple(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))  # of SSP 2.0
NUMBERS = ("Real", "Float64", "Float32", "Integer", "Boolean", *WHOLE)
Start = tuple[float, str | None]  # a value and its unit
STARTS = dict[str, Start]
Target = tuple[str, Callable[[Start], Start]]  # a parameter, and what is done to a value before it is set


def bound(node: Any, files: Mapping[str, bytes]) -> STARTS:
    """Values of all parameter bindings of an element; what comes later counts."""
    found: STARTS = {}
    for binding in every(node, "ssd:ParameterBindings/ssd:ParameterBinding"):
        source, prefix = binding.get("source"), binding.get("prefix", "")
        if source is None:
            sets = every(binding, "ssd:ParameterValues/ssv:ParameterSet")
        elif source in files:
            sets = [parsed(files[source], source)]
        else:
            raise BadInput(f"parameters of '{node.get('name')}' are in '{source}', which is missing; add it")
        entries = _mapping(one(binding, "ssd:ParameterMapping"), node.get("name"), files)
        for values in sets:
            given = {f"{prefix}{name}": value for name, value in _parameters(values)}
            found |= {name: value for name, value in given.items() if name not in entries}
            found |= {
                t: f(given[name]) for name, targets in entries.items() if name in given for t, f in targets
            }
    return found


def _mapping(node: Any, owner: str, files: Mapping[str, bytes]) -> dict[str, list[Target]]:
    """Where values of a parameter set go, by their name in the set, each with what is done to the value."""
    if node is None:
        return {}
    source = node.get("source")
    if source is not None and source not in files:
        raise BadInput(f"the mapping of parameters of '{owner}' is '{source}', which is missing; add it")
    entries: dict[str, list[Target]] = {}
    whole = [parsed(files[source], source)] if source else every(node, "ssm:ParameterMapping")
    for entry in (e for mapping in whole for e in every(mapping, "ssm:MappingEntry")):
        name = f"the mapping of parameter '{entry.get('source')}' of '{owner}'"
        entries.setdefault(entry.get("source"), []).append(
            (entry.get("target"), _transformation(entry, name))
        )
    return entries


def _transformation(node: Any, name: str) -> Callable[[Start], Start]:
    """The change of a value that an entry of a mapping states; its unit is that of the target then."""
    for other in ("Boolean", "Integer", "Enumeration"):
        if one(node, f"ssc:{other}MappingTransformation") is not None:
            raise BadInput(f"{name} maps values one by one; only factor and offset can be used here")
    line = one(node, "ssc:LinearTransformation")
    if line is None:
        return lambda start: start
    factor, offset = (number(line, key) for key in ("factor", "offset"))
    return lambda start: (start[0] * (1.0 if factor is None else factor) + (offset or 0.0), None)


def _parameters(values: Any) -> Iterator[tuple[str, tuple[float, str | None]]]:
    """Numbers of a parameter set, truths as 1 and 0; BadInput for words."""
    for p in every(values, "ssv:Parameters/ssv:Parameter"):
        kind = next((k for k in NUMBERS if one(p, f"ssv:{k}") is not None), None)
        if kind is None:
            raise BadInput(f"parameter '{p.get('name')}' is no number; only numbers can be set here")
        value = one(p, f"ssv:{kind}")
        if value.get("value") in ("true", "false"):
            yield p.get("name"), (float(value.get("value") == "true"), None)
            continue
        found = number(value, "value")
        if found is None:
            raise BadInput(f"parameter '{p.get('name')}' has no value; only single numbers can be set here")
        unit = value.get("unit") or None
        yield p.get("name"), (found, unit and (unit[1:-1] if BRACKETED.fullmatch(unit) else unit))
