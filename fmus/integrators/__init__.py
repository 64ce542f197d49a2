"""Integrators by name. Each file of this folder that defines an Integrator is one; there is no other list."""

import sys

from fmus.errors import BadInput, did_you_mean
from fmus.integrators.integrator import Integrator
from fmus.registry import by_name, classes_in

INTEGRATORS: dict[str, type[Integrator]] = by_name(
    classes_in(sys.modules[__name__], Integrator),  # type: ignore[type-abstract]  # what is found is concrete
    "name",
)


def integrator(name: str, where: str) -> Integrator:
    """The integrator of that name; BadInput, which says where it is named, with the nearest one otherwise."""
    if name not in INTEGRATORS:
        raise BadInput(f"{where}: method '{name}' is not known; {did_you_mean(str(name), INTEGRATORS)}")
    return INTEGRATORS[name]()
