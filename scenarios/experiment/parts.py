"""The parts of a record: the samples on which effects are fitted, chosen and tested."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from estimator.record import Array, BoolArray
from fmus.errors import BadInput
from scenarios.experiment.experiment import Experiment

CHOOSE = 0.2  # share of the identify part that becomes the part to choose, if none is declared
PIECES = 5  # number of pieces in which these samples lie
GRID = 15  # samples; pieces begin at multiples of it, so that screening can average 3 or 5 samples
MIN_SAMPLES = 50  # samples in each part; with fewer, an error is within its own scatter


def masks(e: Experiment, part: int, file: Path, t: Array) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Identify part, part to choose and test part of the samples, t: (N,) s -> (N,) each."""
    every, none = np.ones(t.size, dtype=np.bool_), np.zeros(t.size, dtype=np.bool_)
    if e.split is None:
        _check_enough(e, f"file {file}", every)
        return every, none, none
    if e.split.files:
        _check_enough(e, f"file {file}", every)
        whole = list(e.split.files)[part]
        found = {key: every if key == whole else none for key in ("identify", "choose", "test")}
    else:
        found = {"choose": none} | _windows(e, e.split.windows, file, t)
    if "choose" not in {**e.split.files, **e.split.windows}:
        found["choose"] = spread(found["identify"])
    return found["identify"] & ~found["choose"], found["choose"], found["test"]


def spread(identify: BoolArray) -> BoolArray:
    """The part to choose (N,) if none is declared: the end of each piece of the identify part.

    It is spread over the record, because an effect with a late onset must be visible in both parts. The
    pieces are few and long, so that neighbouring samples do not correlate the two parts (hold-out of blocks:
    J. Racine, Journal of Econometrics 99 (2000), 39-61).
    """
    index, found = np.flatnonzero(identify), np.zeros_like(identify)
    whole = GRID if len(index) > 20 * PIECES * GRID else 1  # else rounding would change the share
    for piece in range(PIECES):
        first, last = (
            round((piece + part) * len(index) / PIECES / whole) * whole for part in (1 - CHOOSE, 1)
        )
        found[index[first:last]] = True
    return found


def _windows(
    e: Experiment, windows: Mapping[str, tuple[float, float]], file: Path, t: Array
) -> dict[str, BoolArray]:
    """The samples (N,) in each window of one file; a sample on the common edge belongs to the first."""
    step = float(np.median(np.diff(t))) if t.size > 1 else 0.0
    masks: dict[str, BoolArray] = {}
    for key, window in windows.items():
        if window[0] < t[0] - step or window[1] > t[-1] + step:
            raise BadInput(
                f"{e.file}: [split] {key} = {list(window)} leaves the record {file.name}, which runs from "
                f"{t[0]:.9g} to {t[-1]:.9g} s; keep it within"
            )
        slack = 1e-6 * step  # for times printed with few digits
        mask = (t >= window[0] - slack) & (t <= window[1] + slack)
        masks[key] = mask & ~np.any([*masks.values()], axis=0) if masks else mask
        _check_enough(e, f"[split] {key} = {list(window)}", masks[key])
    return masks


def _check_enough(e: Experiment, where: str, mask: BoolArray) -> None:
    if mask.sum() < MIN_SAMPLES:
        raise BadInput(
            f"{e.file}: {where} holds {mask.sum()} samples; at least {MIN_SAMPLES} are needed: give a longer "
            "window, or time_unit if the times are not in s"
        )
