"""Creep laws by name. Each file of this folder that defines a CreepLaw is one; there is no other list."""

import sys

import casadi as cs

from fmus.contact.forces.laws.law import CreepLaw
from fmus.registry import classes_in

LAWS: dict[str, type[CreepLaw]] = {
    law.name: law
    for law in sorted(
        classes_in(sys.modules[__name__], CreepLaw),  # type: ignore[type-abstract]  # what is found is concrete
        key=lambda law: law.code,
    )
}


def selected_law() -> cs.Function:
    """All laws as one function, (code, *ARGUMENTS) -> RESULTS, that works out only the selected one.

    code: 0 to 4, as the parameter creep_law of an FMU. FASTSIM on its default grid.
    """
    laws = [law().function() for law in LAWS.values()]
    return cs.Function.conditional("creep_law", laws[:-1], laws[-1])
