"""Filters by name. Every file of this folder that defines an Estimator adds one; there is no other list."""

import sys
from functools import cache
from typing import TYPE_CHECKING

from fmus.registry import by_name, classes_in

if TYPE_CHECKING:
    from estimator.filters.named import Estimator


@cache
def filters() -> dict[str, type["Estimator"]]:
    """All filters by name. They are imported at the first call, because that takes about a second."""
    from estimator.filters.named import Estimator

    # the classes that are found are concrete
    return by_name(classes_in(sys.modules[__name__], Estimator), "name")  # type: ignore[type-abstract]
