"""Sources of tracks by kind. Each file of this folder with a Source is one; there is no other list."""

import sys

from fmus.registry import by_name, classes_in
from scenarios.track.sources.source import Source

SOURCES: dict[str, type[Source]] = by_name(
    classes_in(sys.modules[__name__], Source),  # type: ignore[type-abstract]  # what is found is concrete
    "kind",
)
