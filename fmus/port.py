"""A place where a generalised force acts on a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    parts: of a port made by `alike`, the ports at each of which a law acts.
    has_displacement: whether the displacement is known; if not, only laws over velocity and time act there.
    """

    displacement: Expr
    velocity: Expr
    forces: Mapping[str, float | Expr]
    motion: Literal["rotation", "translation"] = "translation"
    place: Literal["rests", "turns", "slips"] = "rests"
    parts: tuple[Port, ...] = ()
    has_displacement: bool = True

    @property
    def acting(self) -> tuple[Port, ...]:
        """The ports at which a law acts, each by its own motion: its parts, or itself."""
        return self.parts or (self,)

    def act(self, inputs: dict[str, Expr], force: Expr) -> None:
        """Add to the `inputs` by name what a force at this port puts on them."""
        for name, gain in self.forces.items():
            inputs[name] = inputs.get(name, 0.0) + gain * force


def alike(parts: Sequence[Port]) -> Port:
    """Several ports of one kind as one location: a law acts at each of them by that one's motion.

    As a whole it has their mean motion, and its force acts at each of them: a law can be read from this
    force over that motion. The force's power is len(parts) times their product.
    """
    forces: dict[str, Expr] = {}
    for part in parts:
        part.act(forces, 1.0)
    q = sum(part.displacement for part in parts) / len(parts)
    v = sum(part.velocity for part in parts) / len(parts)
    return Port(q, v, forces, parts[0].motion, parts[0].place, tuple(parts))
