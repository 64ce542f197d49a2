"""A slave that solves a model's equations: its functions on the array of its values."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from functools import partial
from itertools import accumulate, pairwise
from typing import Any

from pythonfmu.enums import Fmi2Status

from . import common
from .equations import Equations
from .stepping import Stepper

EQUATIONS = Equations.of(common.HERE)
Engine = tuple["array[float]", Stepper, Callable[[], None]]  # values, their step, the call for the outputs
IDLE: list[Engine] = []  # whose slave is gone, for reuse: PythonFMU makes a new slave at every reset


def engine() -> Engine:
    """An array of all values, and the functions that work on its memory and hold no value of their own."""
    values = common.START[:]
    memory = memoryview(values)
    x, u, p, y = (memory[a:b] for a, b in pairwise(accumulate(common.SIZES, initial=0)))
    step = partial(EQUATIONS.on_memory, "step")
    stepper = Stepper(step, x, u, p, common.MODEL["step_size"])
    return values, stepper, EQUATIONS.on_memory("outputs", (x, u, p), (y,))


class Slave(common.Slave):
    """One instance of a model."""

    note = EQUATIONS.note

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.values, self.stepper, self.compute = IDLE.pop() if IDLE else engine()
        self.values[:] = common.START

    def __del__(self) -> None:
        if hasattr(self, "compute"):
            IDLE.append((self.values, self.stepper, self.compute))

    def needed(self) -> list[list[int]] | None:
        """For each output, the states, inputs and parameters in it."""
        return EQUATIONS.needed("outputs")

    def refresh(self) -> None:
        """Compute the outputs from states, inputs and parameters."""
        self.compute()

    def advance(self, current_time: float, step_size: float) -> bool:
        """Internal steps as the method asks for, none longer than the model's."""
        if self.stepper.advance(step_size):
            return True
        self.log(f"no step is short enough after t = {current_time:g} s", Fmi2Status.discard)
        return False
