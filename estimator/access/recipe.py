"""What is done to an instance so that it makes a step from a given state: the ways that a probe tries."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from estimator.record import Array


class Way(IntEnum):
    """How a state gets into an instance, the plainest first."""

    SET = 0  # while it runs: what many FMUs allow though the standard does not ask for it
    RESUME = 1  # back to its state saved during initialisation, set, end of initialisation
    RESTART = 2  # reset, set, initialisation: what every FMU must allow
    EXCHANGE = 3  # model exchange, integrated here: where co-simulation shows no way

    @property
    def words(self) -> str:
        """The way in a sentence's middle."""
        return _WORDS[self]


_WORDS = {
    Way.SET: "setting its states while it runs",
    Way.RESUME: "going back to a state saved during initialisation and setting its start values",
    Way.RESTART: "reset and initialisation from start values",
    Way.EXCHANGE: "model exchange, integrated by Runge-Kutta steps",
}


@dataclass(frozen=True)
class Recipe:
    """A way with what is set and read in it, by value references.

    The columns of values are those of `set_refs`; constants are set beside them where a way loses them.
    """

    way: Way
    set_refs: NDArray[np.uint32]
    get_refs: NDArray[np.uint32]
    constant_refs: NDArray[np.uint32]
    constants: Array
    t0: float = 0.0  # s, where the saved states and every restart begin unless time matters
