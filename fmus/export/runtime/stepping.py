"""Advance a step function over a communication step, with shorter steps where it asks for them."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any

SHORTEST = 1e-7  # of the step that is tried first; below this a step has failed
TIME_TOLERANCE = 1e-9  # of the communication step
SAFETY, GROWTH, CUT, ORDER = 0.9, 4.0, 0.1, 3


Bind = Callable[
    [Sequence[Any], Sequence[Any]], Callable[[], None]
]  # a call on memory, see Equations.on_memory


class Stepper:
    """Steps of a function step(x, u, p, dt) -> (x1, error) on the memory of its caller.

    Every communication step begins afresh: how the last one was divided is forgotten, so that a
    restart from the same values repeats a run to the last bit.
    """

    def __init__(self, bind: Bind, x: memoryview, u: memoryview, p: memoryview, longest: float) -> None:
        self.x, self.longest = x, longest
        self.x1, self.error, self.h = array("d", bytes(8 * len(x))), array("d", [0.0]), array("d", [0.0])
        self.evaluate = bind((x, u, p, self.h), (self.x1, self.error))

    def advance(self, duration: float) -> bool:
        """Advance x by a duration, s; False, with x as it was, where no step is short enough."""
        before, done = self.x.tolist(), 0.0
        parts = max(1.0, -(-duration * (1 - TIME_TOLERANCE) // self.longest))
        h = duration / parts
        while duration - done > TIME_TOLERANCE * duration:
            h = min(h, self.longest, duration - done)
            self.h[0] = h
            self.evaluate()
            error = self.error[0]
            if error <= 1.0 and all(map(isfinite, self.x1)):  # the error may be blind to NaN
                self.x[:] = self.x1
                done += h
                h *= min(GROWTH, SAFETY * error ** (-1 / ORDER)) if error > 0 else 1.0
            else:
                h *= max(CUT, SAFETY * error ** (-1 / ORDER)) if 1.0 < error < 1e300 else CUT
                if h < SHORTEST * min(duration, self.longest):
                    self.x[:] = array("d", before)
                    return False
        return True
