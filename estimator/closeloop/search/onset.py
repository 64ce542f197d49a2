"""Finds whether and when an effect sets in during the record, and which candidates could have set in.

A strong effect that sets in late distorts a calibration on the whole part to identify. The FMU is therefore
calibrated on the samples before the onset, and its residual shortly after the onset is screened.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import fit, weighted
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.promise import Promise, distinct
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.screen import screen
from estimator.record import Array
from estimator.weighting import Weighting

EARLY = (0.5, 0.25, 0.1)  # shares of the part to identify that are tried as free of the effect
ONSET_BLOCKS = 50  # blocks of the part to identify whose residuals are compared
AS_GOOD = 1.5  # times the smallest residual before an onset; up to this, the longest share is preferred
AFTER = 0.05  # share of the part to identify that is screened after the onset
LONGER = 2.0  # multiple of AFTER that the short fits use
SHORT_FIT = 7  # evaluations of a short fit, at most
GENTLE = 0.3  # second start of the short fits: this share of the amplitudes from regression
ABOUT = np.arange(-1.0, 2.5, 0.5)  # onset times tried around the detected one, in blocks


def onset(baseline: Baseline, times: float) -> tuple[float, Fit] | None:
    """Share of the part to identify before the onset, and the fit of the FMU to that share.

    times: factor by which the mean square of the residual must grow at the onset. None if there is no such
    onset, or if nothing is calibrated.
    """
    problem, weighting = baseline.problem, baseline.noise.weighting
    unknowns, found, chance = baseline.hypothesis.fit.unknowns, [], baseline.policy.search.sets_in_chance
    for early in EARLY if unknowns else ():
        before = fit(problem.beginning(early), unknowns, weighting)
        squares = _blocks(problem, before, weighting)
        if (k := grown(squares, int(early * ONSET_BLOCKS), times, chance)) is not None:
            found.append((float(np.sqrt(squares[:k]).mean()), k / ONSET_BLOCKS, before))
    if not found:
        return None
    least = min(level for level, _, _ in found)
    _, share, before = next(f for f in found if f[0] <= AS_GOOD * least)
    return share, fit(problem.beginning(share), unknowns, weighting, before.theta)


def _blocks(problem: Problem, before: Fit, weighting: Weighting) -> Array:
    """Mean square of the weighted residual in each block of the part to identify, (ONSET_BLOCKS,)."""
    residual = weighted(problem, before.theta, weighting).reshape(-1, len(weighting))
    return np.array([float(np.mean(b**2)) for b in np.array_split(residual, ONSET_BLOCKS)])


def grown(squares: Array, first: int, times: float, level: float) -> int | None:
    """The block from which the mean squares (n,) are larger by a factor, at the earliest block `first`; or
    None.

    times: that factor. The logarithms of the mean squares are split into two levels, which must differ both
    by that factor and by a rank test at `level`. The rank test alone would accept blocks that only move more,
    and the factor alone a single large block.
    """
    logs = np.log(squares + 1e-300)
    spread = {k: k * logs[:k].var() + (len(logs) - k) * logs[k:].var() for k in range(first, len(logs))}
    k = min(spread, key=spread.__getitem__)
    before, after = squares[:k], squares[k:]
    from scipy.stats import mannwhitneyu  # takes a third of a second to load

    chance = float(mannwhitneyu(after, before, alternative="greater").pvalue)
    return k if after.mean() > times * before.mean() and chance < level else None


def since(fitter: Fitter, at: tuple[float, Fit], candidates: Sequence[Candidate]) -> list[Promise]:
    """Promises of the candidates that can set in near the onset, best first.

    They are ranked by the residual shortly after the onset. The leading ones are ranked again by short fits
    to a longer stretch, because a strong change differs from its linearisation. All other values are held at
    those of the fit before the onset.
    """
    limits, problem = fitter.baseline.policy.search, fitter.baseline.problem
    share, before = at
    promises = _by_response(problem, at, candidates, fitter.baseline.noise.weighting)
    leading, rest = promises[: limits.sudden_fits], promises[limits.sudden_fits :]
    held = replace(problem, declared={**problem.declared, **before.theta})
    part = held.beginning(min(1.0, share + LONGER * AFTER))
    gentle = [replace(p, start=_scaled(p, GENTLE)) for p in leading]
    tried = fitter.asked(part).fitted([*leading, *gentle], SHORT_FIT, ())
    better = [Promise(h.candidates, 0.0, {**before.theta, **h.fit.theta}) for h in tried]
    return [*better, *rest]


def _scaled(promise: Promise, factor: float) -> dict[str, float]:
    """The start of a promise with its amplitudes multiplied by a factor."""
    names = {u.name for c in promise.candidates for u in c.amplitudes}
    return {n: v * factor if n in names else v for n, v in promise.start.items()}


def _by_response(
    problem: Problem, at: tuple[float, Fit], candidates: Sequence[Candidate], weighting: Weighting
) -> list[Promise]:
    share, before = at
    run = problem.record.runs[0]
    here = problem.beginning(min(1.0, share + AFTER))
    there = fit(here, before.unknowns, weighting, before.theta, evaluations=1)
    labels = {c.label: c for c in reversed(candidates) if c.onset is not None}
    tried = [c.with_onset(run.fit_time(share + g / ONSET_BLOCKS)) for c in labels.values() for g in ABOUT]
    screening = Screening(here, there, weighting)
    change = screening.changes(tried)
    found = screen(screening.fit, [((c,), g) for c, g in zip(tried, change, strict=True)])
    return distinct(found)
