"""How 95 % intervals are confirmed."""

from dataclasses import dataclass

from estimator.limits import limit


@dataclass(frozen=True)
class IntervalPolicy:
    """Limits of the 95 % intervals: how they are confirmed, and when they lead to another optimum."""

    bent: float = limit(
        0.15,
        "share of a residual's change",
        "share by which the slopes of an answer may miss the change of its residual at the end of a 95 % "
        "interval; else the likelihood profile is followed to the end",
        "D. M. Bates, D. G. Watts, Nonlinear Regression Analysis (1988), 7.3: a curvature of 0.3, which "
        "departs from the tangent by half of it",
    )
    deeper: float = limit(
        4.0,
        "sum of squares, in units of the noise",
        "reduction at a place that an interval holds, above which the answer is fitted again from there",
        "derivation: the interval ends where the sum of squares has risen by 1.96 squared; a place as much "
        "lower means that the interval does not hold the optimum",
    )
