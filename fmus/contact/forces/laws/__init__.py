"""Creep laws by name. Each file of this folder that defines a CreepLaw is one; there is no other list."""

import sys

import casadi as cs

from fmus.contact.forces.laws.law import ARGUMENTS, GIVEN, SHARED, CreepLaw, given_or_kalker
from fmus.contact.two import for_two
from fmus.errors import BadInput
from fmus.registry import by_name, classes_in
from fmus.variables import Expr


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
    """All laws as one function, (code, *ARGUMENTS, *GIVEN) -> RESULTS, that works out only the selected one.

    Of the two contacts of a wheelset: columns of two, but for what they have in common, see SHARED.
    code: of the law, as the parameter creep_law of an FMU. FASTSIM on its default grid.
    """
    laws = [_with_given(law) for law in LAWS.values()]
    return cs.Function.conditional("creep_law", laws[:-1], laws[-1])


def _with_given(law: type[CreepLaw]) -> cs.Function:
    """The law for two contacts, with the coefficients that may be given to it as last arguments."""
    alone = for_two(law().function(), SHARED)
    kind: type[Expr] = cs.SX if alone.is_a("SXFunction") else cs.MX
    arguments = {name: kind.sym(name, alone.size1_in(name)) for name in ARGUMENTS}
    given = [kind.sym(name) for name in GIVEN]
    values = arguments | (given_or_kalker(arguments, given) if law.takes_given else {})
    results = alone.call([values[name] for name in ARGUMENTS])
    return cs.Function(law.name, [*arguments.values(), *given], results)
