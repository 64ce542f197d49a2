"""What the process of foreign FMUs may use, and how its end is told."""

from dataclasses import dataclass
from typing import Any

from fmus import limits


@dataclass(frozen=True)
class Isolation:
    """Limits of the process in which FMUs run.

    call: s, that one call of an FMU may take; run: s, that one simulation may take; memory: GB (10^9 bytes).
    """

    call: float = limits.CALL
    run: float = limits.RUN
    memory: float = limits.MEMORY


ISOLATED = Isolation()


class FmuEnded(Exception):
    """An FMU ended the process that ran it, or had to be ended; the sentence says which, where and why.

    Unlike FmuError it is no answer of the FMU: what is being computed cannot go on without it.
    so_far: the Recording of a run until then.
    """

    so_far: Any = None
