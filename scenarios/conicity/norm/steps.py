"""Step 1, conicities of the exact profiles, and step 2, those of measured points, in the norm's windows."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.record import Array
from fmus.contact.geometry.profile import Profile
from fmus.errors import BadInput
from scenarios.conicity.evaluating import AMPLITUDES, conicities
from scenarios.conicity.norm.measuring import ERRORS, Error, Instrument
from scenarios.conicity.norm.pairs import RAIL, WHEEL, Reference, printed, shifts, tolerance, windows

PLACES = ("wheel", "rail", "both")  # what is measured, the rest is exact
COARSE = 5e-5  # m between shifts of step 2
CLOSE, JUMP = 0.01, 0.05  # mm, of radius differences, and where a contact jumps from root to flank
SHOWN = 0.003  # m
ROUNDED = 5e-4  # the norm prints three decimals
Tell = Callable[[str], None]


@dataclass(frozen=True)
class ExactRow:
    """Step 1 of a pair; what needs a table of the norm is None where none was given.

    at_3: conicity at 3 mm, None where there is none; inside: amplitudes within the tolerance; largest:
    deviation of a conicity, and at: its amplitude, mm; dr_close of dr_points: radius differences within
    CLOSE; dr_largest, dr_at: largest deviation of one, mm, and its shift, mm.
    """

    pair: str
    at_3: float | None
    inside: int | None
    amplitudes: int | None
    largest: float | None
    at: float | None
    dr_close: int | None
    dr_points: int | None
    dr_largest: float | None
    dr_at: float | None

    @property
    def passed(self) -> bool:
        """Whether all that a table was given for is inside."""
        return self.inside == self.amplitudes and (self.dr_largest is None or self.dr_largest <= JUMP)


@dataclass(frozen=True)
class MeasuredRow:
    """Step 2 of a pair, an error and a place: counts over draws and amplitudes, and deviations from step 1.

    inside: within the tolerance; extended: also with the amplitude 0.1 mm off; draws_inside: draws that are
    extended-inside at every amplitude; mean: largest mean deviation over the draws, std: largest scatter.
    """

    pair: str
    error: Error
    place: str
    draws: int
    values: int
    inside: int
    extended: int
    draws_inside: int
    largest: float
    at: float
    mean: float
    std: float

    @property
    def passed(self) -> bool:
        """Whether every draw is inside its window at every amplitude."""
        return self.extended == self.values


def step_1(pair: Reference, folder: Path | None) -> ExactRow:
    """The exact profiles against the norm's tables, where the folder has them."""
    given, differences = printed(folder, pair, "conicity"), printed(folder, pair, "dr")
    inside = amplitudes = largest = at = None
    if given is not None:
        rows = conicities(pair.fine, [1e-3 * a for a in given["amplitude_mm"]])
        found = rows["conicity"].to_numpy(dtype=float)
        low, high = given["low"].to_numpy(dtype=float), given["high"].to_numpy(dtype=float)
        inside, amplitudes = int(((found >= low) & (found <= high)).sum()), len(given)
        off = np.abs(found - given["conicity"].to_numpy(dtype=float))
        if np.isfinite(off).any():
            largest, at = float(np.nanmax(off)), float(given["amplitude_mm"][int(np.nanargmax(off))])
    close = points = dr_largest = dr_at = None
    if differences is not None:
        y = differences["y_mm"].to_numpy(dtype=float)
        table = pair.table(-1e-3 * y[::-1])
        off = np.abs(1e3 * (table["r_right"] - table["r_left"]).to_numpy()[::-1] - differences["delta_r_mm"])
        close, points = int((off <= CLOSE).sum()), len(off)
        dr_largest, dr_at = float(off.max()), float(y[int(np.argmax(off))])
    at_3 = float(conicities(pair.fine, [SHOWN])["conicity"].iloc[0])
    known = at_3 if np.isfinite(at_3) else None
    return ExactRow(pair.name, known, inside, amplitudes, largest, at, close, points, dr_largest, dr_at)


def step_2(
    pairs: Sequence[Reference], instrument: Instrument, draws: int, tell: Tell = lambda _: None
) -> Iterator[MeasuredRow]:
    """Measured points in place of the exact profiles; each row when it is done."""
    for pair in pairs:
        low, high = windows(pair.exact)
        for error in ERRORS:
            for place in PLACES:
                tell(f"pair {pair.name}, {error} errors, {place}")
                found = np.array([_drawn(pair, instrument, error, place, draw) for draw in range(draws)])
                yield _counted(pair, error, place, found, low, high)


def _drawn(pair: Reference, instrument: Instrument, error: Error, place: str, draw: int) -> Array:
    """Conicities (n,) over AMPLITUDES of one draw; nan where there is none."""
    wheels: tuple[Profile, Profile] | None = None
    rails: tuple[Profile, Profile] | None = None
    if place != "rail":
        wheels = (
            instrument.profile(WHEEL + pair.left, error, draw, 0),
            instrument.profile(WHEEL + pair.right, error, draw, 1),
        )
    if place != "wheel":
        rails = instrument.profile(RAIL, error, draw, 0), instrument.profile(RAIL, error, draw, 1)
    try:
        table = pair.table(shifts(COARSE), wheels, rails)
    except BadInput as refused:
        raise BadInput(
            f"pair {pair.name}, {error} errors of the {place}, draw {draw}: {refused}"
        ) from refused
    return conicities(table, AMPLITUDES)["conicity"].to_numpy(dtype=float)


def _counted(pair: Reference, error: Error, place: str, found: Array, low: Array, high: Array) -> MeasuredRow:
    """A row from the conicities (draws, amplitudes); one that does not exist counts as outside."""
    exact = pair.exact["conicity"].to_numpy(dtype=float)
    off = np.ma.masked_invalid(found - exact)
    inside = np.abs(found - exact) <= tolerance(exact) + ROUNDED
    extended = (found >= low - ROUNDED) & (found <= high + ROUNDED)
    largest = np.abs(off).max(axis=0).filled(0.0)
    mean, std = np.abs(off.mean(axis=0)).filled(0.0), off.std(axis=0).filled(0.0)
    return MeasuredRow(
        pair.name, error, place, len(found), found.size, int(inside.sum()), int(extended.sum()),
        int(extended.all(axis=1).sum()), float(largest.max()), 1e3 * AMPLITUDES[int(largest.argmax())],
        float(mean.max()), float(std.max()),
    )  # fmt: skip
