"""What the rows of a fleet say together: drifts, vehicles that deviate, and effects of a class."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import false_discovery_control
from scipy.stats import t as student

from scenarios.fleet.declaration import CALIBRATED
from scenarios.fleet.drift import Course, Points, courses
from scenarios.fleet.rows import Row
from scenarios.fleet.scatter import EFFICIENCY, Array, Mean, excess, mean_over
from scenarios.tasks.store import FAILED

QUANTITY = ("command", "setup", "model", "class", "place", "kind", "location", "parameter")
FOLLOWED = ("parameter", "form", CALIBRATED)  # kinds of rows beside effects that are followed over mileage
SURE = ("traced", "several", "sensor_fault")  # verdicts whose effects are one answer, not members of a class
LEAST_VEHICLES = 4  # of a class, so that one of them can deviate from the others
Quantity = tuple[str, ...]


@dataclass(frozen=True)
class Drift:
    """The course of a quantity in a vehicle; q_value: by Y. Benjamini and Y. Hochberg (J. R. Statist. Soc. B
    57 (1995), 289-300) over all courses of the fleet; drifts: whether it is below the fleet's level.
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
    return Findings(_drifts(series, level), _levels(series, level))


Series = Mapping[Quantity, Mapping[str, list[Row]]]


def _series(rows: Sequence[Row]) -> Series:
    """Rows with a value and an error, by quantity and vehicle, in the order of the table."""
    found: dict[Quantity, dict[str, list[Row]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        if row["size"] is not None and row["std"] and _is_followed(row):
            found[tuple(str(row[name]) for name in QUANTITY)][row["vehicle"]].append(row)
    return found


def _is_followed(row: Row) -> bool:
    if row["verdict"] in (FAILED, "diverged"):
        return False
    return row["kind"] in FOLLOWED or (row["command"] == "close-loop" and row["verdict"] in SURE)


def _drifts(series: Series, level: float) -> list[Drift]:
    found: list[tuple[Quantity, str, Points, Course, str]] = []
    for quantity, vehicles in series.items():
        points = {v: _points(rows) for v, rows in vehicles.items()}
        enough = {v: p for v, p in points.items() if p.enough}
        for (vehicle, p), course in zip(enough.items(), courses([*enough.values()]), strict=True):
            found.append((quantity, vehicle, p, course, vehicles[vehicle][0]["unit"]))
    q = _q_values([course.p_value for _, _, _, course, _ in found])
    return [Drift(*entry, float(value), bool(value < level)) for entry, value in zip(found, q, strict=True)]


def _points(rows: Sequence[Row]) -> Points:
    known = [row for row in rows if row["mileage"] is not None]
    return Points.of(*([row[name] for row in known] for name in ("mileage", "size", "std")))


def _q_values(p: Sequence[float]) -> Array:
    values: Array = false_discovery_control(p) if len(p) else np.zeros(0)
    return values


def _levels(series: Series, level: float) -> list[Level]:
    found = [entry for quantity, vehicles in series.items() for entry in _of_class(quantity, vehicles)]
    tested = [entry["p_value"] for entry in found if entry["p_value"] is not None]
    q = iter(_q_values(tested))
    levels = []
    for entry in found:
        value = None if entry["p_value"] is None else float(next(q))
        levels.append(Level(**entry, q_value=value, deviates=value is not None and value < level))
    return levels


def _of_class(quantity: Quantity, vehicles: Mapping[str, Sequence[Row]]) -> Iterator[dict[str, Any]]:
    """The vehicles of a class with their means, and how far each is from the others."""
    values = {v: np.array([[r["size"], r["std"]] for r in rows]).T for v, rows in vehicles.items()}
    repeated = [x for x in values.values() if x.shape[1] > 1]
    scatter = excess(
        lambda tau: np.array([_about_mean(x[0], x[1], tau) for x in repeated]),
        np.array([x.shape[1] - 1.0 for x in repeated]),
        float(min(x[1].min() for x in values.values())),
    )
    weights = {v: 1 / (x[1] ** 2 + scatter**2) for v, x in values.items()}
    means = {v: float(np.sum(weights[v] * x[0]) / weights[v].sum()) for v, x in values.items()}
    errors = {v: float(w.sum() ** -0.5) for v, w in weights.items()}
    of_class = mean_over([*means.values()], [*errors.values()])
    freedom = EFFICIENCY * (of_class.groups - 1)
    for v, rows in vehicles.items():
        distance = (means[v] - of_class.centre) / float(np.hypot(errors[v], of_class.spread))
        tested = of_class.groups >= LEAST_VEHICLES
        yield {
            "quantity": quantity, "vehicle": v, "value": means[v], "std": errors[v], "records": len(rows),
            "unit": rows[0]["unit"], "of_class": of_class, "distance": distance,
            "p_value": float(2 * student.sf(abs(distance), freedom)) if tested else None,
        }  # fmt: skip


def _about_mean(value: Array, std: Array, tau: float) -> float:
    w = 1 / (std**2 + tau**2)
    return float(np.sum(w * (value - np.sum(w * value) / w.sum()) ** 2))
