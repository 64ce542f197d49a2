"""An FMU for a notebook or a script: its variables by name, its simulations as tables with units."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fmus.host.apart.isolation import Isolation
from fmus.host.description import FmuDescription
from fmus.host.fmu import Fmu as Host
from fmus.host.loop import Array

if TYPE_CHECKING:
    import pandas as pd


class Fmu:
    """An instance of an FMU for co-simulation, or for model exchange alone, which is integrated here.

    source: an FMU file. isolation: limits of a process of its own in which it runs; None: it runs in this
    process. host: the same instance with arrays in place of tables, saved states and derivatives.
    BadInput where the file cannot be used, FmuError where the running FMU refuses a call, FmuEnded where it
    ends the process in which it runs.
    """

    def __init__(self, source: str | Path, isolation: Isolation | None = None) -> None:
        self.host = Host(source, isolation)

    @property
    def description(self) -> FmuDescription:
        """Its variables with units, limits and start values, and what it offers."""
        return self.host.description

    @property
    def time(self) -> float:
        """The time that it has reached, s."""
        return self.host.time

    def simulate(
        self,
        t: Array | Sequence[float],
        inputs: "Mapping[str, Any] | pd.DataFrame | None" = None,
        outputs: Sequence[str] | None = None,
        start: Mapping[str, float] | None = None,
    ) -> "pd.DataFrame":
        """Restart at t[0] and run freely through t: a column for each output, with the index `time`, s.

        t: (N,) s, increasing. inputs: by name, (N,) samples or one number each, by default the FMU's own
        values; over a step the mean of both ends acts. outputs: by default all. start: states and parameters
        that differ from the FMU's own values. Units are in `attrs["units"]` of the table, by column.
        """
        return self.host.simulate_frame(np.asarray(t, dtype=float), inputs, outputs, start)

    def restart(self, t0: float = 0.0, **start: float) -> None:
        """Reset, set states, parameters and inputs, initialise at time t0, s."""
        self.host.restart(t0, **start)

    def step(self, dt: float, **inputs: float) -> None:
        """Set inputs (or tunable parameters) and advance by dt, s."""
        self.host.step(dt, **inputs)

    def set(self, **values: float) -> None:
        """Set variables by name."""
        self.host.set(**values)

    def __getitem__(self, name: str) -> float:
        return self.host[name]

    def read(self, names: Sequence[str]) -> list[float]:
        """Values of variables by name."""
        return self.host.read(names)

    def close(self) -> None:
        """Free the instance, and the unpacked file."""
        self.host.close()

    def __repr__(self) -> str:
        return repr(self.host)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
