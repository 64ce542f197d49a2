"""What a model feels of a track: its inputs by name, as functions of time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from fmus.errors import BadInput, did_you_mean
from fmus.variables import Input, OnTrack, Parameter
from scenarios.track.journey import Journey, Speed, journey
from scenarios.track.rails import QUANTITIES, Array
from scenarios.track.track import Track

Signal: TypeAlias = Callable[[ArrayLike], Array]
SPEED = "speed"  # of travel, beside the quantities of the rails


@dataclass(frozen=True)
class Felt:
    """Where a quantity of the track is felt: the mean over places ahead of the vehicle's reference [m]."""

    track: Track
    run: Journey
    quantity: str
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


def riders() -> dict[str, dict[str, OnTrack]]:
    """What of a track each input is that feels one, by model and input."""
    from fmus.model import declared  # both here because they load CasADi, which a foreign FMU does without
    from fmus.models import MODELS

    felt = {
        name: {v.name: v.on_track for v in declared(model).values() if isinstance(v, Input) and v.on_track}
        for name, model in MODELS.items()
    }
    return {name: found for name, found in felt.items() if found}


def inputs(track: Track, V: Speed, model: str, **geometry: float) -> dict[str, Signal]:
    """The inputs of a model on a track by name, each a function of time [s].

    V: m/s, or (times, speeds), or a Journey; geometry [m]: `offset`, by which the place of the ride is ahead
    of the run's distance, and what the inputs of the model name, a parameter's start value by default.
    Raises BadInput for a model that feels no track and for geometry it does not have.
    """
    known = riders()
    felt = known.get(model.lower())
    if felt is None:
        raise BadInput(f"model '{model}' takes no inputs from a track; {did_you_mean(model, known)}")
    lengths = {"offset": 0.0, **_lengths(model, felt)}
    for name in geometry.keys() - lengths.keys():
        raise BadInput(f"model '{model}' on a track has no '{name}'; {did_you_mean(name, lengths)}")
    run = journey(V)
    return {name: _signal(where, track, run, {**lengths, **geometry}) for name, where in felt.items()}


def _lengths(model: str, felt: Mapping[str, OnTrack]) -> dict[str, float]:
    """Lengths that the inputs on a track name, with their defaults, m; BadInput where these name no thing."""
    from fmus.model import declared
    from fmus.models import model_class

    starts = {v.name: v.start for v in declared(model_class(model)).values() if isinstance(v, Parameter)}
    found: dict[str, float] = {}
    for name, where in felt.items():
        if where.quantity not in (*QUANTITIES, SPEED) or (where.rate and where.quantity == SPEED):
            near = did_you_mean(where.quantity, (*QUANTITIES, SPEED))
            what = f"{'the rate of ' if where.rate else ''}'{where.quantity}'"
            raise BadInput(f"model '{model}': input '{name}' is {what}, which no track has; {near}")
        for length in where.behind:
            if length not in starts:
                near = did_you_mean(length, starts)
                raise BadInput(
                    f"model '{model}': input '{name}' is behind by '{length}', no parameter; {near}"
                )
            found[length] = starts[length]
        found |= {where.spacing: 0.0} if where.spacing else {}
    return found


def _signal(where: OnTrack, track: Track, run: Journey, lengths: Mapping[str, float]) -> Signal:
    if where.quantity == SPEED:
        return run.speed
    place = lengths["offset"]
    for name in where.behind:
        place -= lengths[name]
    half = lengths.get(where.spacing, 0.0) / 2
    felt = Felt(track, run, where.quantity, (place + half, place - half) if half else (place,))
    return felt.rate if where.rate else felt.value
