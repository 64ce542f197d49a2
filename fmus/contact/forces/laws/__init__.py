"""Creep laws by name. Each file of this folder that defines a CreepLaw is one; there is no other list."""

import sys

import casadi as cs

from fmus.contact.forces.laws.law import CreepLaw
from fmus.errors import BadInput
from fmus.registry import by_name, classes_in


def _in_order(laws: dict[str, type[CreepLaw]]) -> dict[str, type[CreepLaw]]:
    """Laws by name in the order of their codes; BadInput where these do not count up from 0."""
    ordered = sorted(laws.values(), key=lambda law: getattr(law, "code", -1))
    for code, law in enumerate(ordered):
        if getattr(law, "code", None) != code:
            said = f"has code {getattr(law, 'code', None)}, where the next free one is {code}"
            raise BadInput(f"creep law '{law.name}' of {law.__module__} {said}; give it that")
    return {law.name: law for law in ordered}


# what is found is concrete
_FOUND = classes_in(sys.modules[__name__], CreepLaw)  # type: ignore[type-abstract]
LAWS: dict[str, type[CreepLaw]] = _in_order(by_name(_FOUND, "name"))


def law_codes() -> str:
    """The codes of all laws with their titles, for the description of a parameter that selects one."""
    return ", ".join(f"{law.code} {law.title or law.name}" for law in LAWS.values())


def selected_law() -> cs.Function:
    """All laws as one function, (code, *ARGUMENTS) -> RESULTS, that works out only the selected one.

    code: of the law, as the parameter creep_law of an FMU. FASTSIM on its default grid.
    """
    laws = [law().function() for law in LAWS.values()]
    return cs.Function.conditional("creep_law", laws[:-1], laws[-1])
