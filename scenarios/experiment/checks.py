"""Checks of a record: faults that forbid its use raise BadInput, other oddities become a Note."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.noise import white_noise
from estimator.record import Array, Note
from fmus.errors import BadInput

FEWEST = 2  # times; with fewer there is no step
JITTER = 0.01  # standard deviation of the time steps over their median
LOST_SAMPLE = 1.5  # a step over the median step that must come from a lost sample
GAP = 5.0  # a step over the median step that no simulation should bridge
CLIPPED_SAMPLES = 8  # equal values in a row; chance and slow turning points make fewer

Lines = NDArray[np.integer[Any]]


def check_time(
    file: str, column: str, t: Array, lines: Lines, row: str = "line", fewest: int = FEWEST
) -> None:
    """Raise BadInput unless the times increase from row to row, and are as many as needed.

    t: (N,) s; lines: (N,) number of each row in the file; row: the word for a row in this format.
    """
    blank = ~np.isfinite(t)
    if blank.any():
        line = lines[blank.argmax()]
        raise BadInput(
            f"{file} {row} {line}: time column '{column}' holds no number; fill it or drop the row"
        )
    back = np.diff(t) <= 0
    if back.any():
        i = int(back.argmax())
        way = "write them with more digits, or drop the rows that repeat one"
        if t[i + 1] < t[i]:
            way = "drop the rows that go back, or cut the file there"
        raise BadInput(
            f"{file} {row} {lines[i + 1]}: time column '{column}' goes from {t[i]:.9g} to {t[i + 1]:.9g} s; "
            f"times must increase from row to row: {way}"
        )
    if t.size < fewest:
        raise BadInput(f"{file}: has {t.size or 'no'} {row} of numbers; at least {fewest} are needed")


def check_gaps(file: str, t: Array) -> None:
    """Raise BadInput if a step of time, t: (N,) s, is much longer than the median step."""
    steps = np.diff(t)
    gaps = np.flatnonzero(steps > GAP * np.median(steps))
    if gaps.size:
        i = gaps[0]
        more = f" (and {gaps.size - 1} more gaps)" if gaps.size > 1 else ""
        raise BadInput(
            f"{file}: no data from {t[i]:.9g} to {t[i + 1]:.9g} s{more}; end the split before it, or cut the "
            "record there and give the parts as identify_data and test_data"
        )


def check_cells(file: str, column: str, t: Array, x: Array) -> None:
    """Raise BadInput unless every cell of a used column, x: (N,), contains a number."""
    blank = ~np.isfinite(x)
    if blank.any():
        raise BadInput(
            f"{file}: column '{column}' has no number in {blank.sum()} of {x.size} rows, first at "
            f"{t[blank.argmax()]:.9g} s; fill these cells or choose a split without them"
        )


def time_notes(file: str, t: Array) -> Iterator[Note]:
    """Notes on uneven sampling and lost samples, t: (N,) s."""
    steps = np.diff(t)
    median = float(np.median(steps))
    spread = float(np.std(steps)) / median
    if spread > JITTER:
        yield Note(
            "jitter", "", f"{file}: time steps scatter by {spread:.1%} about their median {median:.6g} s"
        )
    lost = np.flatnonzero(steps > LOST_SAMPLE * median)
    if lost.size:
        times = "once" if lost.size == 1 else f"{lost.size} times"
        yield Note("gap", "", f"{file}: samples are missing {times}, first after {t[lost[0]]:.9g} s")


def output_notes(file: str, column: str, x: Array) -> Iterator[Note]:
    """A note on a measured output that is constant or clipped, x: (N,) in any unit.

    Only for outputs, because a command may well stay at its limits.
    """
    if np.ptp(x) == 0:
        yield Note(
            "constant",
            column,
            f"{file}: column '{column}' is constant at {x[0]:.6g}, so it contains no information",
        )
        return
    for value, places in clipped(x):
        where = "in one place" if places == 1 else f"in {places} places"
        yield Note(
            "clipped",
            column,
            f"{file}: column '{column}' runs into {value:.6g} and stays there exactly, {where}; "
            "the sensor is clipped or the motion hits a stop",
        )


def clipped(x: Array) -> list[tuple[float, int]]:
    """The extremes of a channel, x: (N,), at which it is clipped, and in how many places.

    A channel is clipped if it reaches its extreme without slowing down and then repeats exactly the same
    value. A channel at rest has slowed down before (an encoder), or rests at 0 (a speed, a current), and
    noise never repeats a value. A stop from full speed within about four samples cannot be distinguished.
    """
    found = []
    quantum, noise = _quantum(x), white_noise([x], quantised=True)
    for sign in (1.0, -1.0):
        z = sign * x
        top = z.max()
        starts = [s for s in _stays(z == top) if _unbraked(z[:s], quantum, noise)]
        if starts and top != 0:
            found.append((float(sign * top), len(starts)))
    return found


def _stays(at_top: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Where stretches of at least CLIPPED_SAMPLES begin, at_top: (N,)."""
    edges = np.diff(np.concatenate(([0], at_top.astype(np.int8), [0])))
    begin, end = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return begin[end - begin >= CLIPPED_SAMPLES]


def _quantum(x: Array) -> float:
    """The smallest difference between two values of a channel, x: (N,), not constant."""
    steps = np.diff(np.unique(x))
    return float(steps[steps > 1e-9 * np.ptp(x)].min())


def _unbraked(before: Array, quantum: float, noise: float) -> bool:
    """Whether a channel, before: (n,) up to its extreme, rises to it without slowing down.

    The shortest window in which the rise is visible is examined. If the motion brakes evenly to rest, the
    last quarter rises at no more than half the rate of the others. Below two quanta per sample, braking is
    not visible. Noise can look like braking, so a noisy channel is also examined over longer windows.
    """
    visible = 24 * max(quantum, noise)
    enough = 4 * visible if noise > 3 * quantum else visible
    window, rise = 4, 0.0
    while window < before.size and rise < enough:
        rise = before[-1] - before[-1 - window]
        last = before[-1] - before[-1 - window // 4]
        if rise >= max(visible, 2 * window * quantum) and last >= 0.7 * (rise - last) / 3:
            return True
        window *= 2
    return False
