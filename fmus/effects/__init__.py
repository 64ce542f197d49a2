"""Effects by kind. Each file of this folder that defines an Effect is one; there is no other list."""

import sys

from fmus.effects.effect import Effect
from fmus.effects.site import Site
from fmus.errors import BadInput, did_you_mean
from fmus.registry import by_name, classes_in

EFFECTS: dict[str, type[Effect]] = by_name(
    classes_in(sys.modules[__name__], Effect),  # type: ignore[type-abstract]  # what is found is concrete
    "kind",
)


def parse_effect(text: str) -> tuple[type[Effect], str]:
    """Read "kind@location"; BadInput where the kind is not known or the location is missing."""
    kind, at, location = text.partition("@")
    if not at or not location:
        raise BadInput(f"effect '{text}': write KIND@LOCATION, with a kind such as viscous_damping")
    if kind not in EFFECTS:
        raise BadInput(f"effect '{text}': kind '{kind}' is not known; {did_you_mean(kind, EFFECTS)}")
    return EFFECTS[kind], location


def offers(site: Site) -> tuple[tuple[str, str], ...]:
    """(kind, location) of every effect that makes sense in a site, each possible change under one name."""
    return tuple(
        (kind, location)
        for kind, effect in EFFECTS.items()
        for location, place in effect.locations(site).items()
        if (effect.fits(place) or not site.places_known) and effect.offered(site, location)
    )
