"""Which hypotheses are fitted, and how far."""

from dataclasses import dataclass

from estimator.closeloop.policy.source import CHALLENGE
from estimator.limits import limit


@dataclass(frozen=True)
class SearchPolicy:
    """Limits of the search: which hypotheses are fitted and how far. More fits take more time."""

    nominees: int = limit(
        16,
        "effects",
        "effects of the screening that are fitted, best first; half as many with a foreign FMU",
        CHALLENGE,
    )
    nominees_in_shapes: int = limit(
        6,
        "effects",
        "leading effects that are fitted from several start values of their shape parameters",
        CHALLENGE,
    )
    shapes_of_nominee: int = limit(
        2,
        "shapes",
        "start values of the shape parameters that are tried for each of these effects",
        CHALLENGE,
    )
    nominated_faults: int = limit(
        4, "faults", "sensor faults of the screening that are fitted, best first", CHALLENGE
    )
    overlooked_share: float = limit(
        0.2,
        "share of the sum of squares beyond noise",
        "with an open model form, more effects are fitted if the best fit leaves more than this",
        CHALLENGE,
    )
    overlooked_more: int = limit(
        6,
        "effects",
        "effects that are fitted then, beside all constant changes of parameters and inputs",
        CHALLENGE,
    )
    likely_fault: float = limit(
        0.5,
        "share of the sum of squares beyond noise",
        "a sensor fault that could explain more than this is fitted before the effects",
        CHALLENGE,
    )
    rival_of_fault: float = limit(
        0.7,
        "share of the fault's expected gain",
        "after a sensor fault that explains the residual, effects that could gain less are not fitted",
        CHALLENGE,
    )
    placebos: int = limit(
        3,
        "effects",
        "effects that are fitted after such a sensor fault in any case, for comparison",
        CHALLENGE,
    )
    sudden: int = limit(
        4,
        "effects",
        "effects with a detected onset that are fitted jointly with the calibrated parameters",
        CHALLENGE,
    )
    sets_in_times: float = limit(
        9.0,
        "times the mean square before",
        "mean square of the residual after an onset, above which the onset is detected",
        CHALLENGE,
    )
    sets_in_times_open: float = limit(
        2.0,
        "times the mean square before",
        "replaces `sets_in_times` if the residual could come from the open model form",
        CHALLENGE,
    )
    sets_in_chance: float = limit(
        1e-5,
        "probability",
        "p-value of the Mann-Whitney test of the blocks after an onset against those before, to detect it",
        CHALLENGE,
    )
    sudden_fits: int = limit(
        12,
        "effects",
        "effects with a detected onset that are first fitted to a short part of the record after it",
        CHALLENGE,
    )
    finalists: int = limit(
        5, "hypotheses", "hypotheses that are fitted to convergence after the brief fits", CHALLENGE
    )
    finalist_pairs: int = limit(
        2, "pairs", "pairs that are fitted to convergence after the brief fits", CHALLENGE
    )
    first_finalists: int = limit(
        2,
        "hypotheses",
        "hypotheses that are fitted to convergence before the remaining ones are compared with them",
        CHALLENGE,
    )
    rival: float = limit(
        4.0,
        "times the best sum of squares",
        "a hypothesis above this is not fitted to convergence",
        CHALLENGE,
    )
    hopeless: float = limit(
        10.0, "times the best sum of squares", "a brief fit above this is not continued", CHALLENGE
    )
    worth_a_fit: float = limit(
        0.95,
        "times the calibrated FMU's sum of squares",
        "a brief fit above this is not continued",
        CHALLENGE,
    )
    reweighted: int = limit(
        6,
        "hypotheses",
        "hypotheses that are fitted again with the noise of the best fit, if noise is not declared",
        CHALLENGE,
    )
    moved_by_steps: float = limit(
        0.5,
        "standard errors",
        "movement of an unknown by halved steps of the simulation, above which those of an answer are "
        "halved, and those of a search do not go over several samples",
        "derivation: a bias of half of an error adds 12 % to it, as `noise_share`",
    )
    parts_of_a_step: int = limit(
        4,
        "parts",
        "largest number of parts into which each usual step of the simulation is divided for that",
        "derivation: an error of second order is then a sixteenth of that of the usual step",
    )
    dated: int = limit(
        3,
        "hypotheses",
        "leading hypotheses whose onset time is searched on a grid, and that are refined if the best one "
        "leaves more than noise",
        CHALLENGE,
    )
    dated_rival: float = limit(
        2.0,
        "times the best sum of squares",
        "above this no onset time is searched and no rival refined",
        CHALLENGE,
    )
    grown: int = limit(
        4,
        "effects",
        "leading effects of the fits, and as many of the beginning, that are fitted to a growing part",
        CHALLENGE,
    )
    grown_survivors: int = limit(
        4, "hypotheses", "hypotheses that are continued after the first growing parts", CHALLENGE
    )
    grown_rival: float = limit(
        4.0,
        "times the best mean square",
        "above this a hypothesis is not continued on a growing part",
        CHALLENGE,
    )
    grown_refined: int = limit(
        2, "hypotheses", "hypotheses that are finally fitted with smaller finite differences", CHALLENGE
    )
    paired: int = limit(
        8, "effects", "leading single effects for which a second effect is searched", CHALLENGE
    )
    partners: int = limit(12, "candidates", "leading candidates whose pairs are all screened", CHALLENGE)
    pairs: int = limit(
        8,
        "pairs",
        "pairs that are fitted from each of the two screenings of pairs",
        "calibrated on the Cascaded Tanks, whose right pair is the sixth of a screening",
    )
    second_effect: float = limit(
        0.25,
        "times an output's noise",
        "rms that a second effect must be expected to explain, if one effect accounts for the residual",
        CHALLENGE,
    )
    lookalike: float = limit(
        0.05,
        "share of the rms of a law's response",
        "a law that reproduces this response with a smaller error is similar to it",
        CHALLENGE,
    )
    lookalikes: int = limit(3, "laws", "laws similar to the best one that are fitted in its place", CHALLENGE)
