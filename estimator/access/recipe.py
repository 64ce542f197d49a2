"""The ways to set the state of an FMU instance before a step, among which a probe chooses."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from estimator.record import Array


class Way(IntEnum):
    """How a state is set in an instance, the simplest way first."""

    SET = 0  # set while the FMU runs, which many FMUs allow although the standard does not require it
    RESUME = 1  # restore a state saved during initialisation, set, end initialisation
    RESTART = 2  # reset, set, initialise, which every FMU must allow
    EXCHANGE = 3  # model exchange with an integrator of railfmi, if no way works in co-simulation

    @property
    def words(self) -> str:
        """The way as a phrase for sentences."""
        return _WORDS[self]


_WORDS = {
    Way.SET: "setting its states while it runs",
    Way.RESUME: "restoring a state saved during initialisation and setting its start values",
    Way.RESTART: "reset and initialisation from start values",
    Way.EXCHANGE: "model exchange, integrated by Runge-Kutta steps",
}


@dataclass(frozen=True)
class Recipe:
    """A way with the variables that are set and read, by value references.

    The columns of values are those of `set_refs`; constants are set too if a way resets them.
    """

    way: Way
    set_refs: NDArray[np.uint32]
    get_refs: NDArray[np.uint32]
    constant_refs: NDArray[np.uint32]
    constants: Array
    t0: float = 0.0  # s, time of the saved states, and of every restart if the equations ignore the time
