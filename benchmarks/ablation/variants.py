"""The policies of the ablation: the default with one limit at another value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from estimator.closeloop.policy import DEFAULT, Policy

STAGES = ("detection", "decision")  # limits of the search decide what is fitted: these need new fits
NEEDS_DRAWS = ("detection.replicates", "detection.slow_blocks")  # the noise would have to be drawn again
FACTORS = {"0": 0.0, "half": 0.5, "double": 2.0, "without end": 1e12}


def variants() -> Iterator[tuple[str, str, Policy]]:
    """Name of a limit, word for its change, and the policy with it."""
    for name, value, _ in DEFAULT.limits():
        stage, _, short = name.partition(".")
        if stage not in STAGES or name in NEEDS_DRAWS:
            continue
        group = getattr(DEFAULT, stage)
        for word, factor in FACTORS.items():
            changed = round(value * factor) if isinstance(value, int) else value * factor
            yield name, word, replace(DEFAULT, **{stage: replace(group, **{short: changed})})
