"""Keeps the moment at which an effect sets in within the part to identify.

The part to choose lies in stretches within the part to identify. No fit uses them, so that an onset time
within such a stretch is not determined, and the answer is chosen on just the samples about a wrong onset. The
stretch is therefore exchanged for one of the same length that the fits have used.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.record import BoolArray, Note, Run


def identified_at(problem: Problem, time: float) -> Problem | None:
    """The problem with the samples about a time, s from the first one, in the part to identify.

    None if they are in no stretch of the part to choose that has samples to identify on both sides, or if
    there is no stretch to exchange it for.
    """
    first, *others = problem.record.runs
    stretch = _stretch(first, time)
    if stretch is None:
        return None
    other = _instead(first.fit, *stretch)
    if other is None:
        return None
    fit, choose = first.fit.copy(), first.choose.copy()
    now, then = slice(*stretch), slice(other, other + stretch[1] - stretch[0])
    fit[now], choose[now] = True, False
    fit[then], choose[then] = False, True
    moved = replace(first, fit=fit, choose=choose)
    note = Note("parts", "", _said(first, now, then))
    notes = (*problem.record.notes, note)
    return replace(problem, record=replace(problem.record, runs=(moved, *others), notes=notes))


def _stretch(run: Run, time: float) -> tuple[int, int] | None:
    """First sample and end of the stretch to choose, between samples to identify, that holds a time."""
    edges = np.flatnonzero(np.diff(run.choose, prepend=False, append=False)).reshape(-1, 2)
    at = run.t[0] + time
    for first, end in edges.tolist():
        within = first > 0 and end < len(run.t) and run.fit[first - 1] and run.fit[end]
        if within and run.t[first - 1] <= at <= run.t[end]:
            return first, end
    return None


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


def _said(run: Run, now: slice, then: slice) -> str:
    used, instead = (f"{run.t[s.start]:.6g} and {run.t[s.stop - 1]:.6g} s" for s in (now, then))
    return (
        f"an effect sets in between {used}, within the part to choose; these samples were therefore used to "
        f"identify, and those between {instead} to choose"
    )
