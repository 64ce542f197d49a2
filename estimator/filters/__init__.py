"""Filters by name. Each file of this folder that defines an Estimator is one; there is no other list."""

import sys
from functools import cache
from typing import TYPE_CHECKING

from fmus.registry import by_name, classes_in

if TYPE_CHECKING:
    from estimator.filters.named import Estimator


@cache
def filters() -> dict[str, type["Estimator"]]:
    """Loaded when first asked for: parts of this folder are used without any filter, which take a second."""
    from estimator.filters.named import Estimator

    # what is found is concrete
    return by_name(classes_in(sys.modules[__name__], Estimator), "name")  # type: ignore[type-abstract]
