"""A slave that carries another FMU and laws around it: its inputs from its motion, step by step."""

from __future__ import annotations

import math
import shutil
import sys
import tempfile
from array import array
from collections.abc import Sequence
from functools import cache
from itertools import count
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, parse

import fmpy
from pythonfmu.enums import Fmi2Status

from . import carried, common
from .equations import Equations

EQUATIONS = Equations.of(common.HERE)
BASE: dict[str, Any] = common.MODEL["base"]
REFERENCES: list[int] = BASE["references"]  # of the carried FMU, in the order of this one's variables
TOLD: list[int] = BASE["told"]  # inputs and parameters that the laws set
TIME_TOLERANCE = 1e-9  # of a coupling step, so that a whole number of them is seen as one
N_STATES, N_INPUTS, _, N_OUTPUTS = common.SIZES
INPUTS = range(N_STATES, N_STATES + N_INPUTS)
OUTPUTS = range(common.SETTABLE, common.SETTABLE + N_OUTPUTS)
MEMORY = slice(N_STATES - BASE["states"], N_STATES)  # states of the laws
PASSED = {i for i in range(common.SETTABLE) if REFERENCES[i] >= 0} - set(TOLD)  # on to the carried FMU
# unpacked once for the process: the folder this package came from may be gone at the next load
FOLDER = tempfile.mkdtemp(prefix="railfmi_base_")
Finalize(None, shutil.rmtree, (FOLDER, True), exitpriority=0)  # worker processes skip atexit
fmpy.extract(str(common.HERE / "base.fmu"), FOLDER)
NUMBERS = count()  # so that no two carried instances share a name
IDLE: list[carried.Carried] = []  # carried instances whose slave is gone, for reuse


class Slave(common.Slave):
    """One instance of the carried FMU with its laws."""

    note = EQUATIONS.note
    computed = 0  # the states too are read from the carried FMU

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.touched = set(BASE["restarted"])  # settable variables whose value the carried FMU must be told
        self.base, self.running = _instance(), False
        self.start_time = 0.0
        sizes = [EQUATIONS.sizes(name) for name in ("push", "go_on")]
        self.earlier, self.before, self.motion = (array("d", bytes(8 * sizes[0][0][0])) for _ in range(3))
        self.told, self.memory = (array("d", bytes(8 * found[0])) for _, found in sizes)
        self.dt, self.last = array("d", [0.0]), 0.0  # s, lengths of this step and of the last one
        self.since = array("d", [math.inf])  # s, from `earlier` to `motion`; endless if there is no `earlier`
        settable = memoryview(self.values)[: common.SETTABLE]
        seen = (self.earlier, self.motion, settable, self.dt, self.since)
        passed = (self.before, self.motion, settable, self.dt)
        self.work_out = EQUATIONS.on_memory("push", seen, (self.told,))
        self.remember = EQUATIONS.on_memory("go_on", passed, (self.memory,))
        self.read = self.base.getter(_references(BASE["motion"]), self.motion)
        self.tell = self.base.setter(_references(TOLD), self.told)
        parts = (range(MEMORY.start), OUTPUTS)
        self.look = [self.base.getter(_references(part), self.values, part.start) for part in parts]

    def __del__(self) -> None:
        if hasattr(self, "base"):
            IDLE.append(self.base)

    def experiment(self) -> dict[str, float]:
        """That of the carried FMU."""
        return carried.experiment(_description())

    def display(self) -> dict[str, dict[str, str]]:
        """Those of the carried FMU, for its variables."""
        own = {common.VARIABLES[i]["name"] for i, reference in enumerate(REFERENCES) if reference >= 0}
        return {name: shown for name, shown in carried.display(_description()).items() if name in own}

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Remember the start time."""
        self.start_time = start_time

    @common.caught
    def enter_initialization_mode(self) -> None:
        """Initialise the carried FMU from what was set."""
        self.base.reset()
        self._pass_on(self.touched)
        self._by_the_laws()
        self.base.enter(self.start_time)

    @common.caught
    def exit_initialization_mode(self) -> None:
        """The carried FMU may step."""
        self._pass_on(set(INPUTS))
        self.read()
        self.since[0] = math.inf
        self._by_the_laws()
        self.base.leave()
        self.running = True

    @common.caught
    def terminate(self) -> None:
        """Terminate the carried FMU."""
        if self.running and not self.failure:
            self.base.terminate()

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Keep values, and pass them on where the carried FMU runs."""
        super().set_real(vrs, values)
        self.touched.update(vrs)
        if self.running and not self.failure:
            self._changed(set(vrs))

    @common.caught
    def _changed(self, indices: set[int]) -> None:
        self._pass_on(indices)
        if not indices <= {*INPUTS}:
            self.since[0] = math.inf  # it moves otherwise than before
        if not indices <= PASSED:
            self.read()
            self._by_the_laws()

    def refresh(self) -> None:
        """Read states and outputs of the carried FMU; those of the laws are there already."""
        if self.running:
            for look in self.look:
                look()

    def advance(self, current_time: float, step_size: float) -> bool:
        """Equal coupling steps: motion at the ports, what the laws set held over the step, step."""
        steps = max(1, math.ceil(step_size / common.MODEL["step_size"] - TIME_TOLERANCE))
        dt = self.dt[0] = step_size / steps
        self.read()
        for k in range(steps):
            if TOLD:
                self.work_out()
                self.tell()
            self.base.step(current_time + k * dt, dt)
            self.before[:] = self.motion
            self._went(dt)
            self.read()
            if self.memory:
                self.remember()
                self.values[MEMORY] = self.memory
        self.refresh()
        self.stale = False
        if all(map(math.isfinite, self.values)):
            return True
        self.log(f"the carried FMU is no longer finite after t = {current_time:g} s", Fmi2Status.discard)
        return False

    def _went(self, dt: float) -> None:
        """Take accelerations over the step from `before` on, of length dt.

        Over the step before too if this one is much shorter: a difference over little time is inaccurate.
        """
        if math.isfinite(self.since[0]) and dt < self.last / 2:
            self.since[0] += dt
        else:
            self.earlier[:] = self.before
            self.since[0] = dt
        self.last = dt

    def _by_the_laws(self) -> None:
        """Set what the laws set, for the instant."""
        self.dt[0] = 0.0
        if TOLD:
            self.work_out()
            self.tell()

    def _pass_on(self, indices: set[int]) -> None:
        order = sorted(indices & PASSED)
        if order:
            self.base.set(_references(order), [self.values[i] for i in order])


@cache
def _description() -> Element:
    """The model description of the carried FMU."""
    return parse(Path(FOLDER) / "modelDescription.xml").getroot()


def _references(indices: Sequence[int]) -> list[int]:
    return [REFERENCES[i] for i in indices]


def _instance() -> carried.Carried:
    if IDLE:
        return IDLE.pop()
    path = sys.path.copy()
    base = carried.CARRIED[BASE["fmi"]](
        guid=BASE["guid"],
        modelIdentifier=BASE["identifier"],
        unzipDirectory=FOLDER,
        instanceName=f"base_{next(NUMBERS)}",
    )
    sys.path[:] = path  # an FMU in Python puts its own folder in front
    return base
