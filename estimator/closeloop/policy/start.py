"""How a measured start state is guessed first."""

from dataclasses import dataclass

from estimator.limits import limit


@dataclass(frozen=True)
class StartPolicy:
    """Limits of the first guess of a measured start state, by a polynomial through the first samples."""

    samples: int = limit(
        20,
        "samples",
        "largest number of first samples through which the polynomial is laid",
        "convention: a motion with less than one turn within them is followed by the degrees that are tried",
    )
    fewest: int = limit(
        8,
        "samples",
        "smallest number of first samples that is tried",
        "derivation: the guess by a line through them has two thirds of the noise as its error",
    )
    apart: int = limit(
        4,
        "samples",
        "by which the numbers of first samples that are tried differ",
        "derivation: the error by a line changes by a sixth at most from one number to the next",
    )
    degree: int = limit(
        6,
        "powers",
        "highest degree of the polynomial",
        "derivation: follows one turn within the samples to a hundredth of its amplitude",
    )
    spare: int = limit(
        4,
        "samples",
        "samples more than coefficients, from whose misfit the noise is estimated",
        "derivation: the estimate scatters by a third of the noise",
    )
    error: float = limit(
        3.0,
        "times the scatter",
        "bound of the error of the guess within which the start state is fitted",
        "derivation: 1 in 370 by the normal distribution",
    )
