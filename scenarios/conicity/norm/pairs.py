"""The reference pairs of EN 15302:2021, the norm's tables of them where they are given, and its tolerance.

In the norm y points to the right, so its radius difference is that of the right wheel less that of the left.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from estimator.record import Array
from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.profile import Profile
from fmus.contact.geometry.table import contact_table
from fmus.errors import BadInput, did_you_mean
from fmus.taken import check_text
from scenarios.conicity.evaluating import AMPLITUDES, STEP, conicities

RAIL, WHEEL = "EN15302_RailA", "EN15302_Wheel"
GAUGE, CANT = 1.43516, 0.0  # m, slope; the rail is given as it lies
RADIUS, SMALLER = 0.46, 0.459  # m, half of 920 and 918 mm
REACH = 0.010  # m, of the shifts
ABSOLUTE, SHARE = 0.05, 0.5  # of the tolerance
SHIFTED = 1e-4  # m, by which an amplitude may be off in the extended window
COLUMNS = {"dr": ("y_mm", "delta_r_mm"), "conicity": ("amplitude_mm", "conicity", "low", "high")}


@dataclass(frozen=True)
class Reference:
    """A reference pair: letters of the left and the right wheel, radii left and right, m."""

    name: str
    left: str
    right: str
    r0: tuple[float, float] = (RADIUS, RADIUS)

    def table(
        self,
        shifts: Array,
        wheels: tuple[Profile, Profile] | None = None,
        rails: tuple[Profile, Profile] | None = None,
    ) -> pd.DataFrame:
        """The contact table over shifts (n,), m: exact profiles, or others in their place (left, right)."""
        exact = exact_profile(WHEEL + self.left), exact_profile(WHEEL + self.right)
        return contact_table(
            wheels or exact, rails or exact_profile(RAIL), CANT, GAUGE, self.r0, search="rigid", roll=False,
            shifts=shifts,
        )  # fmt: skip

    @cached_property
    def fine(self) -> pd.DataFrame:
        """The contact table of the exact profiles over fine shifts."""
        return self.table(shifts(STEP))

    @cached_property
    def exact(self) -> pd.DataFrame:
        """Rows of conicities of the exact profiles, as in evaluating.Evaluation, with those at +-0.1 mm."""
        rows = conicities(self.fine, AMPLITUDES)
        for name, off in (("before", -SHIFTED), ("behind", SHIFTED)):
            rows[name] = conicities(self.fine, [a + off for a in AMPLITUDES])["conicity"].to_numpy()
        return rows


def shifts(step: float) -> Array:
    """Shifts (n,), m, over the reach of the norm's amplitudes."""
    steps = round(REACH / step)
    return np.asarray(step * np.arange(-steps, steps + 1))


def tolerance(conicity: Array) -> Array:
    """The norm's tolerance of a conicity."""
    return np.minimum(ABSOLUTE, SHARE * np.abs(conicity))


def windows(rows: pd.DataFrame) -> tuple[Array, Array]:
    """Least and greatest conicity (n,) that the norm allows where the amplitude may also be 0.1 mm off."""
    three = rows[["before", "conicity", "behind"]].to_numpy(dtype=float)
    return (three - tolerance(three)).min(axis=1), (three + tolerance(three)).max(axis=1)


def references(named: Sequence[str] | None = None) -> list[Reference]:
    """The reference pairs, or those of these names: alike wheels, unlike diameters, A right with B left."""
    known = {}
    for letter in "ABCHI":
        known[letter] = Reference(letter, letter, letter)
        known[f"{letter}mod"] = Reference(f"{letter}mod", letter, letter, (SMALLER, RADIUS))
    known["AB"] = Reference("AB", "B", "A")
    for name in named or ():
        if name not in known:
            raise BadInput(f"--pair '{name}' is no reference pair; {did_you_mean(name, known)}")
    return [known[name] for name in named or known]


def check_folder(folder: Path | None, pairs: Sequence[Reference]) -> None:
    """BadInput if a folder has none of the norm's tables of some pairs."""
    if folder is not None and not any(_table(folder, p, what).is_file() for p in pairs for what in COLUMNS):
        raise BadInput(
            f"--reference {folder}: has no table of these pairs; give a folder with files such as "
            f"{_table(folder, pairs[0], 'conicity').name}"
        )


def _table(folder: Path, pair: Reference, what: str) -> Path:
    return folder / f"Wheel{pair.name}RailA_{what}.csv"


def printed(folder: Path | None, pair: Reference, what: str) -> pd.DataFrame | None:
    """The norm's table "dr" or "conicity" of a pair, where the folder has it; mm as printed."""
    file = None if folder is None else _table(folder, pair, what)
    if file is None or not file.is_file():
        return None
    check_text(file)
    try:
        table = pd.read_csv(file)
    except (ValueError, OSError) as error:
        raise BadInput(f"{file}: is no table ({error}); give a CSV file with a header") from error
    for column in COLUMNS[what]:
        if column not in table:
            raise BadInput(f"{file}: has no column '{column}'; give one with {', '.join(COLUMNS[what])}")
    numbers: pd.DataFrame = table.apply(pd.to_numeric, errors="coerce")
    if not len(table) or not np.isfinite(numbers[[*COLUMNS[what]]].to_numpy(dtype=float)).all():
        raise BadInput(f"{file}: has no rows, or a cell that is not a number; give the table as printed")
    return numbers
