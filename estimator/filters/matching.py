"""Adaptation of a filter's noise: innovations that scatter more than predicted raise it, less lower it."""

from estimator.filters.algebra import compiled
from estimator.filters.policy import POLICY
from estimator.record import Array, BoolArray

MOST, DECLARED = POLICY.most_raised, POLICY.declared_samples


@compiled
def matched(
    innovation: Array, S: Array, R: Array, used: BoolArray, share: float, scatter: Array, ratios: Array,
    counts: Array,
) -> float:  # fmt: skip
    """Match the noise to innovations (m,) with covariance S (m, m), of which R is the noise in use.

    Each square is taken over its own predicted variance. What the filter does not know at its start is
    thereby no noise. Changes with weight `share` the means `scatter` (m,) of these squares, 1 where all is
    as predicted, and the ratios (m,) of the variances to the declared ones; these with more weight while few
    samples were counted (`counts`, (m,)), since a filter that trusts its sensors too much is soon too sure.
    Returns the scatter found over that explained by the process noise.
    """
    explained = found = 0.0
    for i in range(len(innovation)):
        if used[i]:
            square = innovation[i] ** 2 / S[i, i]
            noise = R[i, i] / S[i, i]
            scatter[i] += share * (square - scatter[i])
            counts[i] += 1.0
            ratios[i] *= min(1.0 + max(share, 1.0 / (DECLARED + counts[i])) * (square - 1.0), MOST)
            explained += 1.0 - noise
            found += scatter[i] - noise
    return found / max(explained, 1e-12)
