"""What `railfmi conicity` finds of a pair: its contact table, and the conicities over the amplitude."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from estimator.record import Array
from fmus.contact.geometry.conicity import (
    NONLINEAR,
    equivalent_conicity,
    harmonic_conicity,
    linear_conicity,
    turning_points,
)
from fmus.contact.geometry.pair import Sides
from fmus.contact.geometry.search import check_touches, stand
from fmus.contact.geometry.sides import Both, Given, sides_of
from fmus.contact.geometry.table import contact_table, default_shifts
from fmus.errors import BadInput
from scenarios.output import written

STEP = 2e-5  # m between shifts; the norm's own tables have 0.1 mm
AMPLITUDES = tuple(round(1e-4 * i, 6) for i in range(10, 76))  # m, those of the norm
FURTHER = 0.004  # m
LARGEST = 0.05  # m, no gauge leaves a wheelset more; greater numbers are mm
FORMS: dict[str, Callable[..., Any]] = {
    "conicity": equivalent_conicity, "linear": linear_conicity, "harmonic": harmonic_conicity,
}  # fmt: skip


@dataclass(frozen=True)
class Request:
    """A pair and how it stands; see contact_table. cant None: 1/40, or 0 for a rail given as it lies."""

    wheel: Both[Given]
    rail: Both[Given]
    r0: Both[float] = 0.46
    cant: float | None = None
    gauge: float = 1.435
    back_to_back: float = 1.36
    roll: bool = False
    search: str = "rigid"
    smoothing: float | None = None

    @property
    def sides(self) -> Sides:
        """The pair, read; BadInput tells what is wrong with it."""
        return sides_of(
            self.wheel, self.rail, self.cant, self.gauge, self.r0, self.back_to_back, self.smoothing
        )

    def table(self, sides: Sides, shifts: Array) -> pd.DataFrame:
        """The contact table of the pair, which was read, over shifts (n,), m."""
        left, right = sides.left, sides.right
        return contact_table(
            (left.wheel, right.wheel), (left.rail, right.rail), left.cant, left.gauge, (left.r0, right.r0),
            back_to_back=left.back_to_back, search=self.search, roll=self.roll, shifts=shifts,
        )  # fmt: skip


@dataclass(frozen=True)
class Evaluation:
    """A pair as it was read, its contact table, and rows over the amplitude.

    rows: index amplitude, m; conicity, linear, harmonic: dimensionless, nan where there is none; low, high:
    turning points, m; why: what prevents a conicity, empty where there is one.
    """

    sides: Sides
    table: pd.DataFrame
    rows: pd.DataFrame

    @property
    def difference(self) -> Array:
        """Left less right rolling radius (n,), m, over the table's shifts."""
        return np.asarray(self.table["r_left"] - self.table["r_right"], dtype=float)

    @property
    def nonlinearity(self) -> float:
        """Nonlinearity parameter, 1/m; nan where a conicity that it needs does not exist."""
        low, high = (_value(equivalent_conicity, self.table, a)[0] for a in NONLINEAR)
        return float((high - low) / (NONLINEAR[1] - NONLINEAR[0]))

    def at(self, amplitude: float) -> float:
        """Equivalent conicity at an amplitude, m; nan where there is none."""
        return float(_value(equivalent_conicity, self.table, amplitude)[0])

    def write(self, folder: Path) -> None:
        """Write conicity.csv, contact.csv and result.json, in SI; an interrupted write leaves no part."""
        table = self.table.assign(delta_r=self.difference)
        written(folder / "conicity.csv", self.rows.to_csv(float_format="%.9g"))
        written(folder / "contact.csv", table.to_csv(float_format="%.9g"))
        text = json.dumps(self.result(), indent=1, ensure_ascii=False, allow_nan=False)
        written(folder / "result.json", f"{text}\n")

    def result(self) -> dict[str, Any]:
        """What result.json holds; None where a number does not exist."""
        rows = {name: _known(self.rows[name]) for name in ("conicity", "linear", "harmonic", "low", "high")}
        said = {name: self.table.attrs[name] for name in SAID}
        parameter = self.nonlinearity
        return {
            **said,
            "amplitude": self.rows.index.to_list(),
            **rows,
            "why": {f"{a:g}": why for a, why in self.rows["why"].items() if why},
            "nonlinearity_parameter": parameter if np.isfinite(parameter) else None,
        }

    def lines(self) -> Iterator[str]:
        """Lines to print: one for each of some amplitudes."""
        for a in (0.002, 0.003, 0.004):
            value, why = _value(equivalent_conicity, self.table, a)
            yield f"  {a * 1e3:g} mm: {value:.4f}" if np.isfinite(value) else f"  {a * 1e3:g} mm: none, {why}"
        if np.isfinite(self.nonlinearity):
            yield f"  nonlinearity parameter: {self.nonlinearity * 1e-3:+.4f} 1/mm"


SAID = (
    "wheel", "rail", "r0", "cant", "gauge", "back_to_back", "roll", "search", "wheel_found", "rail_found",
)  # fmt: skip


def evaluated(request: Request, amplitudes: Sequence[float] | None = None) -> Evaluation:
    """The contact of a pair over all shifts, and its conicities at amplitudes, m, by default 1 to 7.5 mm."""
    wanted = AMPLITUDES if amplitudes is None else _amplitudes(amplitudes)
    sides = request.sides
    check_touches(sides, request.roll)
    reach = _reach(sides, request.roll)
    if amplitudes is not None and max(wanted) > reach:
        raise BadInput(
            f"--amplitude {max(wanted):g}: the contact can be followed to {reach:g} m; take a smaller one"
        )
    steps = int(reach / STEP)
    table = request.table(sides, np.asarray(STEP * np.arange(-steps, steps + 1)))
    return Evaluation(sides, table, conicities(table, wanted))


def _reach(sides: Sides, roll: bool) -> float:
    """Largest shift, m, of the table: of the default one, and further for motions that are not symmetric."""
    usual = float(default_shifts(sides, roll)[-1])
    further = usual + FURTHER
    return further if stand(sides, np.array([-further, further]), roll).rests.all() else usual


def conicities(table: pd.DataFrame, amplitudes: Sequence[float]) -> pd.DataFrame:
    """Rows of Evaluation for a contact table and amplitudes, m."""
    rows = []
    for a in (float(a) for a in amplitudes):
        found = {name: _value(form, table, a) for name, form in FORMS.items()}
        turns, straight_on = _value(turning_points, table, a)
        low, high = (np.nan, np.nan) if straight_on else turns
        rows.append(
            {"amplitude": a, **{name: value for name, (value, _) in found.items()}, "low": low, "high": high,
             "why": found["conicity"][1]}
        )  # fmt: skip
    return pd.DataFrame(rows).set_index("amplitude")


def _value(form: Callable[..., Any], table: pd.DataFrame, amplitude: float) -> tuple[Any, str]:
    """A form at an amplitude, m, and why there is none."""
    try:
        return form(table, amplitude), ""
    except ValueError as error:
        return np.nan, str(error)


def _amplitudes(given: Sequence[float]) -> list[float]:
    for a in given:
        if not 0 < a <= LARGEST:
            raise BadInput(f"--amplitude {a:g}: give amplitudes in m, above 0 and up to {LARGEST:g}")
    return sorted(set(given))


def _known(values: "pd.Series[float]") -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]
