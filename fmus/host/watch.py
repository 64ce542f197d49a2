"""What an FMU is doing, on a page of memory that another process can read while it runs.

Each call is noted before it is made: a store of one number, which takes some 40 ns. Where nobody supervises,
the page belongs to this process alone.
"""

from dataclasses import dataclass
from math import isnan, nan
from typing import Any

import numpy as np

from fmus.host import shared

SIZE = 1 << 13  # bytes of the page
CELLS, REALS, CALL, NAMES, LINES = 0, 128, 256, 384, 4480  # bytes at which its parts begin
WHAT, STOP, LINE, TOLD = 0, 1, 2, 4  # whole numbers: what is done, whether to stop, lines heard, of a loop
PARTS = 6  # of TOLD: four answers of a step by FMI 3.0, the number of steps, the part of a step
LONGEST_CALL, LONGEST_NAME, NAMED = 128, 64, 64
LONGEST_LINE, HEARD = 400, 8
SETTING, STEPPING, GETTING, LOOPING, CALLING = 1, 2, 3, 4, 5  # what is done with an FMU
KINDS = 8
WORDS = {SETTING: "SetReal", STEPPING: "DoStep", GETTING: "GetReal"}


@dataclass(frozen=True)
class Doing:
    """The FMU in whose call a process is, the call, and the FMU's time, s, where the call has one."""

    fmu: str
    call: str
    time: float | None

    def __str__(self) -> str:
        at = "" if self.time is None else f" at t = {self.time:.9g} s"
        return f"{self.fmu}: {self.call}{at}"


class Page:
    """A page of memory; `cells[WHAT]` and `time[0]` are written by loops directly."""

    def __init__(self, memory: Any = None) -> None:
        self._known: dict[str, int] = {}
        self.move(bytearray(SIZE) if memory is None else memory)

    def move(self, memory: Any) -> None:
        """Write to other memory from now on; before any FMU is opened."""
        self._memory = memoryview(memory)
        self.cells = self._memory[CELLS:REALS].cast("q")
        self.time = self._memory[REALS : REALS + 8].cast("d")
        self.told = np.frombuffer(memory, np.int64, PARTS, CELLS + 8 * TOLD)
        self.now = np.frombuffer(memory, np.float64, 1, REALS)

    def enrolled(self, name: str, fmi3: bool) -> int:
        """The number of an FMU by its name; times KINDS, plus what is done, it is what a cell holds."""
        said = f"{3 if fmi3 else 2}{name}"
        if said not in self._known:
            number = min(len(self._known) + 1, NAMED - 1)
            self._known[said] = number
            self._write(NAMES + LONGEST_NAME * number, LONGEST_NAME, said)
        return self._known[said] * KINDS

    def calling(self, who: int, call: str, t: float = nan) -> None:
        """A call is made that has a name of its own; t: its time, s, if it has one."""
        self._write(CALL, LONGEST_CALL, call)
        self.time[0] = t
        self.cells[WHAT] = who + CALLING
        self.cells[TOLD + 4] += 1

    def stepping(self, who: int, t: float) -> None:
        """A step is made from t, s."""
        self.time[0] = t
        self.cells[WHAT] = who + STEPPING
        self.cells[TOLD + 4] += 1

    def idle(self) -> None:
        """No FMU is called."""
        self.cells[WHAT], self.time[0] = 0, nan

    def heard(self, line: str) -> None:
        """An FMU logged a line."""
        number = self.cells[LINE]
        self._write(LINES + LONGEST_LINE * (number % HEARD), LONGEST_LINE, line)
        self.cells[LINE] = number + 1

    def lines(self) -> list[str]:
        """The last lines that were logged."""
        number = self.cells[LINE]
        kept = range(max(0, number - HEARD), number)
        return [self._read(LINES + LONGEST_LINE * (i % HEARD), LONGEST_LINE) for i in kept]

    def progress(self) -> bytes:
        """Differs as soon as another call is made."""
        return bytes(self._memory[CELLS : REALS + 8])

    def doing(self) -> Doing | None:
        """What is done; None while no FMU is called."""
        who, kind = divmod(self.cells[WHAT], KINDS)
        if not 0 < who < NAMED or not kind:
            return None
        said = self._read(NAMES + LONGEST_NAME * who, LONGEST_NAME)
        fmi, name, time = said[:1], said[1:], self.time[0]
        if kind == LOOPING:
            kind = int(self.cells[TOLD + 5]) or STEPPING
        if kind == CALLING:
            call = self._read(CALL, LONGEST_CALL)
        else:
            call = f"fmi{fmi}{WORDS.get(kind, 'DoStep')}"
            call = call.replace("Real", "Float64") if fmi == "3" else call
        return Doing(name, call, None if isnan(time) else time)

    def _write(self, at: int, most: int, text: str) -> None:
        data = text.encode("utf-8", "replace")[: most - 1] + b"\0"
        self._memory[at : at + len(data)] = data

    def _read(self, at: int, most: int) -> str:
        return bytes(self._memory[at : at + most]).partition(b"\0")[0].decode("utf-8", "replace")


PAGE = Page(shared.page)
PAGE.idle()
