"""A slave that carries another FMU and laws at its ports: force from motion, step by step."""

from __future__ import annotations

import math
import shutil
import sys
import tempfile
from array import array
from collections.abc import Sequence
from multiprocessing.util import Finalize
from typing import Any

import casadi as cs
import fmpy
from pythonfmu.enums import Fmi2Status

from . import carried, common

LAWS = cs.Function.deserialize((common.HERE / "laws.casadi").read_text())
BASE: dict[str, Any] = common.MODEL["base"]
REFERENCES: list[int] = BASE["references"]  # of the carried FMU, in the order of this one's variables
TIME_TOLERANCE = 1e-9  # of a coupling step, so that a whole number of them is seen as one
N_STATES, N_INPUTS, _, N_OUTPUTS = common.SIZES
INPUTS = range(N_STATES, N_STATES + N_INPUTS)
OUTPUTS = range(common.SETTABLE, common.SETTABLE + N_OUTPUTS)
OWN = range(common.SETTABLE - BASE["laws"], common.SETTABLE)  # parameters of the laws
# unpacked once for the process: the folder this package came from may be gone at the next load
FOLDER = tempfile.mkdtemp(prefix="railfmi_base_")
Finalize(None, shutil.rmtree, (FOLDER, True), exitpriority=0)  # worker processes skip atexit
fmpy.extract(str(common.HERE / "base.fmu"), FOLDER)
IDLE: list[carried.Carried] = []  # carried instances whose slave is gone, for reuse


class Slave(common.Slave):
    """One instance of the carried FMU with its laws."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.touched = set(BASE["restarted"])  # settable variables whose value the carried FMU must be told
        self.base, self.running = _instance(), False
        self.start_time = 0.0
        self.motion, self.force = (array("d", bytes(8 * n)) for n in (LAWS.numel_in(0), LAWS.numel_out(0)))
        buffer: Any  # its type stubs ask for a size that a memoryview has
        buffer, self.law = LAWS.buffer()
        own = memoryview(self.values)[OWN.start : OWN.stop]
        for i, part in enumerate((memoryview(self.motion), own)):
            buffer.set_arg(i, part)
        buffer.set_res(0, memoryview(self.force))
        self.buffer = buffer
        ports = BASE["ports"]
        self.given = [port["force"] for port in ports]
        motion = [i for port in ports for i in (port["displacement"], port["velocity"])]
        self.read = self.base.getter(_references(motion), self.motion)
        self.push = self.base.setter(_references(self.given), self.force)
        parts = (range(N_STATES), OUTPUTS)
        self.look = [self.base.getter(_references(part), self.values, part.start) for part in parts]

    def __del__(self) -> None:
        if hasattr(self, "base"):
            IDLE.append(self.base)

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Remember the start time."""
        self.start_time = start_time

    @common.caught
    def enter_initialization_mode(self) -> None:
        """Initialise the carried FMU from what was set."""
        self.base.reset()
        self._pass_on(self.touched - set(OWN))
        self.base.enter(self.start_time)

    @common.caught
    def exit_initialization_mode(self) -> None:
        """The carried FMU may step."""
        self._pass_on(set(INPUTS))
        self.base.leave()
        self.running = True

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Keep values, and pass them on where the carried FMU runs."""
        super().set_real(vrs, values)
        self.touched.update(vrs)
        if self.running and not self.failure:
            self._changed(set(vrs) - set(OWN))

    @common.caught
    def _changed(self, indices: set[int]) -> None:
        self._pass_on(indices)

    def refresh(self) -> None:
        """Read states and outputs of the carried FMU."""
        if self.running:
            for look in self.look:
                look()

    def advance(self, current_time: float, step_size: float) -> bool:
        """Equal coupling steps: motion at the ports, force of the laws held over the step, step."""
        steps = max(1, math.ceil(step_size / common.MODEL["step_size"] - TIME_TOLERANCE))
        dt, force = step_size / steps, self.force
        given = [self.values[i] for i in self.given]
        for k in range(steps):
            self.read()
            self.law()
            for i, own in enumerate(given):
                force[i] += own
            self.push()
            self.base.step(current_time + k * dt, dt)
        self.refresh()
        self.stale = False
        if all(map(math.isfinite, self.values)):
            return True
        self.log(f"the carried FMU is no longer finite after t = {current_time:g} s", Fmi2Status.discard)
        return False

    def _pass_on(self, indices: set[int]) -> None:
        order = sorted(indices)
        if order:
            self.base.set(_references(order), [self.values[i] for i in order])


def _references(indices: Sequence[int]) -> list[int]:
    return [REFERENCES[i] for i in indices]


def _instance() -> carried.Carried:
    if IDLE:
        return IDLE.pop()
    path = sys.path.copy()
    base = carried.CARRIED[BASE["fmi"]](
        guid=BASE["guid"], modelIdentifier=BASE["identifier"], unzipDirectory=FOLDER, instanceName="base"
    )
    sys.path[:] = path  # an FMU in Python puts its own folder in front
    return base
