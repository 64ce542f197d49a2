"""The findings of a fleet as tables, in which each quantity is named by the columns of the results."""

from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from scenarios.fleet.findings import QUANTITY, Drift, Level
from scenarios.fleet.pooling import Pooled

TEXT, NUMBER, WHOLE, YES = pa.string(), pa.float64(), pa.int64(), pa.bool_()
_NAMED = [(name, TEXT) for name in (*QUANTITY, "vehicle", "unit")]
DRIFT_COLUMNS = pa.schema(
    [
        *_NAMED, ("records", WHOLE), ("drifts", YES), ("form", TEXT), ("slope", NUMBER),
        ("slope_std", NUMBER),
        ("slope_low_95", NUMBER), ("slope_high_95", NUMBER), ("change_at", NUMBER), ("change_low_95", NUMBER),
        ("change_high_95", NUMBER), ("change_size", NUMBER), ("change_std", NUMBER),
        ("change_size_low_95", NUMBER), ("change_size_high_95", NUMBER), ("scatter", NUMBER),
        ("correlation", NUMBER), ("p_value", NUMBER), ("q_value", NUMBER),
    ]
)  # fmt: skip
LEVEL_COLUMNS = pa.schema(
    [
        *_NAMED, ("records", WHOLE), ("deviates", YES), ("value", NUMBER), ("std", NUMBER),
        ("class_mean", NUMBER), ("class_std", NUMBER), ("class_median", NUMBER), ("class_spread", NUMBER),
        ("vehicles", WHOLE), ("distance", NUMBER), ("p_value", NUMBER), ("q_value", NUMBER),
    ]
)  # fmt: skip
EFFECT_COLUMNS = pa.schema(
    [
        *((n, TEXT) for n in ("setup", "model", "class", "kind", "location", "parameter", "unit")),
        ("size", NUMBER), ("std", NUMBER), ("spread", NUMBER), ("share", NUMBER), ("share_low_95", NUMBER),
        ("share_high_95", NUMBER),
        *((n, pa.list_(TEXT)) for n in ("shown", "possible", "absent", "blind", "untraced")),
    ]
)  # fmt: skip
Row = dict[str, Any]


def drift_row(d: Drift) -> Row:
    """A course as a row of DRIFT_COLUMNS."""
    c = d.course.change
    change: Mapping[str, float | None] = {
        "change_at": c.at if c else None,
        "change_low_95": c.low if c else None,
        "change_high_95": c.high if c else None,
        "change_size": c.size if c else None,
        "change_std": c.std if c else None,
        "change_size_low_95": c.size_low if c else None,
        "change_size_high_95": c.size_high if c else None,
    }
    return {
        **_named(d.quantity, d.vehicle, d.unit), "records": d.course.records, "drifts": d.drifts,
        "form": d.course.form, "slope": d.course.line.slope, "slope_std": d.course.line.std,
        "slope_low_95": d.course.low, "slope_high_95": d.course.high, **change,
        "scatter": d.course.scatter, "correlation": d.course.correlation,
        "p_value": d.course.p_value, "q_value": d.q_value,
    }  # fmt: skip


def level_row(x: Level) -> Row:
    """A level as a row of LEVEL_COLUMNS."""
    return {
        **_named(x.quantity, x.vehicle, x.unit), "records": x.records, "deviates": x.deviates,
        "value": x.value, "std": x.std, "class_mean": x.of_class.value, "class_std": x.of_class.std,
        "class_median": x.of_class.centre, "class_spread": x.of_class.spread, "vehicles": x.of_class.groups,
        "distance": x.distance, "p_value": x.p_value, "q_value": x.q_value,
    }  # fmt: skip


def effect_row(x: Pooled) -> Row:
    """An effect of a class as a row of EFFECT_COLUMNS."""
    return {
        "setup": x.setup, "model": x.model, "class": x.vehicle_class, "kind": x.kind, "location": x.location,
        "parameter": x.parameter, "unit": x.unit, "size": x.size.value, "std": x.size.std,
        "spread": x.size.spread, "share": x.share, "share_low_95": x.share_low,
        "share_high_95": x.share_high, "shown": x.shown, "possible": x.possible, "absent": x.absent,
        "blind": x.blind, "untraced": x.untraced,
    }  # fmt: skip


def _named(quantity: Sequence[str], vehicle: str, unit: str) -> Row:
    return {**dict(zip(QUANTITY, quantity, strict=True)), "vehicle": vehicle, "unit": unit}
