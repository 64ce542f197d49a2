"""Keeps what happens at some moments only in the parts of a record that have to see it.

The part to choose lies in stretches within the part to identify. No fit uses them, so that an onset time
within such a stretch is not determined, and the answer is chosen on just the samples about a wrong onset. The
stretch is therefore exchanged for one of the same length that the fits have used. Nor can an answer be chosen
where nothing is seen of it, such as of a limit that the part to choose never reaches.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.record import Array, BoolArray, Note, Run


def identified_at(problem: Problem, time: float) -> Problem | None:
    """The problem with the samples about a time, s from the first one, in the part to identify.

    None if they are in no stretch of the part to choose that has samples to identify on both sides, or if
    there is no stretch to exchange it for.
    """
    first = problem.record.runs[0]
    at = first.t[0] + time
    held = (s for s in _stretches(first) if first.t[s[0] - 1] <= at <= first.t[s[1]])
    stretch = next(held, None)
    other = _instead(first.fit, *stretch) if stretch else None
    if stretch is None or other is None:
        return None
    now, then = slice(*stretch), slice(other, other + stretch[1] - stretch[0])
    return _exchanged(
        problem, now, then, f"an effect sets in between {_times(first, now)}, within the part to choose"
    )


def chosen_where_seen(problem: Problem, left: Array) -> Problem | None:
    """The problem with samples to choose that see their share of a discrepancy, which others see alone.

    left: residual (N, n_y) of the first run in standard deviations of the noise. The first stretch to choose
    is exchanged for one to identify that is as long. None if none of these sees anything, or one sees most.
    """
    run, beyond = problem.record.runs[0], np.sum(left**2 - 1, axis=1)
    now = next((slice(*s) for s in _stretches(run)), None)
    if now is None:
        return None
    length, total = now.stop - now.start, float(beyond[run.fit].sum())
    others = (slice(s, s + length) for s in range(now.start % length, len(run.t) - length + 1, length))
    seen = {some.start: float(beyond[some].sum()) for some in others if run.fit[some].all()}
    noise = problem.policy.detection.chance * np.sqrt(2 * length * left.shape[1])
    useful = [s for s, part in seen.items() if noise < part < total / 2]
    if not useful:
        return None
    wanted = total * run.choose.sum() / (run.choose | run.fit).sum()
    best = min(useful, key=lambda s: abs(seen[s] - wanted))
    why = "the part to choose shows only noise, that to identify shows more"
    return _exchanged(problem, now, slice(best, best + length), why)


def _exchanged(problem: Problem, now: slice, then: slice, why: str) -> Problem:
    """The problem with the samples `now`, to choose, exchanged for those `then`, to identify."""
    first, *others = problem.record.runs
    fit, choose = first.fit.copy(), first.choose.copy()
    fit[now], choose[now] = True, False
    fit[then], choose[then] = False, True
    moved = replace(first, fit=fit, choose=choose)
    said = (
        f"{why}; the samples between {_times(first, now)} were therefore used to identify, and those between "
        f"{_times(first, then)} to choose"
    )
    notes = (*problem.record.notes, Note("parts", "", said))
    return replace(problem, record=replace(problem.record, runs=(moved, *others), notes=notes))


def _stretches(run: Run) -> Iterator[tuple[int, int]]:
    """First sample and end of each stretch to choose that lies between samples to identify."""
    edges = np.flatnonzero(np.diff(run.choose, prepend=False, append=False)).reshape(-1, 2)
    for first, end in edges.tolist():
        if first > 0 and end < len(run.t) and run.fit[first - 1] and run.fit[end]:
            yield first, end


def _instead(fit: BoolArray, first: int, end: int) -> int | None:
    """First sample of a stretch as long, in the middle of those to identify before or after [first, end).

    It lies a multiple of its length away, so that samples can be averaged in the same groups.
    """
    length = end - first
    before = first - int(np.flatnonzero(~fit[:first])[-1] + 1 if not fit[:first].all() else 0)
    after = int(np.flatnonzero(~fit[end:])[0] if not fit[end:].all() else len(fit) - end)
    if before >= length:
        return first - length * ((before // length + 1) // 2)
    if after >= length:
        return end + length * ((after // length - 1) // 2)
    return None


def _times(run: Run, some: slice) -> str:
    return f"{run.t[some.start]:.6g} and {run.t[some.stop - 1]:.6g} s"
