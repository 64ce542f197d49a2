"""What a model feels of a track: its inputs by name, as functions of time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from fmus.errors import BadInput, did_you_mean
from scenarios.track.journey import Journey, Speed, journey
from scenarios.track.rails import Array, Quantity
from scenarios.track.track import Track

Signal: TypeAlias = Callable[[ArrayLike], Array]


@dataclass(frozen=True)
class Felt:
    """Where a quantity of the track is felt: the mean over places ahead of the vehicle's reference [m]."""

    track: Track
    run: Journey
    quantity: Quantity
    ahead: Sequence[float] = field(default=(0.0,))

    def value(self, time: ArrayLike) -> Array:
        """Deviation [m] at times [s] of any shape."""
        s = self.run.distance(time)
        values = [getattr(self.track.at(s + x), self.quantity) for x in self.ahead]
        return np.asarray(np.mean(values, axis=0), dtype=np.float64)

    def rate(self, time: ArrayLike) -> Array:
        """Its exact derivative over time [m/s]: slope times speed."""
        s = self.run.distance(time)
        slopes = [getattr(self.track.slope(s + x), self.quantity) for x in self.ahead]
        return np.asarray(np.mean(slopes, axis=0) * self.run.speed(time), dtype=np.float64)


def wheelset_inputs(track: Track, run: Journey, *, offset: float = 0.0) -> dict[str, Signal]:
    """Inputs of the wheelset, `offset` m ahead of the run's distance."""
    alignment = Felt(track, run, "alignment", (offset,))
    gauge = Felt(track, run, "gauge", (offset,))
    return {"y_irr": alignment.value, "y_irr_dot": alignment.rate, "gauge_irr": gauge.value, "V": run.speed}


def vehicle_inputs(
    track: Track,
    run: Journey,
    *,
    a1: float = 9.5,
    a2: float = 9.5,
    axle_spacing: float = 0.0,
    offset: float = 0.0,
) -> dict[str, Signal]:
    """Inputs of the vehicle on two bogies: rail height under each bogie side, and its rate.

    a1, a2: bogie centres from the coach centre, m; axle_spacing: between the two axles of a bogie, m, whose
    mean a bogie side feels. The front bogie's centre is `offset` m ahead of the run's distance, the rear one
    follows a1 + a2 behind it.
    """
    found: dict[str, Signal] = {}
    sides: tuple[tuple[str, Quantity], ...] = (("l", "z_left"), ("r", "z_right"))
    for end, centre in (("f", offset), ("r", offset - a1 - a2)):
        axles = (centre + axle_spacing / 2, centre - axle_spacing / 2) if axle_spacing else (centre,)
        for side, quantity in sides:
            height = Felt(track, run, quantity, axles)
            found |= {f"u_{end}{side}": height.value, f"u_{end}{side}_dot": height.rate}
    return found


INPUTS: Mapping[str, Callable[..., dict[str, Signal]]] = MappingProxyType(
    {"wheelset": wheelset_inputs, "vehicle7dof": vehicle_inputs}
)


def inputs(track: Track, V: Speed, model: str, **geometry: float) -> dict[str, Signal]:
    """The inputs of a model on a track by name, each a function of time [s].

    V: m/s, or (times, speeds), or a Journey; geometry: what the function of that model in INPUTS takes.
    Raises BadInput for a model that feels no track and for geometry it does not have.
    """
    if model not in INPUTS:
        raise BadInput(f"model '{model}' takes no inputs from a track; {did_you_mean(model, INPUTS)}")
    known = set(INPUTS[model].__kwdefaults__ or {})
    for name in geometry.keys() - known:
        raise BadInput(f"model '{model}' on a track has no '{name}'; {did_you_mean(name, known)}")
    return INPUTS[model](track, journey(V), **geometry)
