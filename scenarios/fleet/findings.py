"""What the rows of a fleet say together: drifts, vehicles that deviate, and effects of a class."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import false_discovery_control
from scipy.stats import t as student

from scenarios.fleet.beliefs import says_nothing
from scenarios.fleet.declaration import CALIBRATED
from scenarios.fleet.drift import Course, Points, courses
from scenarios.fleet.policy import POLICY
from scenarios.fleet.repeats import Repeats, Scatter, scatter_of, share_left, variance_of
from scenarios.fleet.rows import Row
from scenarios.fleet.scatter import Mean, mean_over
from scenarios.tasks.store import FAILED

QUANTITY = ("command", "setup", "model", "class", "place", "kind", "location", "parameter")
FOLLOWED = ("parameter", "form", CALIBRATED)  # kinds of rows beside effects that are followed over mileage
SURE = ("traced", "several", "sensor_fault")  # verdicts whose effects are one answer, not members of a class
Quantity = tuple[str, ...]


@dataclass(frozen=True)
class Drift:
    """The course of a quantity in a vehicle; q_value: by Y. Benjamini and Y. Hochberg (J. R. Statist. Soc. B
    57 (1995), 289-300) over all that is tested in the fleet; drifts: whether it is below the fleet's level.
    """

    quantity: Quantity
    vehicle: str
    points: Points
    course: Course
    unit: str
    q_value: float
    drifts: bool


@dataclass(frozen=True)
class Level:
    """The mean of a quantity in a vehicle against its class.

    std: of the mean, with the scatter of repeated records; distance: from the class's weighted median in
    standard deviations of error and spread together; p_value, q_value: None in a class of too few vehicles.
    """

    quantity: Quantity
    vehicle: str
    value: float
    std: float
    records: int
    unit: str
    of_class: Mean
    distance: float
    p_value: float | None
    q_value: float | None
    deviates: bool


@dataclass(frozen=True)
class Findings:
    """All that the rows say together."""

    drifts: list[Drift]
    levels: list[Level]


def findings_of(rows: Sequence[Row], level: float) -> Findings:
    """Drifts and levels of all quantities in a fleet's rows; level: rate of false ones among those named."""
    series = _series(rows)
    followed, compared = [*_followed(series)], [*_compared(series)]
    p = [*(f[3].p_value for f in followed), *(c["p_value"] for c in compared if c["p_value"] is not None)]
    q = iter(false_discovery_control(p).tolist() if p else ())  # one rate over all that is said
    drifts = [Drift(*entry, q_value=(value := next(q)), drifts=value < level) for entry in followed]
    levels = []
    for entry in compared:
        value = None if entry["p_value"] is None else next(q)
        levels.append(Level(**entry, q_value=value, deviates=value is not None and value < level))
    return Findings(drifts, levels)


Series = Mapping[Quantity, Mapping[str, list[Row]]]


def _series(rows: Sequence[Row]) -> Series:
    """Rows with a value and an error, by quantity and vehicle, in the order of the table."""
    found: dict[Quantity, dict[str, list[Row]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        if row["size"] is not None and row["std"] and _is_followed(row):
            found[tuple(str(row[name]) for name in QUANTITY)][row["vehicle"]].append(of_the_record(row))
    return found


def of_the_record(row: Row) -> Row:
    """A row with the value and error that its record alone gives, where it is known what was believed."""
    if row["own"] is None or row["own_std"] is None:
        return row
    return {**row, "size": row["own"], "std": row["own_std"]}


def _is_followed(row: Row) -> bool:
    if row["verdict"] in (FAILED, "diverged") or row["held"]:
        return False
    if row["own_std"] is not None and says_nothing(row["own_std"], row["prior_std"]):
        return False
    return row["kind"] in FOLLOWED or (row["command"] == "close-loop" and row["verdict"] in SURE)


def _followed(series: Series) -> Iterator[tuple[Quantity, str, Points, Course, str]]:
    """The courses of all quantities of all vehicles with enough records."""
    for quantity, vehicles in series.items():
        points = {v: _points(rows) for v, rows in vehicles.items()}
        enough = {v: p for v, p in points.items() if p.enough}
        for (vehicle, p), course in zip(enough.items(), courses([*enough.values()]), strict=True):
            yield quantity, vehicle, p, course, vehicles[vehicle][0]["unit"]


def _points(rows: Sequence[Row]) -> Points:
    known = [row for row in rows if row["mileage"] is not None]
    return Points.of(*([row[name] for row in known] for name in ("mileage", "size", "std")))


def _compared(series: Series) -> Iterator[dict[str, Any]]:
    """The vehicles of each class with their means, and how far each is from the others."""
    for quantity, vehicles in series.items():
        yield from _of_class(quantity, vehicles)


def _of_class(quantity: Quantity, vehicles: Mapping[str, Sequence[Row]]) -> Iterator[dict[str, Any]]:
    values = {v: _about_mean(rows) for v, rows in vehicles.items()}
    s = scatter_of([*values.values()])
    means = {v: _mean(x, s) for v, x in values.items()}
    of_class = mean_over([m for m, _ in means.values()], [e for _, e in means.values()])
    between = POLICY.efficiency * (of_class.groups - 1)
    for v, rows in vehicles.items():
        mean, error = means[v]
        distance = (mean - of_class.centre) / float(np.hypot(error, of_class.spread))
        p_value = None
        if of_class.groups >= POLICY.fewest_vehicles:
            own = error, s.freedom(values[v].freedom)
            # a spread of 0 is found, not known
            p_value = 2 * float(
                student.sf(abs(distance), min(_joined(own, (of_class.spread, between)), between))
            )
        yield {
            "quantity": quantity, "vehicle": v, "value": mean, "std": error, "records": len(rows),
            "unit": rows[0]["unit"], "of_class": of_class, "distance": distance,
            "p_value": p_value,
        }  # fmt: skip


def _about_mean(rows: Sequence[Row]) -> Repeats:
    """The records of a vehicle about their mean, in the order of their mileage where all have one."""
    some = sorted(rows, key=lambda r: r["mileage"]) if all(r["mileage"] is not None for r in rows) else rows
    value, std = (np.array([r[name] for r in some], dtype=np.float64) for name in ("size", "std"))
    return Repeats(value, std, np.ones((len(value), 1)))


def _mean(x: Repeats, s: Scatter) -> tuple[float, float]:
    """The weighted mean of a vehicle with its standard error, which contains the scatter."""
    w = s.weights(x.std)
    variance = float(variance_of(np.sqrt(w) / w.sum(), s.correlation)[-1])
    left = share_left(variance * w.sum(), len(w), 1)
    scale = float(s.scale(x.squares(s.beyond) / left, x.freedom))
    return float(np.sum(w * x.value) / w.sum()), float(np.sqrt(variance * scale))


def _joined(*parts: tuple[float, float]) -> float:
    """Degrees of freedom of a sum of variances, each given by its root and its own degrees of freedom.

    F. E. Satterthwaite, Biometrics Bulletin 2 (1946), 110-114.
    """
    whole = sum(std**2 for std, _ in parts)
    unknown = sum((std**2 / whole) ** 2 / freedom for std, freedom in parts) if whole else 0.0
    return 1 / unknown if unknown else float("inf")
