"""Did something set in during the record? The FMU fits until a moment, and what came is looked for there.

An effect that sets in late and strong spoils a calibration of the whole; calibrated on what was before, the
FMU says what set in, in the first moments after.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import mannwhitneyu

from estimator.closeloop.fitting.fit import fit, weighted
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.onset import moment, set_in
from estimator.closeloop.hypotheses.promise import Promise, distinct
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.screen import Screening, screen
from estimator.record import Array

EARLY = (0.5, 0.25, 0.1)  # of the identify part: what may lie before
ONSET_BLOCKS = 50  # of the identify part whose residuals are compared
AS_GOOD = 1.5  # times the smallest residual before a moment: as good, and from more of the record
AFTER = 0.05  # of the identify part: what is looked at after the moment
LONGER = 2.0  # times that in the short fits
SHORT_FIT = 7  # evaluations of a short fit
GENTLE = 0.3  # of the amplitudes that the linear picture asks for: the other start of these fits
ABOUT = np.arange(-1.0, 2.5, 0.5)  # blocks about the moment


def onset(baseline: Baseline, times: float) -> tuple[float, Fit] | None:
    """Share of the identify part after which the residual is another, and the FMU's fit to what was before.

    times: as large its mean square has to be. None where there is no such moment, or where nothing is to be
    calibrated.
    """
    problem, size = baseline.problem, baseline.noise.scale
    unknowns, found, chance = baseline.hypothesis.fit.unknowns, [], baseline.policy.search.sets_in_chance
    for early in EARLY if unknowns else ():
        before = fit(problem.beginning(early), unknowns, size)
        squares = _blocks(problem, before, size)
        if (k := grown(squares, int(early * ONSET_BLOCKS), times, chance)) is not None:
            found.append((float(np.sqrt(squares[:k]).mean()), k / ONSET_BLOCKS, before))
    if not found:
        return None
    least = min(level for level, _, _ in found)
    _, share, before = next(f for f in found if f[0] <= AS_GOOD * least)
    return share, fit(problem.beginning(share), unknowns, size, before.theta)


def _blocks(problem: Problem, before: Fit, size: Array) -> Array:
    """Mean square of the weighted residual of each block of the identify part, (ONSET_BLOCKS,)."""
    residual = weighted(problem, before.theta, size).reshape(-1, len(size))
    return np.array([float(np.mean(b**2)) for b in np.array_split(residual, ONSET_BLOCKS)])


def grown(squares: Array, first: int, times: float, level: float) -> int | None:
    """The block from which on mean squares (n,) are so many times larger, `first` at the earliest, or None.

    Where their logarithms come in two levels, told apart both by size and by rank: by rank alone blocks that
    move more would do, by size alone a single one.
    """
    logs = np.log(squares + 1e-300)
    spread = {k: k * logs[:k].var() + (len(logs) - k) * logs[k:].var() for k in range(first, len(logs))}
    k = min(spread, key=spread.__getitem__)
    before, after = squares[:k], squares[k:]
    chance = float(mannwhitneyu(after, before, alternative="greater").pvalue)
    return k if after.mean() > times * before.mean() and chance < level else None


def since(fitter: Fitter, at: tuple[float, Fit], candidates: Sequence[Candidate]) -> list[Promise]:
    """Promises of what can set in about the moment, best first.

    Ranked by the first moments after it; the leading ones again by short fits to some more of the record,
    all else held at what the FMU was before, since a strong change differs from its linear picture.
    """
    limits, problem = fitter.baseline.policy.search, fitter.baseline.problem
    share, before = at
    promises = _by_response(problem, at, candidates, fitter.baseline.noise.scale)
    leading, rest = promises[: limits.sudden_fits], promises[limits.sudden_fits :]
    held = replace(problem, declared={**problem.declared, **before.theta})
    part = held.beginning(min(1.0, share + LONGER * AFTER))
    gentle = [replace(p, start=_scaled(p, GENTLE)) for p in leading]
    tried = fitter.asked(part).fitted([*leading, *gentle], SHORT_FIT, ())
    better = [Promise(h.candidates, 0.0, {**before.theta, **h.fit.theta}) for h in tried]
    return [*better, *rest]


def _scaled(promise: Promise, factor: float) -> dict[str, float]:
    """A promise's start with smaller amplitudes."""
    names = {u.name for c in promise.candidates for u in c.amplitudes}
    return {n: v * factor if n in names else v for n, v in promise.start.items()}


def _by_response(
    problem: Problem, at: tuple[float, Fit], candidates: Sequence[Candidate], size: Array
) -> list[Promise]:
    share, before = at
    run = problem.record.runs[0]
    here = problem.beginning(min(1.0, share + AFTER))
    there = fit(here, before.unknowns, size, before.theta, evaluations=1)
    labels = {c.label: c for c in reversed(candidates) if moment(c) is not None}
    tried = [set_in(c, run.fit_time(share + g / ONSET_BLOCKS)) for c in labels.values() for g in ABOUT]
    screening = Screening(here, there, size)
    change = screening.changes(tried)
    found = screen(screening.fit, [((c,), g) for c, g in zip(tried, change, strict=True)])
    return distinct(found)
