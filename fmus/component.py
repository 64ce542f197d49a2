"""A part of a model whose health is held by parameters: a spring, a damper, a bush."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Component:
    """Names of the parameters to which its stiffness and its damping are in proportion.

    Several names are the parts that change alike, as the springs at all four corners.
    """

    stiffness: tuple[str, ...] = ()
    damping: tuple[str, ...] = ()
