"""When a residual is more than noise, and when it is large enough to matter."""

from dataclasses import dataclass

from estimator.closeloop.policy.source import CHALLENGE
from estimator.limits import limit


@dataclass(frozen=True)
class DetectionPolicy:
    """Limits of the detection: when a residual is more than noise, and when it is large enough to matter."""

    level: float = limit(
        0.01,
        "probability",
        "probability of reporting a discrepancy if the residual is pure noise, over all statistics together; "
        "that checks refuse a right answer; what the least probable members of a class hold together, which "
        "are left out; p-value below which several records have no common value",
        "convention: 2 false reports in 100 records are allowed, and half of that is left to the search",
    )
    replicates: int = limit(
        499,
        "draws",
        "draws of white noise that form the reference distribution of each statistic",
        "derivation: the smallest p-value that they can give, 1 in 500, is a fifth of the level",
    )
    slow_blocks: int = limit(
        40,
        "blocks",
        "blocks of the parts to choose and to test whose means show a residual that is slower than the noise",
        CHALLENGE,
    )
    signal_share: float = limit(
        0.02,
        "share of an output's rms",
        "a residual beyond noise is too small to matter if it is below this and below `noise_share`",
        "agreed default: differences below 2 % of the signal are expected from the form of any model",
    )
    noise_share: float = limit(
        0.5,
        "times the noise",
        "a residual beyond noise is too small to matter if it is below this and below `signal_share`",
        "derivation: half of the noise adds 12 % to an output's rms, which no user of the model would notice",
    )
    chance: float = limit(
        3.0,
        "standard deviations",
        "allowance for chance: how far the mean square or the rms of pure noise may exceed its expectation; "
        "how many times its noise an output must move to show more than noise",
        "derivation: 1 in 700 by the normal distribution",
    )
    roundings: int = limit(
        20,
        "draws",
        "draws of the noise of a sensor that rounds, from which the scatter of its mean square is estimated",
        "derivation: the scatter of twenty draws has an error of a sixth, its square one of a third",
    )
    lags: int = limit(
        20,
        "samples",
        "to both sides, over which residuals of two outputs are compared if their noise is not declared",
        "convention: more lags find what one sensor sees later, and test less well what both see at once",
    )
    open_form_noises: float = limit(
        2.0,
        "times the noise",
        "a residual with a smaller rms does not matter if the model form is open",
        CHALLENGE,
    )
