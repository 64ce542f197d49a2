"""Alignment of the track under the true wheelset, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

W_C, W_R = 0.8246, 0.0206  # rad/m, shape of ERRI B176's spectrum of alignment
LONGEST, SHORTEST = 60.0, 3.0  # m, wavelengths; at 40 m/s 0.7 to 13 Hz
LINES = 160
RUN_IN = 40.0  # m, over which the alignment grows from nothing
DEVIATION = 0.8103e-3  # m, thesis Table 3.1
LARGEST = 3.8e-3  # m, there


@dataclass(frozen=True)
class Run:
    """A run at V [m/s] over an alignment, at even times t (n,), s.

    y_irr [m], y_irr_dot [m/s]: (2 n - 1,), at each time and midway to the next.
    """

    V: float
    t: Array
    y_irr: Array
    y_irr_dot: Array


def random_alignment(
    rng: np.random.Generator,
    t: Array,
    V: float = 40.0,
    deviation: float = DEVIATION,
    largest: float = LARGEST,
    shortest: float = SHORTEST,
) -> Run:
    """Random alignment with a standard deviation and a largest value [m], wavelengths from `shortest` [m].

    The deviation is that of the whole run, beyond its run-in; it is reduced where `largest` asks for it.
    """
    times = np.linspace(t[0], t[-1], 2 * len(t) - 1)
    s = V * (times - t[0])
    edges = 2 * np.pi / np.geomspace(LONGEST, shortest, LINES + 1)
    W, dW = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    size = np.sqrt(2 * dW * W_C**2 / ((W**2 + W_R**2) * (W**2 + W_C**2)))
    y, dy = np.zeros_like(s), np.zeros_like(s)
    for amplitude, wave, phase in zip(size, W, rng.uniform(0, 2 * np.pi, LINES), strict=True):
        turn = wave * s + phase
        y += amplitude * np.cos(turn)
        dy -= amplitude * wave * np.sin(turn)
    part = np.clip(s / RUN_IN, 0.0, 1.0)
    grown = part**3 * (10 - 15 * part + 6 * part**2)
    y, dy = grown * y, grown * dy + 30 * part**2 * (1 - part) ** 2 / RUN_IN * y
    scale = min(deviation / y.std(), largest / np.abs(y).max())
    return Run(V, t, scale * y, V * scale * dy)


def shifted_alignment(t: Array, V: float, shift: float, when: float) -> Run:
    """Straight track that jumps sideways by `shift` [m] at time `when` [s], as in the thesis's Fig. 4.25."""
    times = np.linspace(t[0], t[-1], 2 * len(t) - 1)
    return Run(V, t, np.where(times >= when - 1e-9, shift, 0.0), np.zeros_like(times))
