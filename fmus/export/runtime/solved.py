"""A slave that solves a model's equations: compiled CasADi functions on the array of its values."""

from __future__ import annotations

from array import array
from itertools import accumulate, pairwise
from typing import Any

import casadi as cs
from pythonfmu.enums import Fmi2Status

from . import common
from .stepping import Stepper

STEP, OUTPUTS = (
    cs.Function.deserialize((common.HERE / f"{name}.casadi").read_text()) for name in ("step", "outputs")
)


Engine = tuple["array[float]", Stepper, Any, Any]  # values, their step, the call for the outputs, its buffer
IDLE: list[Engine] = []  # whose slave is gone, for reuse: PythonFMU makes a new slave at every reset


def engine() -> Engine:
    """An array of all values, and the functions that work on its memory and hold no value of their own."""
    values = common.START[:]
    memory = memoryview(values)
    x, u, p, y = (memory[a:b] for a, b in pairwise(accumulate(common.SIZES, initial=0)))
    buffer: Any  # its type stubs ask for a size that a memoryview has
    buffer, compute = OUTPUTS.buffer()
    for i, part in enumerate((x, u, p)):
        buffer.set_arg(i, part)
    buffer.set_res(0, y)
    return values, Stepper(STEP, x, u, p, common.MODEL["step_size"]), compute, buffer


class Slave(common.Slave):
    """One instance of a model."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.values, self.stepper, self.compute, self.buffer = IDLE.pop() if IDLE else engine()
        self.values[:] = common.START

    def __del__(self) -> None:
        if hasattr(self, "buffer"):
            IDLE.append((self.values, self.stepper, self.compute, self.buffer))

    def refresh(self) -> None:
        """Compute the outputs from states, inputs and parameters."""
        self.compute()

    def advance(self, current_time: float, step_size: float) -> bool:
        """Internal steps as the method asks for, none longer than the model's."""
        if self.stepper.advance(step_size):
            return True
        self.log(f"no step is short enough after t = {current_time:g} s", Fmi2Status.discard)
        return False
