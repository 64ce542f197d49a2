"""Do estimators follow the wear? The geometry of each state, by least squares from a ride (Ward et al. 2010).

A wheelset with the worn wheels runs over random alignment, and its motion is measured. Least squares in bins
of the shift find the radii and the contact angles, with equations that do not know the profiles. Once the
alignment is known; once it is not, and is found in a loop with the geometry, which begins with new wheels.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from estimator.record import Array
from fmus.contact import contact_table, equivalent_conicity
from fmus.export.builders.native.build import build_native
from fmus.wheelset.model import Wheelset
from scenarios.literature.case import Record
from scenarios.literature.linear_creep import by_fmu
from scenarios.literature.profile_loop import Rolling, looped
from scenarios.literature.profile_rls import ALONE, FLANGE, R0, Curves, identified
from scenarios.wearing.evolution import State
from scenarios.wearing.service import Tell

AMPLITUDE = 2e-3  # m, of the conicity; the ride is over alignment of 2 mm rms
DIFFERENCE = 1  # place of r_L - r_R among the combinations


@dataclass(frozen=True)
class Followed:
    """What least squares find of a state: shifts (n,), m, and r_L - r_R there, found, its std and true, m.

    conicity, true_conicity: at 2 mm, which the ride reaches; nan where there is none. looped: error of the
    difference over its range, and of the alignment over its rms, where neither is known.
    """

    km: float
    shift: Array
    found: Array
    std: Array
    true: Array
    conicity: float
    true_conicity: float
    looped: tuple[float, float]

    @property
    def error(self) -> float:
        """Root mean square of the error over the range of the true difference."""
        return float(np.sqrt(np.mean((self.found - self.true) ** 2)) / np.ptp(self.true))


def followed(states: tuple[State, ...], tell: Tell) -> tuple[Followed, ...]:
    """The estimates of all states; each takes the build of an FMU and two minutes of a ride."""
    found = []
    table = contact_table(**states[0].track.stands)
    new = Rolling(table.index.to_numpy(dtype=np.float64), table["phi"].to_numpy(dtype=np.float64))
    for number, state in enumerate(states, 1):
        tell(f"following the wear by least squares, state {number} of {len(states)}")
        found.append(_followed(state, new))
    return tuple(found)


def _followed(state: State, new: Rolling) -> Followed:
    with TemporaryDirectory() as folder:
        record = by_fmu(build_native(Wheelset(track=state.track), Path(folder)))(ALONE)
    curves = identified(record)
    used = np.abs(curves.shift) <= FLANGE
    shift = curves.shift[used]
    table = contact_table(**state.track.stands)
    y = table.index.to_numpy(dtype=np.float64)
    difference = (table["r_left"] - table["r_right"]).to_numpy(dtype=np.float64)
    true = np.interp(shift, y, difference)
    return Followed(
        state.km, shift, curves.value[used, DIFFERENCE], curves.std[used, DIFFERENCE], true,
        _conicity(_table(curves)), _conicity(table), _in_a_loop(record, new, y, difference),
    )  # fmt: skip


def _in_a_loop(record: Record, new: Rolling, y: Array, difference: Array) -> tuple[float, float]:
    """Errors of r_L - r_R over its range, and of the alignment over its rms; difference (n,) is true at y."""
    last, d = looped(record, new)[-1], record.columns["y_irr"]
    bins = last.bins
    used = np.abs(bins.shift) <= FLANGE
    true = np.interp(bins.shift[used], y, difference)
    radii = float(np.sqrt(np.mean((bins.value[used, DIFFERENCE] - true) ** 2)) / np.ptp(true))
    alignment = record.columns["y"] - last.shift - d
    return radii, float(np.sqrt(np.mean(alignment**2)) / np.sqrt(np.mean(d**2)))


def _table(found: Curves) -> pd.DataFrame:
    """Radii over the shift, m; only their difference counts."""
    half = found.value[:, DIFFERENCE] / 2
    return pd.DataFrame({"r_left": R0 + half, "r_right": R0 - half}, index=pd.Index(found.shift, name="y"))


def _conicity(table: pd.DataFrame) -> float:
    try:
        return float(equivalent_conicity(table, AMPLITUDE))
    except ValueError:
        return float("nan")
