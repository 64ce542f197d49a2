"""The limits of `railfmi estimate` that can change what it says, beside those of filters."""

from dataclasses import dataclass

from estimator.limits import Limits, limit


@dataclass(frozen=True)
class EstimatePolicy(Limits):
    """Limits of start values, of what a model's form leaves open, and of notes and alarms."""

    fewest_samples: int = limit(
        10,
        "samples",
        "fewest samples of a record, and fewest measurements from which an output's noise is found",
        "derivation: a standard deviation from ten samples is known to within a quarter",
    )
    faster: float = limit(
        0.01,
        "of the record's rate",
        "how much more than that a rate may be asked for and still means every sample",
        "convention: as the jitter of a record of which no note is made",
    )
    told_apart: float = limit(
        0.1,
        "standard deviations of the noise",
        "change of the outputs below which a step is not divided further; states that are measured have this "
        "error too",
        "derivation: an error of a tenth of the noise adds half a percent to the innovations' deviation",
    )
    most_parts: int = limit(
        16,
        "parts",
        "largest number of parts into which a step is divided for that, unless `input_parts` says how many",
        "derivation: an error of second order is then a two hundred and fiftieth of that of the whole step",
    )
    undeclared_std: float = limit(
        0.25,
        "distance of the bounds, or the value where there are none",
        "start deviation of a parameter whose deviation is not declared",
        "derivation: the bounds then lie two standard deviations from their middle",
    )
    measured_start: float = limit(
        10.0,
        "standard deviations of the noise",
        "least start deviation of a state that is measured",
        "convention: wide enough that the first measurement decides, not the prior",
    )
    declared_start: float = limit(
        0.1,
        "usual size of the state",
        "start deviation of a state whose start value is declared, and that is not measured",
        "convention: what is declared is known to within a tenth",
    )
    noise_larger: float = limit(
        10.0,
        "times the noise that the roughness of the record shows",
        "second size, beside that noise itself, with which the search for the noise of a sensor begins",
        "convention: noise that is correlated in time is not rough; roughness may show a small part of it",
    )
    correlation_short: float = limit(
        3.0,
        "samples",
        "shortest time of correlation with which the search for it begins",
        "derivation: over fewer samples the noise is hardly told from white noise",
    )
    correlation_middle: float = limit(
        30.0,
        "samples",
        "the time of correlation between the shortest and the longest with which the search begins",
        "convention: three times in ratios of ten, of which one is within a factor of four of the true one",
    )
    correlation_long: float = limit(
        300.0,
        "samples",
        "longest time of correlation with which the search begins",
        "derivation: the 800 samples with which it begins hold few longer ones",
    )
    correlated_share: float = limit(
        0.5,
        "share of the variance",
        "correlated part of a sensor's noise with which the search for it begins",
        "convention: the middle of what is possible",
    )
    lasting_share: float = limit(
        0.01,
        "share of the variance",
        "rounding error that lasts while an output rests, below which it is left out",
        "derivation: a hundredth of the variance is half a hundredth of the noise",
    )
    resting: int = limit(
        16,
        "samples",
        "whose mean tells where between two steps of its sensor an output is, and the shortest rest",
        "derivation: a quarter of the noise, which is at most a step where rounding lasts",
    )
    learnt: float = limit(
        30.0,
        "s",
        "beginning of the record from which the parameters of a model's form learn where to begin, and how "
        "far they may wander",
        "convention: some thirty periods of hunting, yet a small part of a record of minutes",
    )
    widened: float = limit(
        10.0,
        "standard errors of the first run",
        "start deviation of the form's parameters in the second run",
        "derivation: the samples that count twice then carry one percent of the information at the end",
    )
    walk_small: float = limit(
        0.03,
        "start deviations, of the change in one second",
        "smallest random walk of the estimated parameters that is tried where the model's form is open",
        "derivation: over the learnt 30 s a parameter wanders by a sixth of its start deviation",
    )
    walk_middle: float = limit(
        0.1,
        "start deviations, of the change in one second",
        "the walk tried between the smallest and the largest",
        "derivation: three walks in ratios of about the root of ten",
    )
    walk_large: float = limit(
        0.3,
        "start deviations, of the change in one second",
        "largest random walk that is tried",
        "derivation: in 11 s a parameter wanders by its start deviation, and what was before is forgotten",
    )
    rejected: float = limit(
        1.92,
        "log units of likelihood",
        "by how much a walk may be less likely than the best and still not be rejected",
        "derivation: half of 3.84, the 95 % point of chi-square with one degree of freedom",
    )
    inside: float = limit(
        0.02,
        "distance of the bounds",
        "that the start value of a form's parameter keeps from its bounds",
        "convention: at a bound itself the filter's coordinate is infinite",
    )
    moved: float = limit(
        0.1,
        "start deviations",
        "change of an unknown above which its value is no longer the start value",
        "convention: a tenth of what was believed possible is a change that a reader would see",
    )
    at_bound: float = limit(
        0.01,
        "distance of the bounds, or start deviations with one bound",
        "distance from a bound below which a value lies at it",
        "convention: one percent of the range is less than a printed figure shows",
    )
    reach: float = limit(
        2.0,
        "standard errors",
        "distance from a bound above which a value is told apart from it",
        "derivation: the 95 % band of the value then excludes the bound",
    )
    alarm_ends: float = limit(
        0.5,
        "probability",
        "below which an alarm ends",
        "derivation: the quantity is then as likely within its limit as beyond it",
    )


POLICY = EstimatePolicy()
