"""Sensor faults by kind. Every file here that defines a SensorFault adds one; there is no other list."""

import sys
from collections.abc import Mapping, Sequence

from estimator.record import Array
from estimator.sensor_faults.sensor_fault import SensorFault
from fmus.errors import BadInput
from fmus.registry import by_name, classes_in


def _in_order(found: Mapping[str, type[SensorFault]]) -> dict[str, SensorFault]:
    """Faults by kind, sorted by `place`; raises BadInput if a fault is incomplete."""
    for kind, fault in found.items():
        lacking = [n for n in ("parameter", "unit") if not isinstance(getattr(fault, n, None), str)]
        if lacking:
            raise BadInput(f"sensor fault '{kind}' of {fault.__module__} has no '{lacking[0]}'; give it one")
        if not kind.startswith("sensor_"):
            raise BadInput(f"sensor fault '{kind}' of {fault.__module__}: call it 'sensor_{kind}'")
    return {f.kind: f for f in sorted((fault() for fault in found.values()), key=lambda f: f.place)}


# the classes that are found are concrete
_FOUND = classes_in(sys.modules[__name__], SensorFault)  # type: ignore[type-abstract]
FAULTS: dict[str, SensorFault] = _in_order(by_name(_FOUND, "kind"))
_IN_A_CHANNEL = sorted(FAULTS.values(), key=lambda fault: fault.stage)


def faulty(y: Array, t: Array, outputs: Sequence[str], theta: Mapping[str, float]) -> Array:
    """The outputs y (N, n) as measured by faulty sensors; faults with size zero leave y unchanged."""
    shown = y
    for j, output in enumerate(outputs):
        for fault in _IN_A_CHANNEL:
            if value := theta.get(fault.name_at(output), 0.0):
                shown = y.copy() if shown is y else shown
                shown[:, j] = fault.apply(shown[:, j], t, value)
    return shown
