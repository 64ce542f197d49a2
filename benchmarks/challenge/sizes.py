"""How the size of an effect is drawn: spreads of physical quantities, from small to plain to see."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

Draw = Callable[[np.random.Generator], float]


def log(low: float, high: float) -> Draw:
    """Evenly over the logarithm."""
    return lambda rng: rounded(low * (high / low) ** rng.uniform())


def flat(low: float, high: float) -> Draw:
    """Evenly."""
    return lambda rng: rounded(rng.uniform(low, high))


def either(low: float, high: float) -> Draw:
    """Evenly over the logarithm, of either sign."""
    size = log(low, high)
    return lambda rng: size(rng) * float(rng.choice([-1.0, 1.0]))


def one_of(*values: float) -> Draw:
    """One of some values."""
    return lambda rng: float(rng.choice(values))


def rounded(value: float) -> float:
    """Four digits: what somebody would write down."""
    return float(f"{value:.4g}")


def drawn(ranges: Mapping[str, Draw], rng: np.random.Generator) -> dict[str, float]:
    """One value of each."""
    return {name: draw(rng) for name, draw in ranges.items()}


def wave(low: float, high: float, **more: Draw) -> Callable[[np.random.Generator], dict[str, float]]:
    """F_sin and F_cos of an amplitude between low and high at any phase, and more."""

    def of(rng: np.random.Generator) -> dict[str, float]:
        amplitude, phase = log(low, high)(rng), rng.uniform(0, 2 * np.pi)
        parts = {"F_sin": rounded(amplitude * np.cos(phase)), "F_cos": rounded(amplitude * np.sin(phase))}
        return {**parts, **drawn(more, rng)}

    return of
