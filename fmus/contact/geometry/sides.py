"""Both sides of a wheelset from what was given of them: one for both, or a pair (left, right)."""

from pathlib import Path
from typing import TypeAlias, TypeVar

from fmus.contact.arguments import ANY, POSITIVE, checked
from fmus.contact.geometry.measured import load_profile
from fmus.contact.geometry.pair import Pair, Sides
from fmus.contact.geometry.profile import Kind, Profile
from fmus.errors import BadInput

Given: TypeAlias = str | Path | Profile
Item = TypeVar("Item")
Both: TypeAlias = Item | tuple[Item, Item]  # one for both sides, or the left and the right one

CANT = 1 / 40  # slope, of rails that are given upright


def sides_of(
    wheel: Both[Given],
    rail: Both[Given],
    cant: float | None,
    gauge: float,
    r0: Both[float],
    back_to_back: float,
    smoothing: float | None = None,
) -> Sides:
    """The sides, read; arguments and errors: see contact_table.

    cant: None for 1/40, or 0 where the rails are given as they lie in the track.
    """
    gauge, back_to_back = number("gauge", "m", gauge), number("back_to_back", "m", back_to_back)
    wheels, rails = _profiles("wheel", wheel, smoothing), _profiles("rail", rail, smoothing)
    if cant is None:
        cant = 0.0 if all(r.gauge_face is not None for r in rails) else CANT
    cant = number("cant", "1", cant)
    radii = [number("r0", "m", one) for one in _both("r0", r0)]
    left, right = (
        Pair(one, on, cant, gauge, radius, back_to_back)
        for one, on, radius in zip(wheels, rails, radii, strict=True)
    )
    return Sides(left, left if left == right else right)


def said(left: Item, right: Item) -> Both[Item]:
    """One value where both sides are alike, else both."""
    return left if left == right else (left, right)


def number(name: str, unit: str, value: float, positive: bool = False) -> float:
    """One finite number; BadInput, a ValueError, names it where it is something else."""
    try:
        found = checked(name, unit, value, POSITIVE if positive else ANY)
    except ValueError as error:
        raise BadInput(str(error)) from error
    if found.ndim:
        raise BadInput(f"{name} must be one number [{unit}], not an array of shape {found.shape}")
    return float(found)


def _both(name: str, given: Both[Item]) -> tuple[Item, Item]:
    """The left and the right one, the same object where one is given for both."""
    if not isinstance(given, tuple | list):
        return given, given
    if len(given) != 2:
        raise BadInput(f"{name} has {len(given)} entries; give one for both sides, or the left and the right")
    return given[0], given[1]


def _profiles(kind: Kind, given: Both[Given], smoothing: float | None) -> tuple[Profile, Profile]:
    """The left and the right wheel or rail, read."""
    both: tuple[Given, Given] = _both(kind, given)
    left, right = both
    first = load_profile(left, kind, smoothing)
    return first, first if right is left else load_profile(right, kind, smoothing)
