"""The course of measured points along a profile: its order is checked, its single-valued part is kept."""

import numpy as np

from fmus.contact.arguments import Array
from fmus.contact.geometry.points import Points
from fmus.errors import BadInput

BACKWARDS = 1e-4  # m, y may go back by noise
APART = 2e-4  # m between the points that stand for the course
GAP = 0.015  # m, longest step between neighbours
SLIVER = 5e-4  # m, width of a loop that is more than disorder


def running_part(points: Points) -> Points:
    """The points between the overhangs, over which y runs one way; overhangs at both ends may be absent.

    BadInput names the line where the points jump, run back within the profile, or cross their own course.
    """
    course = points.part(_thinned(points))
    steps = np.hypot(np.diff(course.y), np.diff(course.z))
    turns = _turns(course.y)
    legs = np.abs(np.diff(course.y[turns]))
    main = int(np.argmax(legs))
    crossing = _crossing(course)
    # one leg before and one after the longest may be overhangs; more of them are disorder
    ordered = main <= 1 and len(legs) - main <= 2 and steps.max() <= GAP
    if crossing and not _shorter_if_sorted(course, steps):
        raise BadInput(
            f"{points.file}: crosses its own course at lines {crossing[0]} and {crossing[1]}; remove the loop"
        )
    if not ordered:
        raise BadInput(_disorder(course, turns, steps, main))
    begin, end = course.line[turns[main]], course.line[turns[main + 1]]
    return points.part((points.line >= begin) & (points.line <= end))


def _thinned(points: Points) -> Array:
    """Indices of points that are at least APART from the one before."""
    kept = [0]
    for i in range(1, len(points.y)):
        if np.hypot(points.y[i] - points.y[kept[-1]], points.z[i] - points.z[kept[-1]]) >= APART:
            kept.append(i)
    return np.array(kept)


def _turns(y: Array) -> list[int]:
    """Indices where y turns round by more than noise, with both ends."""
    turns = [0]
    extreme, direction = 0, 0
    for i in range(1, len(y)):
        ahead = y[i] - y[extreme]
        if direction * ahead >= 0 and abs(ahead) > (BACKWARDS if direction == 0 else 0):
            extreme, direction = i, int(np.sign(ahead))
        elif direction * ahead < -BACKWARDS:
            turns.append(extreme)
            extreme, direction = i, -direction
    return [*turns, len(y) - 1]


def _crossing(course: Points) -> tuple[int, int] | None:
    """The lines where the course crosses itself in a loop wider than a sliver, if it does."""
    p = np.column_stack([course.y, course.z])
    d = np.diff(p, axis=0)
    between = p[None, :-1] - p[:-1, None]  # from the begin of segment i to that of j
    across = d[:, None, 0] * d[None, :, 1] - d[:, None, 1] * d[None, :, 0]
    across = np.where(across == 0, np.inf, across)
    on_i = (between[..., 0] * d[None, :, 1] - between[..., 1] * d[None, :, 0]) / across
    on_j = (between[..., 0] * d[:, None, 1] - between[..., 1] * d[:, None, 0]) / across
    meets = (on_i > 0) & (on_i < 1) & (on_j > 0) & (on_j < 1)
    for i, j in np.argwhere(np.triu(meets, 2)):
        loop = p[i + 1 : j + 1]
        if np.ptp(loop, axis=0).min() > SLIVER:
            return int(course.line[i]), int(course.line[j])
    return None


def _shorter_if_sorted(course: Points, steps: Array) -> bool:
    """Whether the order of y makes the course shorter, as it does of disorder and not of a loop."""
    order = np.argsort(course.y)
    return float(np.hypot(np.diff(course.y[order]), np.diff(course.z[order])).sum()) < float(steps.sum())


def _disorder(course: Points, turns: list[int], steps: Array, main: int) -> str:
    """What to say of points that are not in the order of the profile."""
    longest = int(np.argmax(steps))
    dy = np.diff(course.y)
    along = dy * np.sign(dy[steps <= GAP].sum())
    if steps[longest] > GAP and len(turns) <= 4 and along[longest] > 0:
        line = int(course.line[longest + 1])
        gap = f"has a gap of {steps[longest] * 1e3:.0f} mm before line {line}"
        return f"{course.file}: {gap}; measure it there too"
    if steps[longest] > GAP:
        back = int(np.argmin(along)) + 1
    else:  # the first turn that is no overhang at an end
        back = (turns[1] if main > 1 else turns[min(main + 1, len(turns) - 2)]) + 1
    line = int(course.line[back])
    return f"{course.file}: is not sorted along the profile, y runs back at line {line}; sort the lines"
