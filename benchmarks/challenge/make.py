"""Creation of a record from its plan: it is simulated with and without its effects, and noise is added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.challenge.bench import (
    NO_MORE,
    Bench,
    Outputs,
    bench,
)
from benchmarks.challenge.draw import Plan
from benchmarks.challenge.measuring import WAYS
from benchmarks.challenge.menu import OUTPUTS
from benchmarks.challenge.truth import Item, Truth
from estimator.record import Array
from estimator.sensor_faults import FAULTS
from tests.truth.more import More, made
from tests.truth.rig import measured
from tests.truth.rig_effects import SensorFault
from tests.truth.wheelset_effects import CONDITIONS, FRICTION
from tests.truth.wheelset_motion import Wheelset

LOWEST = 60.0  # s, duration of a drift of mu0
SHARE = {"limit_share": "limit", "slew_share": "slew"}
WORSE = ("wet", "low", "very_low")  # friction conditions with less friction than dry
DIGITS = 8
LEFT = ("single", "double")  # groups of which it is said what calibration leaves, as this takes simulations
SMALL = 1e-3  # share by which a calibrated parameter is changed to see what calibration can do
ATTEMPTS = 20
FAINT = 2.0  # times the noise; close-loop may ignore a smaller sensor fault as too small to matter
IDENTIFY = 0.6  # share of the record that is the part to identify
LATE = 0.1  # smallest ratio of the effect's size in the part to identify to that in the whole record


def make(plan: Plan, seed: int, records: Path, truths: Path) -> Truth:
    """Write the folder of a record, then the file with its truth; an existing record is kept.

    Sizes are drawn again if the system leaves the range of its model (a wheel locks, a flange touches), if a
    sensor fault is small against the noise, or if the effect hardly acts in the part to identify. If a sensor
    moves too little for a fault of the kind, the next sensor of the system is used.
    Raises ValueError if no draw is accepted.
    """
    told = truths / f"{plan.name}.json"
    if told.exists():
        return Truth.read(told)
    draws = (here for here in (plan, *elsewhere(plan)) for _ in range(ATTEMPTS))
    for attempt, here in enumerate(draws):
        try:
            truth, text, columns = tried(here, np.random.default_rng([seed, plan.index, attempt]))
        except ValueError as error:
            why = error
            continue
        write(records / plan.name, text, columns)
        truth.write(told)
        return truth
    kinds = " and ".join(f"{e.kind}@{location}" for e, location in plan.entries)
    raise ValueError(f"{plan.name}: {ATTEMPTS} draws of {kinds} failed, the last: {why}")


def elsewhere(plan: Plan) -> list[Plan]:
    """Plans with the same fault at the other sensors of the system; none if the plan is no sensor fault."""
    if plan.group != "sensor":
        return []
    ((fault, at),) = plan.entries
    outputs = OUTPUTS[plan.system]
    own = outputs.index(at)
    return [replace(plan, entries=((fault, o),)) for o in (*outputs[own + 1 :], *outputs[:own])]


def tried(plan: Plan, rng: np.random.Generator) -> tuple[Truth, str, Outputs]:
    """A record with one draw of conditions and sizes: its truth, experiment.toml and data columns."""
    raw = [(e, location, e.sizes(rng)) for e, location in plan.entries]
    here = bench(plan.system, rng, plan.conditions, _lowest_mu0([(p, s) for _, p, s in raw]))
    items = tuple(Item(e.kind, p, settled(e.kind, p, sizes, here)) for e, p, sizes in raw)
    runs = Runs.of(items, here)
    early, whole = (max(ratios(here, runs.with_it, runs.sound, part).values()) for part in (IDENTIFY, 1.0))
    if early < LATE * whole:
        raise ValueError(f"{early:.2f} times the noise in the part to identify, {whole:.2f} in all")
    if plan.group == "sensor" and whole < FAINT:
        raise ValueError(f"the fault is {whole:.2f} times the noise")
    measuring, text = WAYS[plan.way](rng), here.toml(plan.name, runs.like)
    seen = measuring.outputs(here.t, runs.with_it, here.noise)
    inputs = measuring.inputs(here.t, here.inputs)
    noise = noise_left(here, runs, inputs) if items else here.noise
    truth = told(plan, items, here, runs, replace(here, noise=noise))
    return truth, measuring.said(text), {"time": here.t, **inputs, **seen}


def _lowest_mu0(sizes: list[tuple[str, dict[str, Any]]]) -> float:
    """The largest decrease of mu0 during a run, as a negative number."""
    at_mu0 = [s for place, s in sizes if place == "mu0"]
    return min((s.get("delta", 0.0) + LOWEST * s.get("rate", 0.0) for s in at_mu0), default=0.0)


def settled(kind: str, location: str, sizes: dict[str, Any], here: Bench) -> dict[str, Any]:
    """Parameters of an effect in the units of docs/effects.md, from drawn sizes relative to the run."""
    found = dict(sizes)
    for share, name in SHARE.items():
        if share in found:
            part = found.pop(share) * float(np.abs(here.inputs[location]).max())
            found["band" if kind == "dead_band" else name] = part
    if kind == "free_play":
        found = {"k": here.strength(location)[0], **found}
    if location == "friction_condition":
        worse = CONDITIONS[WORSE[int(found.pop("condition")) - 1]]
        now = {n: here.true.get(n, getattr(Wheelset(), n)) for n in FRICTION}
        found |= {f"delta_{n}": v - now[n] for n, v in zip(FRICTION, worse, strict=True)}
    if kind in FAULTS and "{}" in FAULTS[kind].unit:  # sizes are in units of the noise, at the record's end
        part = here.noise[location] / (float(here.t[-1]) if FAULTS[kind].unit == "{}/s" else 1.0)
        found = {name: value * part for name, value in found.items()}
    return found


def effect_of(items: tuple[Item, ...], here: Bench) -> More:
    """All effects except sensor faults, in the form of the truth models."""
    more = NO_MORE
    for item in items:
        if item.is_fault:
            continue
        p: dict[str, Any] = dict(item.parameters)
        if item.kind in ("stiffness_change", "damping_change"):
            k, b = here.strength(item.location)
            change = p.pop("change")
            p |= {"k": change * k} if item.kind == "stiffness_change" else {"c": change * b}
        if item.kind == "free_play":
            p["k"] = here.strength(item.location)[0]
        if item.location == "friction_condition":
            t0 = p.pop("t0")
            for name, delta in p.items():
                more += made(item.kind, name.removeprefix("delta_"), delta=delta, t0=t0)
            continue
        p = {n: tuple(v) if isinstance(v, list) else v for n, v in p.items()}
        more += made(item.kind, item.location, **p)
    return more


def fault_of(items: tuple[Item, ...], output: str) -> SensorFault:
    """The sensor fault of an output."""
    found = {}
    for item in items:
        if item.is_fault and item.location == output:
            found = {n: 1 + v if n == "gain" else v for n, v in item.parameters.items()}  # type: ignore[operator]
    return SensorFault(**found)  # type: ignore[arg-type]


def shown(here: Bench, clean: Outputs, items: tuple[Item, ...]) -> Outputs:
    """The outputs as measured by the sensors without noise."""
    still = np.random.default_rng(0)
    return {o: measured(here.t, y, fault_of(items, o), 0.0, still) for o, y in clean.items()}


def ratios(here: Bench, with_it: Outputs, without: Outputs, part: float = 1.0) -> dict[str, float]:
    """Rms of the difference over the noise, by output; part: share of the record from its start."""
    seen = here.t <= part * here.t[-1]
    return {
        o: float(np.sqrt(np.mean((with_it[o] - without[o])[seen] ** 2)) / noise)
        for o, noise in here.noise.items()
    }


@dataclass(frozen=True)
class Runs:
    """Outputs without noise: as measured with all effects, without any, and with each one alone.

    like: all effects, from whose start state each run begins.
    """

    like: More
    with_it: Outputs
    sound: Outputs
    alone: Sequence[Outputs]

    @classmethod
    def of(cls, items: tuple[Item, ...], here: Bench) -> Runs:
        """The runs of these effects."""
        like = effect_of(items, here)
        clean = here.simulate(like, like)
        with_it = shown(here, clean, items)
        sound = clean if like == NO_MORE else here.simulate(NO_MORE, like)
        alone = [with_it]
        if len(items) > 1:
            alone = [shown(here, here.simulate(effect_of((i,), here), like), (i,)) for i in items]
        return cls(like, with_it, sound, alone)


def noise_left(here: Bench, runs: Runs, inputs: Outputs) -> Mapping[str, float]:
    """Noise by output of what a right model leaves: the sensor's, and what noise of recorded inputs does."""
    if all(inputs[n] is u for n, u in here.inputs.items()):
        return here.noise
    driven = ratios(here, here.replay(inputs, runs.like), runs.sound)
    return {o: noise * float(np.hypot(1.0, driven[o])) for o, noise in here.noise.items()}


def told(plan: Plan, items: tuple[Item, ...], here: Bench, runs: Runs, seen: Bench) -> Truth:
    """The truth with its signal-to-noise ratios; seen: the bench with the noise that these count."""
    return Truth(
        plan.name,
        plan.group,
        plan.system,
        items,
        here.true,
        here.noise,
        ratios(seen, runs.with_it, runs.sound) if items else {},
        tuple(pair for e, _ in plan.entries for pair in e.near),
        plan.quiet,
        plan.note,
        tuple(max(ratios(seen, y, runs.sound).values()) for y in runs.alone) if len(items) > 1 else (),
        left_over(seen, runs) if plan.group in LEFT else (),
        plan.way,
    )


def left_over(here: Bench, runs: Runs) -> tuple[float, ...]:
    """For each effect the largest ratio of an output of what is left after calibration, to first order.

    The calibration changes the calibrated parameters by whatever makes the sum of squares least, and other
    effects too have the size that does.
    """

    def change(y: Outputs) -> Array:
        return np.concatenate([(y[o] - runs.sound[o]) / noise for o, noise in here.noise.items()])

    moved = [made("parameter_offset", n, delta=SMALL * value) for n, value in here.true.items()]
    calibrated = [change(here.simulate(m, runs.like)) for m in moved]
    changes = [change(y) for y in runs.alone]
    found = []
    for i, own in enumerate(changes):
        free = np.column_stack([*calibrated, *changes[:i], *changes[i + 1 :]])
        free /= np.maximum(np.linalg.norm(free, axis=0), np.finfo(float).tiny)
        rest = own - free @ np.linalg.lstsq(free, own)[0]
        found.append(float(max(np.sqrt(np.mean(y**2)) for y in np.split(rest, len(here.noise)))))
    return tuple(found)


def write(home: Path, text: str, columns: Outputs) -> None:
    """Write experiment.toml and data.csv, as for a measured record."""
    home.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([*columns.values()])
    head = ",".join(columns)
    np.savetxt(home / "data.csv", table, fmt=f"%.{DIGITS}g", delimiter=",", header=head, comments="")
    (home / "experiment.toml").write_text(text, encoding="utf-8")
