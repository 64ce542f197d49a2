"""A place where a generalised force acts on a model."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from fmus.variables import Expr

UNITS = {  # of generalised force and displacement, by kind of motion
    "rotation": {"F": "N.m", "q": "rad"},
    "translation": {"F": "N", "q": "m"},
}


@dataclass(frozen=True)
class Port:
    """A place where a generalised force acts: its conjugate motion, and how it enters the inputs.

    forces: gain of the force on each `*_ext` input (virtual work: d(displacement)/d(coordinate)).
    place: whether the displacement keeps to a rest position, turns on, or is only slip added up.
    """

    displacement: Expr
    velocity: Expr
    forces: Mapping[str, float | Expr]
    motion: Literal["rotation", "translation"] = "translation"
    place: Literal["rests", "turns", "slips"] = "rests"
