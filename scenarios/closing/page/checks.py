"""The checks of a verdict and the figures of the test for a discrepancy, in words of a reader."""

from collections.abc import Iterator, Mapping

import numpy as np

from estimator.closeloop.detection.detect import LIKENESS
from estimator.closeloop.evidence import Check, Name
from scenarios.drawing.typography import number

LEAST, MOST, ABOVE, BELOW = "at least", "at most", "above", "below"
GAIN = "change of the log score over its standard error"
MEANINGS: Mapping[Name, tuple[str, str]] = {  # how the value stands to the limit, and what the value is
    "the residual is more than noise": (BELOW, "probability that noise alone leaves such a residual"),
    "the outputs move out of their noise": (LEAST, "spread of the liveliest output over its noise"),
    "the residual is large enough to matter": (LEAST, "its size over the smallest size that matters"),
    "every sensor moves": (MOST, "number of sensors that show one value all the time"),
    "the size is clear of zero": (LEAST, "size of the effect over its standard error"),
    "the reported size is clear of zero": (
        LEAST, "the same with the errors that are reported, which allow for steps and form",
    ),
    "better than without it on the part to choose": (ABOVE, GAIN),
    "outputs left above their noise": (MOST, "number of outputs with declared noise that stay above it"),
    "what it changes is more than another form leaves": (
        LEAST, "its change over that of an error of form, or the share it explains over the one asked for",
    ),
    "not improbable": (LEAST, "probability of the effects that are named, together"),
    "nothing richer gains on the part to identify": (
        MOST, "what an effect that contains this one would take away more from the sum of squares",
    ),
    "an effect is more probable than none": (LEAST, "probability that there is an effect, known or not"),
    "the force follows the law": (MOST, "what a free curve takes away more from the sum of squares"),
    "better than without it on the test part": (ABOVE, GAIN),
    "no worse than without it on the test part": (ABOVE, GAIN),
    "outputs left above their noise on the test part": (
        MOST, "number of outputs with declared noise that stay above it",
    ),
    "alternatives that this record does not tell apart": (MOST, "number of other effects that fit as well"),
    "effects that are needed": (MOST, "number of effects that act together"),
    "faults of sensors among them": (MOST, "number of sensors at fault"),
}  # fmt: skip
FIGURES = {LIKENESS: "part of the residual that the response to some effect resembles"}


def decided(c: Check) -> dict[str, str]:
    """A check of the decision, ready to print."""
    relation, meaning = MEANINGS[c.name]
    return {
        "check": c.name,
        "meaning": meaning,
        "value": number(c.value, 3) if np.isfinite(c.value) else "without limit",
        "limit": f"{relation} {number(c.limit, 3)}",
        "passed": "yes" if c.passed else "no",
    }


def figures(found: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """The figures by which the residual is compared with noise: what each is, and its value."""
    for name, value in found.items():
        yield FIGURES.get(name, name), number(value)
