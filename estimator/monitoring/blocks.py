"""Statistics of the innovations of a filter over blocks of equal length, each close to standard normal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimator.monitoring.policy import POLICY
from estimator.record import Array

Kind = Literal["bias", "NIS", "whiteness", "likeness"]


@dataclass(frozen=True)
class Statistic:
    """What a statistic measures; of: the output, or the effect that the innovations are compared with."""

    kind: Kind
    of: str = ""

    @property
    def name(self) -> str:
        """As in reports: 'bias of omega_w'."""
        return f"{self.kind} of {self.of}" if self.of else self.kind

    @property
    def sentence(self) -> str:
        """What an unusual value of it says."""
        return {
            "bias": f"the innovations of '{self.of}' are not about zero",
            "NIS": "the innovations are larger or smaller than the filter expects",
            "whiteness": f"successive innovations of '{self.of}' are correlated",
            "likeness": f"the innovations are like the effect of {self.of}",
        }[self.kind]


def statistics(outputs: Sequence[str], effects: Sequence[str]) -> tuple[Statistic, ...]:
    """The statistics of a block, in the order of `block_statistics`."""
    return (
        *(Statistic("bias", o) for o in outputs), Statistic("NIS"),
        *(Statistic("whiteness", o) for o in outputs), *(Statistic("likeness", e) for e in effects),
    )  # fmt: skip


def block_statistics(innovation: Array, nis: Array, freedom: Array, directions: Array) -> Array:
    """The statistics (2 m + 1 + d,) of a block of L samples; nan where too little was measured.

    innovation: (L, m) over its standard deviation, nan where nothing was measured; nis, freedom: (L,)
    normalised squares and their degrees of freedom; directions: (d, m) by which the innovations would change
    for each effect, of unit length, or zero where an effect would change nothing.

    If model and noise are right, the innovations are white with unit variance. Then the scaled sums of the
    innovations, of their products with their predecessors, and of their parts along the directions have zero
    mean and unit variance. The sum of the NIS is chi-square, made normal by its cube root (Wilson and
    Hilferty, PNAS 17 (1931) 684).
    """
    there = np.isfinite(innovation)
    filled = np.where(there, innovation, 0.0)
    count = there.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        bias = filled.sum(axis=0) / np.sqrt(count)
        pairs = (there[1:] & there[:-1]).sum(axis=0)
        whiteness = (filled[1:] * filled[:-1]).sum(axis=0) / np.sqrt(pairs)
        d = float(freedom.sum())
        size = (np.cbrt(nis.sum() / d) - (1 - 2 / (9 * d))) / np.sqrt(2 / (9 * d)) if d else np.nan
    bias[count < POLICY.fewest_samples] = np.nan
    whiteness[pairs < POLICY.fewest_samples] = np.nan
    likeness = directions @ np.where(np.isfinite(bias), bias, 0.0)
    likeness[~directions.any(axis=1)] = np.nan
    return np.concatenate([bias, [size if d >= POLICY.fewest_samples else np.nan], whiteness, likeness])
