"""FMPy's model description reduced to what is used of it here."""

from collections.abc import Iterator, Mapping
from itertools import count
from math import inf, prod
from typing import Any

from fmus.host.description import FmuDescription, FmuVariable
from fmus.host.places import BEYOND, C_TYPES, MOST_ELEMENTS, REAL, Place, called, elements

TRUTHS = {"true": 1.0, "false": 0.0}


def reduced(model: Any) -> FmuDescription:
    """The description of an FMU for co-simulation or, if it has none, for model exchange.

    Raises ValueError for a number that is none.
    """
    unused = {v.name: kind for v in model.modelVariables if (kind := _unused(v))}
    variables = {v.name: _variable(v) for v in model.modelVariables if v.name not in unused}
    further, places = _further(model, unused)
    kind, usual = model.coSimulation or model.modelExchange, model.defaultExperiment
    alone = model.coSimulation is None
    sizes = int(model.numberOfContinuousStates or 0), int(model.numberOfEventIndicators or 0)
    step = _number(usual.stepSize) if usual else None
    return FmuDescription(
        name=model.modelName,
        fmi_version=model.fmiVersion,
        identifier=kind.modelIdentifier,
        guid=model.guid or model.instantiationToken,
        variables=variables,
        step_size=step if step is not None and 0 < step < inf else None,
        saves_state=kind.canGetAndSetFMUstate,
        serialises_state=kind.canSerializeFMUstate,
        once_per_process=kind.canBeInstantiatedOnlyOncePerProcess,
        variable_step=alone or kind.canHandleVariableCommunicationStepSize,
        dependencies=dict(_dependencies(model)),
        unused=unused,
        exchange=sizes if alone else None,
        further=further,
        places=tuple(places),
    )


def _dependencies(model: Any) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Each output with the inputs in it, where they are said; arrays by their elements."""
    for unknown in model.outputs:
        if unknown.dependencies is not None:
            inputs = [v for v in unknown.dependencies if v.causality == "input"]
            into = tuple(name for v in inputs for name in _names(v))
            yield from ((name, into) for name in _names(unknown.variable))


def _names(v: Any) -> list[str]:
    return [f"{v.name}{index}" for index in elements(v.shape)] if v.dimensions else [v.name]


def _unused(v: Any) -> str:
    """What a variable is that is no scalar real one; empty for one that is."""
    if v.dimensions:
        return "an array"
    if v.causality == "structuralParameter":
        return "a structural parameter"
    if v.clocks:
        return "a clocked variable"
    return "" if v.type in ("Real", "Float64") else f"of type {v.type}"


def _further(model: Any, unused: Mapping[str, str]) -> tuple[dict[str, FmuVariable], list[Place]]:
    """The variables that can be set and read though they are no scalar reals, and where they lie."""
    fmi3, taken = model.fmiVersion.startswith("3"), {v.name for v in model.modelVariables}
    further, places, number = dict[str, FmuVariable](), list[Place](), count(BEYOND)
    for v in model.modelVariables:
        if v.name not in unused or not _can_be_used(v):
            continue
        starts, size = _starts(v), prod(v.shape) if v.dimensions else 1
        whole = tuple(s or 0.0 for s in starts) if size > 1 else (0.0,)
        for element, (name, start) in enumerate(zip(_names(v), starts, strict=True)):
            if name != v.name and name in taken:
                continue
            further[name] = _variable(v, name, next(number), start)
            places.append(Place(called(v.type, fmi3), int(v.valueReference), element, whole))
    return further, places


def _can_be_used(v: Any) -> bool:
    """Whether its values are numbers or truths that may be set and read at any time of a run."""
    known = v.type in C_TYPES or v.type in ("Boolean", "Enumeration")
    small = not v.dimensions or prod(v.shape) <= MOST_ELEMENTS
    return known and small and not v.clocks and v.causality != "structuralParameter"


def _starts(v: Any) -> list[float | None]:
    """Start values of all elements; one stands for all."""
    size = prod(v.shape) if v.dimensions else 1
    found = [_number(word) for word in str(v.start).split()] if v.start not in (None, "") else []
    if len(found) not in (0, 1, size):
        raise ValueError(f"'{v.name}' has {size} elements and {len(found)} start values")
    return found if len(found) == size else (found or [None]) * size


def _variable(
    v: Any, name: str | None = None, reference: int | None = None, start: float | None = None
) -> FmuVariable:
    """A variable, or one of the elements of an array by the name, reference and start value given."""

    def said(attribute: str) -> Any:
        own = getattr(v, attribute)
        return getattr(v.declaredType, attribute, None) if own is None and v.declaredType else own

    low, high = _usual_limits(v)
    least, most = _number(said("min")), _number(said("max"))
    return FmuVariable(
        name=name or v.name,
        reference=int(v.valueReference) if reference is None else reference,
        causality="local" if v.alias else v.causality or "local",  # one state or input, whatever its names
        variability=v.variability or ("continuous" if v.type in REAL else "discrete"),
        initial=v.initial,
        unit=said("unit"),
        start=_number(v.start) if name is None else start,
        min=low if least is None else least,
        max=high if most is None else most,
        nominal=_number(said("nominal")),
        description=v.description or "",
        type=v.type,
        array=v.name if v.dimensions else "",
    )


def _usual_limits(v: Any) -> tuple[float | None, float | None]:
    """Limits of a variable that states none: a truth's, and the items of an enumeration."""
    if v.type == "Boolean":
        return 0.0, 1.0
    items = [float(item.value) for item in getattr(v.declaredType, "items", None) or [] if item.value]
    return (min(items), max(items)) if v.type == "Enumeration" and items else (None, None)


def _number(text: Any) -> float | None:
    if text in (None, ""):
        return None
    return TRUTHS[text] if text in TRUTHS else float(text)
