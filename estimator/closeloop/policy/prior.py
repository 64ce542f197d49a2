"""What is held probable before a record is seen."""

from dataclasses import dataclass

from estimator.limits import limit


@dataclass(frozen=True)
class PriorPolicy:
    """What is held probable before a record is seen; see estimator/closeloop/probability.py.

    Within these shares, all kinds and places are equally probable.
    """

    effect: float = limit(
        0.5,
        "probability",
        "probability that a record holds an effect or a faulty sensor",
        "convention: nothing is known about a record before it is seen",
    )
    outside: float = limit(
        0.2,
        "share of the records with an effect",
        "share whose effect is not in the library",
        "convention: one in five; only a record in which noise hides most of an effect is sensitive to it",
    )
    pair: float = limit(
        0.1,
        "share of the records with effects of the library",
        "share in which two effects act",
        "convention: two independent effects of which each is as probable as one in ten",
    )
    left: float = limit(
        0.01,
        "share of the sum of squares beyond noise",
        "share that a right answer leaves on average if the model form is right",
        "agreed assumption: as `alike`, the form is right to within small differences",
    )
    left_open: float = limit(
        0.05,
        "share of the sum of squares beyond noise",
        "share that a right answer leaves on average if the model form is open",
        "convention: five times `left`",
    )
    material: float = limit(
        0.01,
        "share of an output's rms",
        "largest size that the form of a right model leaves on average, as far as its order is known",
        "convention: half of `signal_share`, so that one right model in seven at most leaves what matters",
    )
    coloured: float = limit(
        0.5,
        "probability",
        "probability that undeclared noise is not white, so that a right answer may leave any share",
        "convention: nothing is known about noise of which nothing is said",
    )
