"""Every limit that can change an answer: its value, unit, meaning and source, in one object.

A limit stands here if another value of it could lead to another verdict, another class or another effect.
What only changes how long a number takes to find, or its last digits, stands beside the code that uses it.

Three kinds of source are told apart: a paper; a derivation, given in words; and a calibration, which names
the frozen challenge whose records it was found on. A calibrated limit is no law of nature.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import Field, asdict, dataclass, field, fields, is_dataclass
from typing import Any

CHALLENGE = "calibrated on the challenges up to seed 591988, frozen at 9217a2d"


def limit(value: Any, unit: str, meaning: str, source: str) -> Any:
    """A field of the policy with its default, and what a reader has to know of it."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "source": source})


@dataclass(frozen=True)
class DetectionPolicy:
    """When a residual is more than noise, and when it matters."""

    level: float = limit(
        0.01,
        "probability",
        "of calling noise a discrepancy, for all figures together",
        "convention: 2 false finds in 100 records are allowed, and half of that is left to the search",
    )
    replicates: int = limit(
        499,
        "draws",
        "of noise that the figures are held against",
        "derivation: the least probability that they can show, 1 in 500, is a fifth of the level",
    )
    slow_blocks: int = limit(
        40,
        "pieces",
        "of what no fit has seen, whose means show a residual that is slower than the noise",
        CHALLENGE,
    )
    signal_share: float = limit(
        0.02,
        "of an output's rms",
        "beyond the noise, below which a residual does not matter if it is small beside the noise too",
        "the agreed default: under 2 % of the signal a difference of form of the model is to be expected",
    )
    noise_share: float = limit(
        0.5,
        "of the noise",
        "beyond the noise, below which a residual does not matter if it is small beside the signal too",
        "derivation: half of the noise adds 12 % to an output's rms, which no user of the model would notice",
    )
    noise_share_of_effects: float = limit(
        0.2, "of the noise", "the same for a residual that is clearly like an effect", CHALLENGE
    )
    clear_likeness: float = limit(
        20.0,
        "of what noise reaches in 1 of 20 records",
        "likeness to an effect from which a residual is clearly like one",
        f"{CHALLENGE}: records without an effect come to 6",
    )
    chance: float = limit(
        3.0,
        "standard deviations",
        "of the mean square of white noise, that a residual may exceed the noise by chance",
        "derivation: 1 in 700 by the normal distribution",
    )
    open_form_noises: float = limit(
        2.0, "of the noise", "below which a residual is left alone where the model's form is open", CHALLENGE
    )
    open_form_likeness: float = limit(
        0.2,
        "of what is beyond noise",
        "that one effect could explain, from which a residual is no other form of the model",
        CHALLENGE,
    )


@dataclass(frozen=True)
class SearchPolicy:
    """What is fitted, how far, and what gives way: the more, the longer it takes."""

    nominees: int = limit(
        16, "effects", "of the screening that are fitted; half as many around a foreign FMU", CHALLENGE
    )
    nominees_in_shapes: int = limit(
        6, "effects", "the leading ones, that are fitted in more shapes", CHALLENGE
    )
    shapes_of_nominee: int = limit(2, "shapes", "of each of these", CHALLENGE)
    nominated_faults: int = limit(4, "faults", "of sensors that are fitted", CHALLENGE)
    overlooked_share: float = limit(
        0.2,
        "of what is beyond noise",
        "that all leave where the form is open, from which more effects are tried",
        CHALLENGE,
    )
    overlooked_more: int = limit(6, "effects", "that are tried then, beside constant changes", CHALLENGE)
    likely_fault: float = limit(
        0.5,
        "of what is beyond noise",
        "that a sensor's fault could explain, from which it is fitted before all else",
        CHALLENGE,
    )
    rival_of_fault: float = limit(
        0.7,
        "of what a fault that explains could gain",
        "below which an effect is no rival of it",
        CHALLENGE,
    )
    placebos: int = limit(3, "effects", "that are fitted beside such a fault all the same", CHALLENGE)
    sudden: int = limit(4, "effects", "fitted that may have set in at a time that shows", CHALLENGE)
    sets_in_times: float = limit(
        9.0, "of the mean square before", "of a residual from which something has set in", CHALLENGE
    )
    sets_in_times_open: float = limit(
        2.0, "of the mean square before", "the same where the form is open and all is small", CHALLENGE
    )
    sets_in_chance: float = limit(
        1e-5,
        "probability",
        "by chance, of the ranks of the blocks after an onset against those before (Mann and Whitney's test)",
        CHALLENGE,
    )
    sudden_fits: int = limit(12, "effects", "that get a short fit from the onset on", CHALLENGE)
    finalists: int = limit(5, "hypotheses", "of the brief fits that are fitted to the end", CHALLENGE)
    finalist_pairs: int = limit(2, "pairs", "of the brief fits that are fitted to the end", CHALLENGE)
    first_finalists: int = limit(
        2, "hypotheses", "of the finalists that are fitted before the others", CHALLENGE
    )
    rival: float = limit(
        4.0, "of the best sum of squares", "above which a finalist is not fitted to the end", CHALLENGE
    )
    hopeless: float = limit(
        10.0, "of the best sum of squares", "after the brief fits, above which none is a finalist", CHALLENGE
    )
    worth_a_fit: float = limit(
        0.95, "of the base's sum of squares", "above which none is a finalist", CHALLENGE
    )
    reweighted: int = limit(
        6, "hypotheses", "fitted again once the best fit has told the noise that was not declared", CHALLENGE
    )
    dated: int = limit(3, "hypotheses", "whose onset times are tried one after the other", CHALLENGE)
    dated_rival: float = limit(2.0, "of the best sum of squares", "above which none is dated", CHALLENGE)
    grown: int = limit(
        4, "effects", "of the best and of the most promising, fitted to a growing part", CHALLENGE
    )
    grown_survivors: int = limit(4, "hypotheses", "of these that go on after the first parts", CHALLENGE)
    grown_rival: float = limit(4.0, "of the best mean square", "above which none goes on", CHALLENGE)
    grown_refined: int = limit(2, "hypotheses", "that are fitted by finer differences in the end", CHALLENGE)
    paired: int = limit(8, "single effects", "that partners are looked for", CHALLENGE)
    partners: int = limit(12, "candidates", "leading ones among which pairs are screened", CHALLENGE)
    pairs: int = limit(4, "pairs", "from each of the two screenings that are fitted", CHALLENGE)
    second_effect: float = limit(
        0.25,
        "of an output's noise",
        "rms that a second effect beside one that explains must promise",
        CHALLENGE,
    )
    lookalike: float = limit(
        0.05, "of what a law does", "that another one misses of it at most, to look like it", CHALLENGE
    )
    lookalike_squares: float = limit(
        20.0,
        "of the sum of squares",
        "that another law may miss in any case, as noise could hide it",
        CHALLENGE,
    )
    lookalike_worse: float = limit(
        1.5, "of the best sum of squares", "from which on a fit may have ended elsewhere", CHALLENGE
    )
    lookalikes: int = limit(3, "laws", "that look like the best one and are fitted in its place", CHALLENGE)


@dataclass(frozen=True)
class DecisionPolicy:
    """From fitted hypotheses to a verdict."""

    telling: float = limit(
        2.0,
        "standard errors over blocks",
        "of a difference in log score, from which one hypothesis is better than another",
        "F. X. Diebold, R. S. Mariano, J. Business and Economic Statistics 13 (1995), 253-263: 1 in 44",
    )
    significant: float = limit(
        4.0,
        "standard errors",
        "of an effect's size from zero, below which it is idle",
        "derivation: 1 in 16000 by the normal distribution, so 1 in 100 for the 150 candidates of a record",
    )
    excited: float = limit(
        3.0,
        "of the noise",
        "standard deviation of an output, below which it shows nothing",
        "derivation: as `chance`",
    )
    clean: float = limit(
        1.05, "of the noise", "rms of a residual that counts as noise, beside its scatter", CHALLENGE
    )
    scatter: float = limit(
        3.0,
        "standard errors",
        "of an rms, that it may be larger by chance",
        "derivation: 1 in 700, as `chance`",
    )
    gap: float = limit(
        0.95,
        "of the gap to the noise",
        "that an answer must close where it does not come down to it",
        CHALLENGE,
    )
    explained: float = limit(
        0.75,
        "of the residual's variance",
        "that an answer must take away where the noise is not declared, so that the floor is unknown",
        CHALLENGE,
    )
    open_explained: float = limit(
        0.9,
        "of the variance beyond noise",
        "that must go where the model's form is open and all is small",
        CHALLENGE,
    )
    open_single: float = limit(
        0.5,
        "of the variance beyond noise",
        "that one effect must explain of all outputs together where the model's form is open",
        CHALLENGE,
    )
    open_alike: float = limit(
        0.25,
        "of what the best leaves beyond noise",
        "by which another may be worse and still not be told from it, where the form is open",
        CHALLENGE,
    )
    alike: float = limit(
        0.01,
        "of the sum of squares",
        "by which another may be worse, as a small difference of the model's form could decide between them",
        "the agreed assumption that the model's form is right to within small differences",
    )
    unknown: float = limit(
        2.0,
        "log score",
        "that a further unknown must be worth beside the simpler law that it becomes",
        "H. Akaike, IEEE Trans. Automatic Control 19 (1974), 716-723, asks for 1; laws are many",
    )
    noticed: float = limit(
        40.0,
        "of the sum of squares",
        "fall by something more, that noise alone does not bring about",
        "derivation: the largest of 150 chi-squares is below 17 in 99 of 100 records; twice that and more",
    )
    missed: float = limit(
        1e-3,
        "of what a law explains",
        "that more may gain in the part to identify, if the law is right",
        CHALLENGE,
    )
    second_share: float = limit(
        0.5, "of what one effect leaves beyond noise", "that a second one beside it must explain", CHALLENGE
    )
    pair_leaves: float = limit(
        0.1, "of what the second effect explains", "that a right pair leaves beyond noise at most", CHALLENGE
    )
    curve_of_noise: float = limit(
        0.05,
        "of the sum of squares of noise",
        "that a free curve must gain beside a law, to deny it",
        CHALLENGE,
    )
    open_curve_left: float = limit(
        0.05, "of what the law leaves", "the same where the model's form is open", CHALLENGE
    )
    open_curve_explained: float = limit(
        2.5e-3, "of what the law explains", "the same where the model's form is open", CHALLENGE
    )
    open_curve_elsewhere: float = limit(
        0.99,
        "of what a curve over another motion gains",
        "below which the law is not denied, form open",
        CHALLENGE,
    )
    rounded: float = limit(
        1e-4, "of what a law explains", "that a smooth curve which passes for it misses at least", CHALLENGE
    )
    plain_law: int = limit(
        2,
        "unknowns",
        "above which a law is as rounded as any, so that `open_curve_explained` holds",
        CHALLENGE,
    )
    fastest: float = limit(
        0.1, "of the motion", "the fastest, in which friction that is rounded there too is none", CHALLENGE
    )
    different: float = limit(
        0.01,
        "probability",
        "below which the estimates of two records differ, or one value does not serve several",
        "convention, as the level of detection",
    )
    errors_reach: float = limit(
        3.0,
        "standard errors",
        "that values may move by where laws are compared as their errors allow",
        CHALLENGE,
    )
    errors_apart: float = limit(20.0, "log score", "between laws, from which they are compared so", CHALLENGE)
    errors_laws: int = limit(8, "laws", "that are compared so", CHALLENGE)


@dataclass(frozen=True)
class Policy:
    """All limits, by the stage that they belong to."""

    detection: DetectionPolicy = DetectionPolicy()
    search: SearchPolicy = SearchPolicy()
    decision: DecisionPolicy = DecisionPolicy()

    @property
    def version(self) -> str:
        """A short hash of all values: two results with the same version were decided by the same limits."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def limits(self) -> Iterator[tuple[str, Any, Field[Any]]]:
        """Name (stage.limit), value and field of each."""
        for stage in fields(self):
            group = getattr(self, stage.name)
            if is_dataclass(group):
                for f in fields(group):
                    yield f"{stage.name}.{f.name}", getattr(group, f.name), f

    def table(self) -> str:
        """All limits as a Markdown table a stage; docs/policy.md holds that of the default."""
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
