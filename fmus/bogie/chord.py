"""The track under a bogie, seen from the chord between the places of its wheelsets.

Curvature is taken as linear in between, which is exact in curves and in clothoids.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs

from fmus.bogie.running_gear import GRAVITY, RunningGear
from fmus.variables import Expr


def sideways(V: Expr, kappa: Expr, cant: Expr) -> Expr:
    """Lateral acceleration in the plane of a track, m/s2, less that of gravity."""
    return V**2 * kappa * cs.cos(cant) - GRAVITY * cs.sin(cant)


@dataclass(frozen=True)
class Chord:
    """What two wheelsets of a model, named by their numbers, feel of the track."""

    m: RunningGear
    wheelsets: tuple[str, str]

    def felt(self, i: str, name: str) -> Expr:
        """A variable of a wheelset by its name without the number, "y_irr_dot" for y_irr_1_dot."""
        stem, dot, _ = name.partition("_dot")
        return self.m.symbols[f"{stem}_{i}{dot}"]

    def over(self, name: str) -> Expr:
        """Mean of what both wheelsets feel: kappa, cant, or their rates with "_dot"."""
        return sum(self.felt(i, name) for i in self.wheelsets) / 2

    def aside_at(self, i: str) -> Expr:
        """Lateral acceleration of the track under a wheelset less that of gravity, m/s2."""
        return sideways(self.m.V, self.felt(i, "kappa"), self.felt(i, "cant"))

    @property
    def aside(self) -> Expr:
        """The same at the middle of the chord, m/s2."""
        return sum(self.aside_at(i) for i in self.wheelsets) / 2

    @property
    def turning(self) -> Expr:
        """Yaw acceleration of the chord, rad/s2."""
        first, last = (self.felt(i, "kappa") for i in self.wheelsets)
        return self.m.V**2 * (first - last) / (2 * self.m.a)

    @property
    def down(self) -> Expr:
        """Acceleration by which weight presses on the track, m/s2, by gravity and in a canted curve."""
        kappa, cant = self.over("kappa"), self.over("cant")
        return GRAVITY * cs.cos(cant) + self.m.V**2 * kappa * cs.sin(cant)

    def ahead(self, i: str) -> Expr:
        """Place of a wheelset before the middle, m."""
        return self.m.a if i == self.wheelsets[0] else -self.m.a

    def turned(self, i: str, dot: str = "") -> Expr:
        """Direction of the track at a wheelset from the chord, rad; with "_dot" its rate."""
        first, last = (self.felt(n, f"kappa{dot}") for n in self.wheelsets)
        return self.m.a / 3 * (2 * first + last if i == self.wheelsets[0] else -first - 2 * last)

    def twisted(self, i: str, dot: str = "") -> Expr:
        """Roll of the mean plane of the track from that at a wheelset, rad; with "_dot" its rate."""
        return self.felt(i, f"cant{dot}") - self.over(f"cant{dot}")
