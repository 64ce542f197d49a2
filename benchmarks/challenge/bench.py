"""The three systems with random conditions of a run, and their simulation with and without effects."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from tests.truth import rig, vehicle, wheelset
from tests.truth.more import NO_MORE, More
from tests.truth.rig_inputs import (
    LARGEST_TORQUE,
    Array,
    Inputs,
    constant_frequency,
    frequency_profile,
    record_frequency,
    torque_profile,
)
from tests.truth.vehicle_inputs import (
    Track,
    measured_rails,
    rough_rails,
    run_over,
    spectrum_rails,
)
from tests.truth.wheelset_track import random_alignment

DURATION = 60.0  # s
SLIDING = 1.0  # m/s, sliding speed above which the wheel locks or spins
FLANGE = 6e-3  # m, lateral shift above which a flange touches
Outputs = dict[str, Array]


class Simulate(Protocol):
    """Outputs without noise of a simulation with effects, from the start state of one with `like`."""

    def __call__(self, more: More, like: More) -> Outputs: ...


class Replay(Protocol):
    """As Simulate without effects, with the inputs as they are recorded; no range of the model is checked."""

    def __call__(self, recorded: Outputs, like: More) -> Outputs: ...


@dataclass(frozen=True)
class Bench:
    """The conditions of a run: inputs, noise, true parameters, and functions to simulate and declare it.

    strength: stiffness and damping at a location; toml: text of the experiment file from name and effects.
    """

    t: Array
    inputs: Outputs
    noise: Mapping[str, float]
    true: Mapping[str, float]
    simulate: Simulate
    replay: Replay
    strength: Callable[[str], tuple[float, float]]
    toml: Callable[[str, More], str]


def within(bounds: vehicle.Bounds, rng: np.random.Generator) -> dict[str, float]:
    """True values drawn from the inner three quarters of their bounds."""
    return {
        name: float(rng.uniform(low + (high - low) / 8, high - (high - low) / 8))
        for name, (low, high) in bounds.items()
    }


def noisy(usual: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Noise of each output, 0.8 to 1.25 times the usual value."""
    return {name: float(f"{value * rng.uniform(0.8, 1.25):.3g}") for name, value in usual.items()}


def as_recorded(exact: Array, samples: Array) -> Array:
    """An input (k (n - 1) + 1,) at even times with the noise of its samples (n,), k intervals apart.

    Between the samples the noise is linear.
    """
    finer = (len(exact) - 1) // (len(samples) - 1)
    noise = samples - exact[::finer]
    return exact + np.interp(np.arange(len(exact)) / finer, np.arange(len(samples)), noise)


def rig_bench(rng: np.random.Generator, conditions: Collection[str], lowest_mu0: float = 0.0) -> Bench:
    """The test rig; conditions: "plain" (r_w may be off too, or one speed), "one speed", "low torque".

    lowest_mu0: largest decrease of mu0, for which the requested torque must still be transmitted.
    """
    extra = str(rng.choice(["", *rig.UNCERTAIN], p=[0.4, 0.2, 0.2, 0.2]))
    bounds = dict(rig.MU0_BOUNDS)
    if extra and (extra != "r_w" or "plain" in conditions):
        bounds[extra] = rig.UNCERTAIN[extra]
    true = within(bounds, rng)
    p = replace(rig.Rig(), **true)  # type: ignore[arg-type]  # pole_pairs is not among them
    held = min(LARGEST_TORQUE, 0.8 * (p.mu0 + lowest_mu0) * p.N * p.r_w)
    t: Array = np.arange(round(DURATION / 0.005) + 1, dtype=np.float64) * 0.005
    T_P = torque_profile(t, rng, held * (0.3 if "low torque" in conditions else 1.0))
    several = (record_frequency, frequency_profile)[rng.integers(2)]
    alone = "one speed" in conditions or ("plain" in conditions and rng.uniform() < 0.3)
    inputs = Inputs(t, T_P, (constant_frequency if alone else several)(t, rng))
    noise = rig.NOISE * rng.uniform(0.8, 1.25)

    def start(more: More) -> tuple[float, float]:
        return rig.steady_state(inputs, p, rig.Effects(more=more))

    def simulate(more: More, like: More) -> Outputs:
        omega_w, omega_r = rig.simulate(inputs, p, rig.Effects(more=more), start(like))
        if np.abs(p.r_w * omega_w - p.r_r * omega_r).max() > SLIDING:
            raise ValueError("more: the wheel locks or spins")
        return {"omega_w": omega_w, "omega_r": omega_r}

    def replay(recorded: Outputs, like: More) -> Outputs:
        found = rig.simulate(Inputs(t, **recorded), p, rig.Effects(), start(like))
        return dict(zip(rig.OUTPUTS, found, strict=True))

    return Bench(
        t,
        {"T_P": T_P, "f_sync": inputs.f_sync},
        dict.fromkeys(rig.OUTPUTS, round(noise, 5)),
        true,
        simulate,
        replay,
        lambda place: (0.0, 0.0),
        lambda name, more: rig.experiment_toml(
            name, DURATION, rig.Rig(), bounds, start(more), round(noise, 5)
        ),
    )


def vehicle_bench(rng: np.random.Generator, conditions: Collection[str]) -> Bench:
    """The vehicle at 15 to 25 m/s on one of three kinds of track."""
    true, noise = within(vehicle.UNCERTAIN, rng), noisy(vehicle.NOISE, rng)
    p, V = replace(vehicle.Vehicle(), **true), float(rng.uniform(15.0, 25.0))
    rails = (spectrum_rails, rough_rails, measured_rails)[rng.integers(3)](rng, V * DURATION)
    step = 0.005 / vehicle.FINER
    fine: Array = np.arange(vehicle.FINER * round(DURATION / 0.005) + 1, dtype=np.float64) * step
    rows = slice(None, None, vehicle.FINER)
    track = run_over(rails, fine, V, p.a1 + p.a2)

    def simulate(more: More, like: More) -> Outputs:
        effects, under = vehicle.Effects(more=more), track
        if more.kinks:
            kinked = run_over(vehicle.with_kinks(rails, more.kinks), fine, V, p.a1 + p.a2)
            under = Track(fine, kinked.u, kinked.u_dot)
        return seen(vehicle.passed(under, effects), effects)

    def replay(recorded: Outputs, like: More) -> Outputs:
        u, u_dot = track.u.copy(), track.u_dot.copy()
        for i, c in enumerate(vehicle.CORNERS):
            u[:, i] = as_recorded(u[:, i], recorded[f"u_{c}"])
            u_dot[:, i] = as_recorded(u_dot[:, i], recorded[f"u_{c}_dot"])
        return seen(Track(fine, u, u_dot), vehicle.Effects())

    def seen(under: Track, effects: vehicle.Effects) -> Outputs:
        motion = vehicle.simulate(under, p, effects, fine[rows])
        return {name: motion.output(name) for name in noise}

    def strength(place: str) -> tuple[float, float]:
        return (p.k1, p.b1) if place.startswith("secondary") else (p.n_primary * p.k2, p.n_primary * p.b2)

    inputs = {f"u_{c}": track.u[rows, i] for i, c in enumerate(vehicle.CORNERS)}
    inputs |= {f"u_{c}_dot": track.u_dot[rows, i] for i, c in enumerate(vehicle.CORNERS)}
    return Bench(
        fine[rows],
        {name: inputs[name] for name in vehicle.INPUTS},
        noise,
        true,
        simulate,
        replay,
        strength,
        lambda name, more: vehicle.experiment_toml(
            name, DURATION, vehicle.Vehicle(), vehicle.UNCERTAIN, noise
        ),
    )


def wheelset_bench(rng: np.random.Generator, conditions: Collection[str]) -> Bench:
    """The wheelset at 40 m/s on random alignment, with the contact form of the model or a similar one."""
    true, noise = within(wheelset.UNCERTAIN, rng), noisy(wheelset.NOISE, rng)
    true["k_S"] = min(true["k_S"], true["k_A"])
    p, form = replace(wheelset.Wheelset(), **true), (wheelset.SAME, wheelset.OTHER)[rng.integers(2)]
    t: Array = np.arange(round(DURATION / 0.001) + 1, dtype=np.float64) * 0.001
    run = random_alignment(rng, t, deviation=0.81e-3 * rng.uniform(0.6, 1.2))

    def simulate(more: More, like: More) -> Outputs:
        effects = wheelset.Effects(more=more)
        arrived = wheelset.passed(run, effects)
        states = wheelset.simulate(arrived, p, effects, form)
        if np.abs(states[:, 0] - arrived.y_irr[::2]).max() > FLANGE:
            raise ValueError("more: a flange touches")
        return seen(states)

    def replay(recorded: Outputs, like: More) -> Outputs:
        y, y_dot = (
            as_recorded(run.y_irr, recorded["y_irr"]),
            as_recorded(run.y_irr_dot, recorded["y_irr_dot"]),
        )
        return seen(wheelset.simulate(replace(run, y_irr=y, y_irr_dot=y_dot), p, wheelset.Effects(), form))

    def seen(states: Array) -> Outputs:
        return {name: states[:, wheelset.COORDINATES.index(name)] for name in noise}

    def strength(place: str) -> tuple[float, float]:
        if place == "primary_lateral":
            return 2 * p.k_y, 2 * p.b_y
        return 2 * p.d**2 * p.k_x, 2 * p.d**2 * p.b_x

    return Bench(
        t,
        {"y_irr": run.y_irr[::2], "y_irr_dot": run.y_irr_dot[::2]},
        noise,
        true,
        simulate,
        replay,
        strength,
        lambda name, more: wheelset.experiment_toml(
            name, DURATION, run.V, wheelset.Wheelset(), wheelset.UNCERTAIN, noise
        ),
    )


BENCHES = {"vehicle": vehicle_bench, "wheelset": wheelset_bench}


def bench(
    system: str, rng: np.random.Generator, conditions: Collection[str] = (), lowest_mu0: float = 0.0
) -> Bench:
    """The bench of a system with random conditions."""
    if system == "rig":
        return rig_bench(rng, conditions, lowest_mu0)
    return BENCHES[system](rng, conditions)


__all__ = ["DURATION", "NO_MORE", "Bench", "Outputs", "bench"]
