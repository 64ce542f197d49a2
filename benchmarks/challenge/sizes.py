"""Random draws of the sizes of effects, from hardly visible to obvious."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

Draw = Callable[[np.random.Generator], float]


def log(low: float, high: float) -> Draw:
    """A draw uniform in the logarithm."""
    return lambda rng: rounded(low * (high / low) ** rng.uniform())


def flat(low: float, high: float) -> Draw:
    """A uniform draw."""
    return lambda rng: rounded(rng.uniform(low, high))


def either(low: float, high: float) -> Draw:
    """A draw uniform in the logarithm, with a random sign."""
    size = log(low, high)
    return lambda rng: size(rng) * float(rng.choice([-1.0, 1.0]))


def one_of(*values: float) -> Draw:
    """A draw of one of the values."""
    return lambda rng: float(rng.choice(values))


def rounded(value: float) -> float:
    """A value rounded to four digits."""
    return float(f"{value:.4g}")


def drawn(ranges: Mapping[str, Draw], rng: np.random.Generator) -> dict[str, float]:
    """One value drawn from each range."""
    return {name: draw(rng) for name, draw in ranges.items()}


def wave(low: float, high: float, **more: Draw) -> Callable[[np.random.Generator], dict[str, float]]:
    """Draws F_sin and F_cos for an amplitude between low and high with a random phase, and `more`."""

    def of(rng: np.random.Generator) -> dict[str, float]:
        amplitude, phase = log(low, high)(rng), rng.uniform(0, 2 * np.pi)
        parts = {"F_sin": rounded(amplitude * np.cos(phase)), "F_cos": rounded(amplitude * np.sin(phase))}
        return {**parts, **drawn(more, rng)}

    return of
