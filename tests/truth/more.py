"""What any of the true systems may have beyond its declared model, whatever its equations are.

Laws at places, links between places, parameters that change, inputs that arrive otherwise, and kinks in the
rail that no record of the track shows. All off by default.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import exp
from typing import Any, TypeVar

import numpy as np

from tests.truth.laws import LAWS, Law, Row
from tests.truth.passing import Array, Passing

Parameters = TypeVar("Parameters")
At = Callable[[str], tuple[float, float]]  # place -> displacement and velocity there


@dataclass(frozen=True)
class Change:
    """Change of a parameter: delta from t0 [s] on, rate [unit/s], warming up by `warm` within tau [s].

    From t1 on (if it is there) the delta has come in a straight line since t0.
    """

    delta: float = 0.0
    t0: float = 0.0
    rate: float = 0.0
    warm: float = 0.0
    tau: float = 1.0
    t1: float = 0.0

    def at(e, t: float) -> float:
        """The change at time t [s]."""
        part = min(max((t - e.t0) / (e.t1 - e.t0), 0.0), 1.0) if e.t1 > e.t0 else float(t >= e.t0)
        return e.delta * part + e.rate * t + e.warm * (1 - exp(-t / e.tau))


@dataclass(frozen=True)
class Link:
    """Outside the vocabulary: motion at one place pulls at another, force = -k q - c v."""

    source: str
    target: str
    k: float = 0.0
    c: float = 0.0


@dataclass(frozen=True)
class Kinks:
    """Outside the vocabulary: sharp dips of a rail at `where` [m], depth and reach [m]."""

    where: Row
    depth: float
    reach: float

    def heights(e, s: Array) -> tuple[Array, Array]:
        """Height (n,) [m] and slope at ways s (n,) [m]."""
        z, dz = np.zeros_like(s), np.zeros_like(s)
        for at in e.where:
            dip = -e.depth * np.exp(-np.abs(s - at) / e.reach)
            z, dz = z + dip, dz - np.sign(s - at) * dip / e.reach
        return z, dz


@dataclass(frozen=True)
class More:
    """All of it: (place, law) pairs, links, changes by parameter, inputs by name, kinks by rail or place."""

    laws: tuple[tuple[str, Law], ...] = ()
    links: tuple[Link, ...] = ()
    changes: Mapping[str, Change] = field(default_factory=dict)
    inputs: Mapping[str, Passing] = field(default_factory=dict)
    kinks: Mapping[str, Kinks] = field(default_factory=dict)

    def __add__(self, other: More) -> More:
        """Both; of the same parameter, input or rail only one may be there."""
        shared = [
            {**getattr(self, f.name), **getattr(other, f.name)}
            for f in fields(self)
            if f.name not in ("laws", "links")
        ]
        return More(self.laws + other.laws, self.links + other.links, *shared)


NO_MORE = More()


def changed(p: Parameters, changes: Mapping[str, Change], t: float) -> Parameters:
    """Parameters at time t [s]."""
    if not changes:
        return p
    now = {name: getattr(p, name) + change.at(t) for name, change in changes.items()}
    return replace(p, **now)  # type: ignore[type-var]


@dataclass(frozen=True)
class Acting:
    """The laws at their places, each with its part of the memory; see `acting`."""

    parts: tuple[tuple[str, Law, slice], ...]
    links: tuple[Link, ...]

    def rest(self, at: At) -> list[float]:
        """The memory at the start, where the motion is `at`."""
        return [z for place, law, _ in self.parts for z in law.start(*at(place))]

    def forces(self, t: float, at: At, z: Sequence[float]) -> list[tuple[str, float]]:
        """(place, force) of each law and link at time t [s] with the memory z."""
        found = [(place, law.force(t, *at(place), z[own])) for place, law, own in self.parts]
        for link in self.links:
            q, v = at(link.source)
            found.append((link.target, -link.k * q - link.c * v))
        return found

    def rates(self, t: float, at: At, z: Sequence[float]) -> list[float]:
        """Rate of the memory."""
        return [r for place, law, own in self.parts for r in law.rates(t, *at(place), z[own])]


def acting(more: More, places: Callable[[str], Sequence[str]]) -> Acting:
    """The laws of `more` at the single places that their locations stand for."""
    parts, size = [], 0
    for location, law in more.laws:
        for place in places(location):
            end = size + len(law.start(0.0, 0.0))
            parts.append((place, law, slice(size, end)))
            size = end
    return Acting(tuple(parts), more.links)


def made(kind: str, location: str, **settings: Any) -> More:
    """One effect by its kind, the location, and the parameters by the names of docs/effects.md.

    Parameters change by their true values. Raises ValueError for a kind that is not one of these.
    """
    if kind in LAWS:
        return More(laws=((location, LAWS[kind](**settings)),))
    if kind in INPUTS:
        return More(inputs={location: Passing(**{INPUTS[kind]: next(iter(settings.values()))})})
    if kind in CHANGES:
        return More(changes={location: Change(**settings)})
    if kind == "cross_coupling":
        return More(links=(Link(target=location, **settings),))
    if kind == "rail_kink":
        return More(kinks={location: Kinks(**settings)})
    raise ValueError(f"kind {kind!r} is not one of {', '.join([*LAWS, *INPUTS, *CHANGES])}")


INPUTS = {
    "actuator_gain": "gain",
    "actuator_lag": "lag",
    "actuator_saturation": "limit",
    "input_delay": "delay",
    "dead_band": "band",
    "slew_rate": "slew",
}
CHANGES = ("parameter_offset", "parameter_step", "parameter_drift", "warming", "load_leaves")
