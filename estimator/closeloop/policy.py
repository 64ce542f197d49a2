"""Every limit that can change an answer, with its value, unit, meaning and source, in one object.

A limit is listed here if another value could lead to another verdict or another effect. Constants that only
change the computing time or the last digits of a result are kept beside the code that uses them.

The source is a paper, a derivation given in words, a convention, or a calibration. A calibration names the
challenge on whose records the value was found; such a limit is empirical.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import Field, dataclass, fields, is_dataclass
from typing import Any

from estimator.limits import Limits, limit

CHALLENGE = "calibrated on the challenges up to seed 591988, frozen at 9217a2d"


@dataclass(frozen=True)
class DetectionPolicy:
    """Limits of the detection: when a residual is more than noise, and when it is large enough to matter."""

    level: float = limit(
        0.01,
        "probability",
        "probability of reporting a discrepancy if the residual is pure noise, over all statistics together",
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
        "allowance for chance: how far the mean square of pure noise may exceed its expectation",
        "derivation: 1 in 700 by the normal distribution",
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


@dataclass(frozen=True)
class InputPolicy:
    """Limits of the noise of the recorded inputs: when it is noise, and how it is smoothed and carried on."""

    segment: int = limit(
        256,
        "samples",
        "shortest segments of an input whose spectra show its white noise",
        "derivation: 64 frequencies in the upper octave, of which two halves can be compared",
    )
    segments: int = limit(
        8,
        "segments",
        "segments into which an input is cut, beside those that overlap two of them",
        "derivation: the median of all scatters by half of its mean at one frequency, by 7 % over the octave",
    )
    flat: float = limit(
        3.0,
        "standard deviations",
        "difference between the two halves of an input's upper octave, above which it is not noise",
        "derivation: 1 in 700, as `chance`",
    )
    levels: int = limit(
        10,
        "scales",
        "scales of the wavelets, each twice as long as the one before; slower noise stays in the input",
        "derivation: the slowest lasts 1024 samples, in whose mean the noise is a thirtieth of its size",
    )
    seen: float = limit(
        1.0,
        "sum of squares, in units of the noise",
        "change of the outputs by smoothing, below which the inputs are left as they were recorded",
        "derivation: one standard error of a quantity with this response, so no fit could show it",
    )
    draws: int = limit(
        4,
        "draws",
        "draws of the noise that stays in the inputs, from which that of the outputs is estimated",
        "derivation: each draw is as long as the record, so that four have half of its scatter",
    )


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
        "leading effects of the fits, and as many of the screening, that are fitted to a growing part",
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
    lookalike_squares: float = limit(
        20.0,
        "sum of squares, in units of the noise",
        "a law with a smaller error is similar in any case, because noise could hide the difference",
        CHALLENGE,
    )
    lookalike_worse: float = limit(
        1.5,
        "times the best sum of squares",
        "a similar law whose fit is worse than this is fitted again from the best law's values",
        CHALLENGE,
    )
    lookalikes: int = limit(3, "laws", "laws similar to the best one that are fitted in its place", CHALLENGE)


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


@dataclass(frozen=True)
class DecisionPolicy:
    """Limits of the decision: from fitted hypotheses to a verdict."""

    telling: float = limit(
        2.0,
        "standard errors",
        "difference in log score from which on one hypothesis is better than another",
        "derivation: 1 in 44 by the normal distribution, on data that no fit has used",
    )
    significant: float = limit(
        4.0,
        "standard errors",
        "distance of an effect's size from zero, below which the effect is not needed",
        "derivation: 1 in 16000 by the normal distribution, so 1 in 100 for the 150 candidates of a record",
    )
    excited: float = limit(
        3.0,
        "times the noise",
        "standard deviation of an output, below which the output shows nothing but noise",
        "derivation: as `chance`",
    )
    clean: float = limit(
        1.05, "times the noise", "rms of a residual that counts as noise; `scatter` is added to it", CHALLENGE
    )
    scatter: float = limit(
        3.0,
        "standard errors",
        "allowance for chance in the rms of a residual",
        "derivation: 1 in 700, as `chance`",
    )
    gap: float = limit(
        0.95,
        "share of the gap to the noise",
        "share of the gap that an answer must close if it leaves more than noise, which must be less than "
        "`signal_share`",
        CHALLENGE,
    )
    most: float = limit(
        0.5,
        "share of the variance",
        "share that one effect must explain of the variance beyond noise if the model form is open; a "
        "residual of which no effect could explain as much is left to the form; what inputs that were held "
        "over a sample must explain of the variance beyond noise",
        "derivation: what explains less than it leaves is not what the residual is mainly made of",
    )
    probable: float = limit(
        0.05,
        "probability",
        "probability of the effects of an answer together, below which none is named",
        "convention, as the level of a test; a right pair beside undeclared noise rarely has more than 0.17",
    )
    open_alike: float = limit(
        0.25,
        "share of what the best one leaves beyond noise",
        "a hypothesis that is worse by less cannot be told from the best one if the model form is open",
        CHALLENGE,
    )
    alike: float = limit(
        0.01,
        "share of the sum of squares",
        "a hypothesis that is worse by less cannot be told from the best one: the form may be slightly wrong",
        "agreed assumption: the model's form is right to within small differences",
    )
    unknown: float = limit(
        2.0,
        "log score",
        "gain that each further unknown of a law must bring over the simpler law that is its limit",
        "H. Akaike, IEEE Trans. Automatic Control 19 (1974), 716-723, asks for 1; 2 because laws are many",
    )
    noticed: float = limit(
        40.0,
        "sum of squares, in units of the noise",
        "reduction by a further term that noise alone does not cause",
        "derivation: the largest of 150 chi-squares is below 17 in 99 of 100 records; more than twice that",
    )
    missed: float = limit(
        1e-3,
        "share of what a law explains",
        "further reduction that is possible in the part to identify although the law is right",
        CHALLENGE,
    )
    second_share: float = limit(
        0.5,
        "share of what a law leaves beyond noise",
        "share that a free curve beside the law must explain, so that it is rejected",
        CHALLENGE,
    )
    rounded: float = limit(
        1e-4,
        "share of what a law explains",
        "smallest misfit of a smooth curve that imitates a law with a corner, if the law has many unknowns",
        CHALLENGE,
    )
    imitated: float = limit(
        2.5e-3,
        "share of what a law explains",
        "smallest misfit of a smooth curve that imitates a law with a corner, if the law has few unknowns",
        CHALLENGE,
    )
    plain_law: int = limit(
        2,
        "unknowns",
        "largest number of unknowns of a law for which `imitated` holds; above it, `rounded` does",
        CHALLENGE,
    )
    fastest: float = limit(
        0.1,
        "share of the samples",
        "fastest samples; friction whose rounded part includes even these is not named friction",
        CHALLENGE,
    )
    different: float = limit(
        0.01,
        "probability",
        "p-value below which the estimates of several records differ, so that no common value is given",
        "convention, as the level of detection",
    )


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
    refused: float = limit(
        0.01,
        "probability",
        "probability that the checks of an answer refuse the right one",
        "convention: as the level of detection; two of some hundred right ones were refused with seed 166636",
    )


@dataclass(frozen=True)
class Policy(Limits):
    """All limits, grouped by start states, inputs, detection, search, intervals, decision and priors."""

    start: StartPolicy = StartPolicy()
    inputs: InputPolicy = InputPolicy()
    detection: DetectionPolicy = DetectionPolicy()
    search: SearchPolicy = SearchPolicy()
    interval: IntervalPolicy = IntervalPolicy()
    decision: DecisionPolicy = DecisionPolicy()
    prior: PriorPolicy = PriorPolicy()

    def limits(self) -> Iterator[tuple[str, Any, Field[Any]]]:
        """Name (group.limit), value and field of each limit."""
        for stage in fields(self):
            group = getattr(self, stage.name)
            if is_dataclass(group):
                for f in fields(group):
                    yield f"{stage.name}.{f.name}", getattr(group, f.name), f

    def table(self) -> str:
        """One Markdown table per group; docs/policy.md holds the tables of the default policy."""
        lines: list[str] = []
        stage = ""
        for name, value, about in self.limits():
            now, _, short = name.partition(".")
            if now != stage:
                stage = now
                lines += ["", f"## {stage.capitalize()}", "", "| limit | value | unit | meaning | source |"]
                lines += ["|---|---|---|---|---|"]
            m = about.metadata
            lines.append(f"| `{short}` | {value:g} | {m['unit']} | {m['meaning']} | {m['source']} |")
        return "\n".join(lines).strip() + "\n"


DEFAULT = Policy()

if __name__ == "__main__":
    print(DEFAULT.table(), end="")
