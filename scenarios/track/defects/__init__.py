"""Defects by shape. Each class of this folder that is a Defect is one; there is no other list."""

import sys

from fmus.registry import by_name, classes_in
from scenarios.track.defects.defect import Defect

DEFECTS: dict[str, type[Defect]] = by_name(
    classes_in(sys.modules[__name__], Defect),  # type: ignore[type-abstract]  # what is found is concrete
    "shape",
)
