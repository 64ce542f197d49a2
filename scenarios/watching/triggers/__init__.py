"""Triggers by kind. Each class of this folder that is a Trigger is one; there is no other list."""

import sys

from fmus.registry import by_name, classes_in
from scenarios.watching.triggers.trigger import Trigger

TRIGGERS: dict[str, type[Trigger]] = by_name(
    classes_in(sys.modules[__name__], Trigger),  # type: ignore[type-abstract]  # what is found is concrete
    "kind",
)
