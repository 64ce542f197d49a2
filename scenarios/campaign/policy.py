"""The limits of a campaign that can change what it says, in one object."""

from dataclasses import dataclass

from estimator.limits import Limits, limit


@dataclass(frozen=True)
class CampaignPolicy(Limits):
    """Limits of Sobol's indices and their intervals."""

    confidence: float = limit(0.95, "probability", "of all intervals", "convention")
    resamples: int = limit(
        999,
        "resamples",
        "resamples of the base points from which an interval is made",
        "derivation: 25 of them lie beyond either end, so that an end is known to a fifth of its distance",
    )
    fewest: int = limit(
        8,
        "base points",
        "fewest complete base points from which indices are computed",
        "calibrated: with 8 the intervals still hold nine times in ten, see docs/campaign.md",
    )
    lowest: float = limit(
        0.05,
        "share of the points",
        "ends of the range of a measure, from below and from above",
        "convention",
    )


POLICY = CampaignPolicy()
