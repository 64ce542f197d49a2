"""Wear over mileage: run, wear the wheels until they have changed a little, run again."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from estimator.record import Array
from fmus.contact import contact_table, equivalent_conicity
from fmus.contact.geometry.parts_table import PARTS
from fmus.contact.geometry.table import default_shifts
from fmus.errors import BadInput
from fmus.host.fmu import FmuError
from fmus.wheelset.track import Track
from scenarios.wearing.footprint import Footprint, footprints
from scenarios.wearing.law import section_loss
from scenarios.wearing.service import SIDES, Ride, Service, Tell
from scenarios.wearing.sizes import Sizes, sizes
from scenarios.wearing.wheel import WornWheel

AMPLITUDE = 3e-3  # m, of the conicity that is told, as EN 14363 has it
SHIFTS = np.linspace(-7e-3, 7e-3, 281)  # m, of the table for it
PER_KM = 1e-3


@dataclass(frozen=True)
class Plan:
    """How far wheels wear: km, and by how much at most, m, before they are run again.

    both_ways: whether the vehicle runs in both directions, so that both sides wear alike.
    """

    km: float
    step: float = 4e-5
    both_ways: bool = False

    def __post_init__(self) -> None:
        for name, value, unit in (("--km", self.km, "km"), ("--step", self.step, "m")):
            if not (np.isfinite(value) and value > 0):
                raise BadInput(f"{name} {value:g}: give a number of {unit} above 0")


@dataclass(frozen=True)
class State:
    """Both wheels after a way, km, how they touch, and what the service does to them from there on.

    track: with these wheels; conicity: at 3 mm, nan where there is none; T_gamma: mean of each side, N, over
    the way; at_flange: share of it at the flange; rate: loss of section of each side, m2 by m of way.
    """

    km: float
    wheels: Mapping[str, WornWheel]
    track: Track
    sizes: Mapping[str, Sizes]
    conicity: float
    T_gamma: Mapping[str, float]
    at_flange: Mapping[str, float]
    rate: Mapping[str, float]


@dataclass(frozen=True)
class Evolution:
    """States over mileage, the first with new wheels; ended: why it ends before the way asked for."""

    service: Service
    plan: Plan
    states: tuple[State, ...]
    ended: str = ""


def evolved(service: Service, plan: Plan, folder: Path, tell: Tell = lambda _: None) -> Evolution:
    """The states of the wheels over the plan's mileage; their profiles are written into a folder.

    What was found is kept where the evolution cannot go on: where the vehicle derails or the wheels no
    longer fit the rails. BadInput where this is so of the new wheels.
    """
    wheels = new_wheels(service.track)
    states: list[State] = []
    km, track = 0.0, service.track
    while True:
        at = f"{km:.0f} of {plan.km:g} km"
        try:
            rides = list(service.rides(_options(service.track, track), partial(_told, tell, at)))
            tell(f"{at}: wearing the wheels")
            prints = footprints(track, _reach(track))
            _check_on_rails(rides, prints)
        except (BadInput, FmuError) as error:
            if not states:
                raise
            return Evolution(service, plan, tuple(states), f"at {km:.0f} km: {error}")
        depth = _depths(rides, prints, track, plan)
        states.append(_state(km, wheels, track, rides, depth, prints))
        if km >= plan.km:
            return Evolution(service, plan, tuple(states))
        most = max(float(d.max()) for d in depth.values())
        left = (plan.km - km) / PER_KM
        way = min(plan.step / most, left) if most > 0 else left
        km = km + way * PER_KM if way < left else plan.km
        wheels = {s: w.after(prints[s].eta, way * depth[s]) for s, w in wheels.items()}
        try:
            track = worn_track(service.track, wheels, folder, len(states), km)
        except BadInput as error:
            return Evolution(service, plan, tuple(states), f"at {km:.0f} km: {error}")


def _told(tell: Tell, at: str, what: str) -> None:
    tell(f"{at}: {what}")


def new_wheels(track: Track) -> dict[str, WornWheel]:
    """The points of both new wheels."""
    return {side: WornWheel.of(pair.wheel, pair.r0) for side, (pair, _) in track.sides.named.items()}


def worn_track(new: Track, wheels: Mapping[str, WornWheel], folder: Path, number: int, km: float) -> Track:
    """The track with worn wheels, whose profiles are written into the folder; one file if both are alike."""
    left, right = wheels["left"], wheels["right"]
    alike = new.alike and np.array_equal(left.z, right.z) and np.array_equal(left.y, right.y)
    files = {}
    for side in ("left",) if alike else SIDES:
        name = f"wheel_{number:03d}_{km:07.0f}km" if alike else f"wheel_{side}_{number:03d}_{km:07.0f}km"
        about = f"wheel after {km:.0f} km" if alike else f"{side} wheel after {km:.0f} km"
        files[side] = str(wheels[side].write(folder / f"{name}.txt", about))
    if alike:
        return replace(new, wheel=files["left"], r0=left.radius, wheel_right="", r0_right=0.0)
    return replace(
        new, wheel=files["left"], r0=left.radius, wheel_right=files["right"], r0_right=right.radius
    )


def _options(new: Track, track: Track) -> dict[str, Any]:
    """Build options of the wheels of a state; none for new wheels, which the scenario states."""
    if track == new:
        return {}
    return {name: getattr(track, name) for name in ("wheel", "wheel_right", "r0", "r0_right")}


def _reach(track: Track) -> float:
    return float(default_shifts(track.sides)[-1])


def _check_on_rails(rides: Sequence[Ride], prints: Mapping[str, Footprint]) -> None:
    """BadInput where a wheel has gone further than where it touches."""
    for ride in rides:
        far = float(np.max(np.abs(ride.shift)))  # nan where the motion diverges
        if not far <= prints[ride.side].reach:
            how = f"is shifted by {1e3 * far:.0f} mm" if np.isfinite(far) else "has no place any more"
            raise BadInput(
                f"the vehicle derails: a {ride.side} wheel {how}; run slower, in wider curves, or with less "
                "friction"
            )


def _depths(
    rides: Sequence[Ride], prints: Mapping[str, Footprint], track: Track, plan: Plan
) -> dict[str, Array]:
    """Depth by the way (m,) on the profile of each side, m/m, as a mean over wheelsets and variants."""
    found = {}
    for side, (pair, _) in track.sides.named.items():
        own = [ride for ride in rides if ride.side == side]
        lost = np.zeros_like(prints[side].eta)
        for ride in own:
            for part in PARTS:
                lost += prints[side].depth(part, ride.shift, _losses(ride, part, prints[side], pair.r0))
        found[side] = lost / sum(float(ride.way.sum()) for ride in own)
    if plan.both_ways:
        left, right = prints["left"], prints["right"]
        over = (found["left"] + np.interp(left.eta, right.eta, found["right"])) / 2
        found = {"left": over, "right": np.interp(right.eta, left.eta, over)}
    return found


def _losses(ride: Ride, part: str, prints: Footprint, radius: float) -> Array:
    """Loss of section (n,) over the way of each sample, m2, in the contacts of a part."""
    area = np.interp(ride.shift, prints.shifts, prints.area[part]) * prints.under(ride.load)
    return section_loss(getattr(ride, part), area, radius) * ride.way


def _state(
    km: float, wheels: Mapping[str, WornWheel], track: Track, rides: Sequence[Ride],
    depth: Mapping[str, Array], prints: Mapping[str, Footprint],
) -> State:  # fmt: skip
    T_gamma, at_flange, rate = {}, {}, {}
    for side in SIDES:
        own = [ride for ride in rides if ride.side == side]
        way = sum(float(r.way.sum()) for r in own)
        flange = sum(float(r.flange @ r.way) for r in own) / way
        T_gamma[side] = flange + sum(float(r.tread @ r.way) for r in own) / way
        at_flange[side] = flange / T_gamma[side] if T_gamma[side] > 0 else 0.0
        rate[side] = float(depth[side] @ prints[side].along)
    named = track.sides.named
    return State(
        km, wheels, track, {side: sizes(pair.wheel) for side, (pair, _) in named.items()},
        _conicity(track), T_gamma, at_flange, rate,
    )  # fmt: skip


def _conicity(track: Track) -> float:
    try:
        return float(equivalent_conicity(contact_table(**track.stands, shifts=SHIFTS), AMPLITUDE))
    except ValueError:
        return float("nan")
