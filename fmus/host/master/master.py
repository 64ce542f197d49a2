"""The master: several FMUs, connected by name, run on one clock."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from math import inf, isfinite
from numbers import Real
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from fmus.errors import BadInput
from fmus.host.apart.isolation import FmuEnded
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError
from fmus.host.instance import Instance
from fmus.host.master.clock import Event, Plan, clock
from fmus.host.master.connections import (
    Address,
    Connection,
    Directory,
    links,
)
from fmus.host.master.elsewhere import run_elsewhere
from fmus.host.master.interrupt import stopped_by_ctrl_c
from fmus.host.master.march import March, Tell
from fmus.host.master.recording import Recorder, Recording, SharedCells, Stop
from fmus.host.master.samples import EXTRAPOLATIONS
from fmus.host.master.signals import Signal, Source, signal
from fmus.host.master.wiring import Scheme, Wiring

Order = Literal["jacobi", "gauss_seidel"]
Extrapolation = Literal["hold", "linear"]


class Master:
    """Connected FMUs, checked and ready to run; BadInput where anything does not fit.

    fmus: by name, an FMI 2.0 or 3.0 co-simulation FMU each: a file, an Archive, or an Fmu (which is
    restarted and left open). All other names are 'fmu.variable'.
    connections: (output, input) pairs or Connections.
    step: communication step, s; steps: by FMU where it differs, each a multiple of the shortest one.
    order: "jacobi", all FMUs step from what was known before; "gauss_seidel", in the order of `fmus`, each
    from where those before it have got to. extrapolation: of a connected input over a step.
    inputs: a number, an expression in t, a function of times (n,), or (times, values), s; read at the
    middle of each step. parameters, initial: values before the start.
    events: (time, {tunable parameter: value}), at that very time.
    record: what to record (all outputs), every record_step, s (the shortest step).
    refresh: outputs that follow inputs at once are read again when the inputs are those of their time.
    FMI 2.0 and 3.0 do not ask this of an FMU; without it such outputs lag by a step.
    """

    def __init__(
        self,
        fmus: Mapping[str, str | Path | Archive | Fmu],
        connections: Iterable[Connection | tuple[str, str]] = (),
        *,
        step: float,
        steps: Mapping[str, float] | None = None,
        order: Order = "jacobi",
        extrapolation: Extrapolation = "hold",
        inputs: Mapping[str, Source] | None = None,
        parameters: Mapping[str, float] | None = None,
        initial: Mapping[str, float] | None = None,
        events: Iterable[tuple[float, Mapping[str, float]]] = (),
        record: Sequence[str] | None = None,
        record_step: float | None = None,
        refresh: bool = True,
    ) -> None:
        if (order, extrapolation) not in EXTRAPOLATIONS:
            raise BadInput(
                f"order '{order}' with extrapolation '{extrapolation}' is not known; order is jacobi or "
                "gauss_seidel, extrapolation hold or linear"
            )
        self._own = ExitStack()
        connections, events = list(connections), list(events)
        self._options = {
            "connections": connections, "step": step, "steps": steps, "order": order,
            "extrapolation": extrapolation, "inputs": inputs or {}, "parameters": parameters,
            "initial": initial, "events": events, "record": record, "record_step": record_step,
            "refresh": refresh,
        }  # fmt: skip
        try:
            self._sources = _opened(fmus, self._own)
            self._descriptions = {n: source.description.widened for n, source in self._sources.items()}
            self._directory = Directory(self._descriptions)
            self._clock = clock(self._descriptions, step, steps or {}, record_step)
            found = links(connections, self._directory)
            self._signals = self._inputs(inputs or {}, {link.target: str(link.source) for link in found})
            self._record = self._recorded(record)
            moving = {a: s for a, s in self._signals.items() if s.constant is None}
            scheme = Scheme(order, extrapolation, refresh)
            self._wiring = Wiring(self._descriptions, found, moving, self._record, scheme)
            self._start = self._starts(parameters or {}, initial or {})
            self._events = [self._event(time, values) for time, values in events]
        except BaseException:
            self.close()
            raise

    def run(self, duration: float, tell: Tell | None = None) -> Recording:
        """Run from the start for `duration`, s, on new instances; the same again gives the same bits.

        tell(time, speed): called now and then with the simulated time, s, and how many times faster than
        that time passes. Ctrl-C ends the run and keeps what was recorded, and so does an FMU that asks for
        the end; the recording says which.
        Raises FmuError where an FMU refuses a call, with its name, the time and its reason; FmuEnded where
        one ends the process in which it runs. What was recorded until then is their `so_far`.
        """
        plan = self._clock.plan(duration, self._events)
        for s in self._signals.values():
            s.check_span(duration)
        names = [str(a) for a in self._record]
        units = [self._descriptions[a.fmu].variables[a.variable].unit for a in self._record]
        room = next((s.room for s in self._sources.values() if isinstance(s, Archive) and s.room), None)
        cells = None if room is None else SharedCells.of((1 + len(names)) * sum(plan.recorded))
        recorder = Recorder(names, units, cells)
        try:
            if room is None or cells is None:
                stop = self._march(plan, recorder, tell)
            else:
                stop = run_elsewhere(
                    room, marched, self._sources, self._options, duration, recorder, cells, tell
                )
        except (FmuError, FmuEnded) as error:
            error.so_far = recorder.recording(Stop(recorder.last))
            raise
        return recorder.recording(stop)

    def run_into(self, cells: SharedCells, duration: float, tell: Tell | None) -> Stop | None:
        """Run as `run` does, in this process, with the rows into cells."""
        return self._march(self._clock.plan(duration, self._events), Recorder(self._record, (), cells), tell)

    def _march(self, plan: Plan, recorder: Recorder, tell: Tell | None) -> Stop | None:
        with ExitStack() as stack:
            fmus = {
                name: source if isinstance(source, Fmu) else stack.enter_context(Fmu(source))
                for name, source in self._sources.items()
            }
            march = March(self._wiring.crew(fmus), plan, recorder)
            stack.callback(march.free)
            with stopped_by_ctrl_c(march):
                march.initialise(self._start)
                march.run(tell)
        return march.stop

    def close(self) -> None:
        """Delete unpacked files; Fmus and Archives that were given stay open."""
        self._own.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _inputs(self, given: Mapping[str, Source], connected: Mapping[Address, str]) -> dict[Address, Signal]:
        found = {}
        for name, source in given.items():
            address = self._directory.settable(name, f"input '{name}'", "input")
            if address in connected:
                raise BadInput(
                    f"input '{name}': is connected to '{connected[address]}' too; keep one of them"
                )
            whole = self._descriptions[address.fmu].variables[address.variable].whole
            found[address] = signal(name, source, whole)
        return found

    def _recorded(self, names: Sequence[str] | None) -> list[Address]:
        if names is None:
            return [Address(fmu, v) for fmu, d in self._descriptions.items() for v in d.outputs]
        return [self._directory.find(name, "record")[0] for name in dict.fromkeys(names)]

    def _starts(
        self, parameters: Mapping[str, float], initial: Mapping[str, float]
    ) -> dict[str, dict[str, float]]:
        """Values set before initialisation, by FMU."""
        start: dict[str, dict[str, float]] = {name: {} for name in self._sources}
        for name, value in parameters.items():
            address = self._directory.settable(name, f"parameter '{name}'", "parameter")
            start[address.fmu][address.variable] = self._number(address, value, f"parameter '{name}'")
        for name, value in initial.items():
            address, variable = self._directory.find(name, f"initial '{name}'")
            if variable.initial not in ("exact", "approx") or variable.causality not in ("output", "local"):
                states = ", ".join(self._descriptions[address.fmu].states) or "none"
                raise BadInput(f"initial '{name}': is no state; those of '{address.fmu}' are {states}")
            start[address.fmu][address.variable] = self._number(address, value, f"initial '{name}'")
        for address, s in self._signals.items():
            if s.constant is not None:
                start[address.fmu][address.variable] = self._number(address, s.constant, f"input '{address}'")
        return start

    def _event(self, time: float, values: Mapping[str, float]) -> Event:
        where = f"event at t = {time:g} s"
        if not (isfinite(time) and time >= 0):
            raise BadInput(f"{where}: the run begins at 0; give a time from there on")
        found = {}
        for name, value in values.items():
            address = self._directory.settable(name, where, "parameter")
            kind = self._descriptions[address.fmu].variables[address.variable].variability
            if kind != "tunable":
                raise BadInput(
                    f"{where}: '{name}' is a {kind} parameter, not a tunable one; give it in 'parameters'"
                )
            found[address] = self._number(address, value, f"{where}: '{name}'")
        return float(time), found

    def _number(self, address: Address, value: float, where: str) -> float:
        """A value that the FMU's own limits allow."""
        if isinstance(value, bool) or not isinstance(value, Real) or not isfinite(value):
            raise BadInput(f"{where}: {value!r} is no finite number; give one")
        v = self._descriptions[address.fmu].variables[address.variable]
        if v.whole and value != round(value):
            raise BadInput(f"{where}: {value:g} is no whole number, and the variable is of type {v.type}")
        low, high = -inf if v.min is None else v.min, inf if v.max is None else v.max
        if not low <= value <= high:
            raise BadInput(
                f"{where}: {value:g} is outside {low:g} to {high:g}, the limits that the FMU states"
            )
        return float(value)


def marched(
    fmus: Mapping[str, Archive], options: Mapping[str, Any], duration: float, cells: str, tell: Tell | None
) -> Stop | None:
    """A Master's run in the process of the FMUs: its rows into the cells of that name."""
    with Master(fmus, **options) as master:
        return master.run_into(SharedCells.named(cells), duration, tell)


def _opened(fmus: Mapping[str, str | Path | Archive | Fmu], own: ExitStack) -> dict[str, Archive | Fmu]:
    """Archives or running FMUs by name; a file that occurs several times is unpacked once."""
    if not fmus:
        raise BadInput("no FMU given; name at least one")
    files: dict[Path, Archive] = {}
    found: dict[str, Archive | Fmu] = {}
    for name, given in fmus.items():
        if not name or "." in name:
            raise BadInput(f"FMU name '{name}': names are 'fmu.variable', so it must have letters and no dot")
        if isinstance(given, str | Path):
            path = Path(given).resolve()
            if path not in files:
                files[path] = own.enter_context(Archive(given))
            given = files[path]
        if isinstance(given, Fmu) and not isinstance(given.instance, Instance):
            raise BadInput(
                f"FMU '{name}': is in a process of its own and cannot be coupled from here; give its Archive"
            )
        if given in found.values() and (isinstance(given, Fmu) or given.description.once_per_process):
            raise BadInput(f"FMU '{name}': is in use under another name; give a file that allows two")
        found[name] = given
    return found
