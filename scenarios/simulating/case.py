"""One variant of a scenario: prepared and checked as a whole, then run."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from estimator.record import Array
from fmus.contact.forces.conditions import CONDITIONS
from fmus.errors import BadInput, did_you_mean
from fmus.export.provenance import isolation_of
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.archive import Archive
from fmus.host.master.connections import Connection
from fmus.host.master.master import Master
from fmus.host.master.recording import TIME, Recording
from scenarios.simulating.building import Builder, beside
from scenarios.simulating.declaration import Declaration, Geometry, Member, Moment
from scenarios.simulating.expression import Expression
from scenarios.simulating.given import sources
from scenarios.simulating.value import Value
from scenarios.track.sensors import Sensor, measure, read_sensors

Progress = Callable[[float, float], None]
SENSORS = "sensors"  # prefix of a sensor's reading
CONTACT = "contact"  # prefix of a column of a contact table
SHIFT = "y"  # the axis of a contact table
UNITS = {
    "r": "m",
    "delta": "rad",
    "phi": "rad",
    "a": "m",
    "b": "m",
    "z": "m",
    "eta": "m",
    "A": "1/m",
    "B": "1/m",
}


@dataclass(frozen=True, eq=False)
class Run:
    """The output of a variant: its recording, and all of its signals by name."""

    recording: Recording
    signals: Mapping[str, Value]
    measured: Recording | None = None


class Case(Protocol):
    """A variant that is ready to run; `names` are the signals that it produces."""

    names: frozenset[str]
    duration: float | None

    def run(self, tell: Progress | None) -> Run:
        """Run it."""
        ...


def prepared(
    d: Declaration,
    file: Path,
    wanted: Iterable[Expression],
    builder: Builder,
    stack: ExitStack,
    isolation: Isolation | None = ISOLATED,
) -> Case:
    """A variant in which all names have been checked; wanted: its formulas, with names without variant.

    isolation: limits of the process in which foreign FMUs run; None runs them in this process.
    """
    if d.contact is not None:
        return _TableCase(d.contact, file.parent, wanted)
    return _MotionCase(d, file, wanted, builder, stack, isolation)


class _TableCase:
    """A contact table over the lateral shift."""

    duration: float | None = None

    def __init__(self, geometry: Geometry, folder: Path, wanted: Iterable[Expression]) -> None:
        from fmus.contact.geometry.table import contact_table  # few scenarios search for the contact

        options = geometry.model_dump(exclude={"reach", "points"})
        options |= {name: beside(options[name], folder) for name in ("wheel", "rail")}
        shifts = np.linspace(-geometry.reach, geometry.reach, geometry.points)
        try:
            self._table = contact_table(**options, shifts=shifts)
        except BadInput as error:
            raise BadInput(f"[contact] {error}") from error
        self.names = frozenset(f"{CONTACT}.{column}" for column in self._table.columns)
        _check_known(wanted, self.names)

    def run(self, tell: Progress | None) -> Run:
        """The table as signals over the shift."""
        shift = self._table.index.to_numpy(dtype=np.float64)
        units = {column: UNITS[column.partition("_")[0]] for column in self._table.columns}
        data = self._table.reset_index(names=SHIFT)
        recording = Recording(data, {SHIFT: "m", **units})
        found = {f"{CONTACT}.{c}": Value(data[c].to_numpy(), shift, units[c]) for c in units}
        return Run(recording, found)


class _MotionCase:
    """FMUs that are simulated together."""

    def __init__(
        self, d: Declaration, file: Path, wanted: Iterable[Expression], builder: Builder, stack: ExitStack,
        isolation: Isolation | None,
    ) -> None:  # fmt: skip
        if d.duration is None or d.step is None:
            raise BadInput("keys 'duration' and 'step' are missing")
        self.duration: float | None = d.duration
        self._length, self._seed = d.duration, d.seed
        archives = {
            name: stack.enter_context(_archive(member, builder.path(member, f"fmus.{name}", file), isolation))
            for name, member in d.fmus.items()
        }
        fmus = {name: archive.description.widened for name, archive in archives.items()}
        self._sensors: dict[str, Sensor] = read_sensors(d.sensors)
        known = {f"{name}.{v}" for name, fmu in fmus.items() for v in fmu.variables}
        readings = {f"{SENSORS}.{name}" for name in self._sensors}
        needed = _check_known(wanted, known | readings)
        for name, sensor in self._sensors.items():
            if sensor.of is None or sensor.of not in known:
                near = did_you_mean(sensor.of or name, known)
                raise BadInput(f"key 'sensors.{name}.of' must name a signal, 'fmu.variable'; {near}")
            needed.append(sensor.of)
        names = d.record.names
        outputs = [f"{name}.{v}" for name, fmu in fmus.items() for v in fmu.outputs]
        recorded = [*(outputs if names is None else names), *(n for n in needed if n not in readings)]
        self.names = frozenset(recorded) | readings
        self._master = stack.enter_context(
            Master(
                archives,
                [Connection(**dict(wire)) for wire in d.connections],
                step=d.step,
                steps={name: m.step for name, m in d.fmus.items() if m.step is not None},
                order=d.order,
                extrapolation=d.extrapolation,
                inputs=sources(d, fmus, file.parent),
                parameters=_values(d, "parameters"),
                initial=_values(d, "initial"),
                events=[_event(moment) for moment in d.events],
                record=recorded,
                record_step=d.record.step,
            )
        )

    def run(self, tell: Progress | None) -> Run:
        """Run the FMUs, and compute the readings of the sensors."""
        recording = self._master.run(self._length, tell)
        data = recording.data
        t = data[TIME].to_numpy()
        found = {
            name: Value(data[name].to_numpy(), t, recording.units[name])
            for name in data.columns
            if name != TIME
        }
        if not self._sensors or t.size < 2:
            return Run(recording, found)
        truth = {name: value.y for name, value in found.items()}
        readings = measure(t, truth, self._sensors, self._seed)
        units = {name: recording.units[sensor.of or name] for name, sensor in self._sensors.items()}
        times = readings[TIME].to_numpy()
        found |= {
            f"{SENSORS}.{name}": _reading(times, readings[name].to_numpy(), unit)
            for name, unit in units.items()
        }
        return Run(recording, found, Recording(readings, {TIME: "s", **units}))


def _archive(member: Member, fmu: Path, isolation: Isolation | None) -> Archive:
    return Archive(fmu, isolation_of(fmu, isolation) if member.model is None else None)


def _reading(times: Array, reading: Array, unit: str | None) -> Value:
    """A sensor's samples without those that are lost."""
    kept = np.isfinite(reading)
    return Value(reading[kept], times[kept], unit)


def _check_known(wanted: Iterable[Expression], known: Iterable[str]) -> list[str]:
    """All names in formulas; raises BadInput if one does not exist."""
    names, found = frozenset(known), list[str]()
    for formula in wanted:
        for name in formula.names:
            if name not in names:
                raise BadInput(f"{formula.where}: there is no signal '{name}'; {did_you_mean(name, names)}")
            found.append(name)
    return found


def _values(d: Declaration, key: str) -> dict[str, float]:
    """Parameters or start values of all FMUs by 'fmu.variable'."""
    found: dict[str, float] = {}
    for name, member in d.fmus.items():
        given = dict(getattr(member, key))
        if key == "parameters" and member.friction is not None:
            given = {**CONDITIONS[member.friction], **given}
        found |= {f"{name}.{variable}": value for variable, value in given.items()}
    return found


def _event(moment: Moment) -> tuple[float, dict[str, float]]:
    values = dict(moment.set)
    for name, condition in moment.friction.items():
        values |= {f"{name}.{variable}": v for variable, v in CONDITIONS[condition].items()}
    return moment.time, values
