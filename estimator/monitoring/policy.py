"""The limits of the test of a stream that can change when it alarms, in one object."""

from dataclasses import dataclass

from estimator.limits import Limits, limit


@dataclass(frozen=True)
class MonitoringPolicy(Limits):
    """Limits of blocks, of what is learned from them, and of the sums."""

    fewest_samples: int = limit(
        8,
        "samples",
        "shortest block, and fewest samples of an output in it, for which it has a statistic",
        "derivation: the cube root of a chi-square with 8 degrees of freedom has the normal distribution "
        "function to within 0.002",
    )
    allowance: float = limit(
        0.5,
        "scales of the statistic",
        "by how much a block has to be off before it adds to a sum (k)",
        "derivation: the log likelihood ratio of a shift by one scale grows by a value less half a scale",
    )
    clip: float = limit(
        4.0,
        "scales of the statistic",
        "largest part of a block's deviation that counts",
        "convention: one outlier, as of a radio that fails, must not reach the threshold of any stated rate",
    )
    fewest_batches: int = limit(
        20,
        "batches",
        "fewest means of batches from which a long-run variance is estimated",
        "derivation: with 19 degrees of freedom a variance is known to within a third",
    )
    independent: float = limit(
        30.0,
        "independent blocks",
        "learning ends when the blocks tell as much as so many independent ones",
        "derivation: mean and scale are then known to within a fifth and an eighth of a scale",
    )
    most_correlated: float = limit(
        0.999,
        "correlation",
        "largest correlation of successive blocks; beyond it they wander and have no mean",
        "convention: some thousand blocks would then tell as much as one",
    )
    kept: int = limit(
        8,
        "times the blocks to learn from",
        "blocks that are kept, the last ones, while they are too correlated to learn from",
        "convention: bounds the memory; what is usual is then that of the last eight spans",
    )


POLICY = MonitoringPolicy()
