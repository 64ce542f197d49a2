"""One FMU by the names of its variables: restart from any state, step, read, run."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fmus.errors import BadInput
from fmus.host.apart.isolation import Isolation
from fmus.host.archive import Archive
from fmus.host.description import FmuDescription
from fmus.host.fmi2 import Fmi2Instance
from fmus.host.fmi3 import Fmi3Instance
from fmus.host.instance import Instance
from fmus.host.loop import Array
from fmus.host.rows import Inputs, Rows, base_of, joins, offers_rows, rows_at_once
from fmus.host.status import AskedToEnd, CallFailed

if TYPE_CHECKING:
    import pandas as pd


class FmuError(RuntimeError):
    """An FMU refused a call; the sentence says which and what it gave as the reason.

    so_far: the Recording of a run until then.
    """

    so_far: Any = None


class SimulationEnds(FmuError):
    """An FMU asked to end the simulation, and would make no further step."""


class Fmu:
    """An instance of an FMU for co-simulation, or for model exchange alone, which is integrated here.

    Variables are scalars by their names, arrays by their elements (`y[1]`, `A[2,1]`, counted from 1); truths
    are 0 and 1. source: an FMU file, or an Archive that stays open while its instances live.
    isolation: for a file, limits of the process in which it runs; None: it runs in this process.
    BadInput where the file cannot be used, FmuError where the running FMU refuses a call, FmuEnded where it
    ends the process in which it runs.
    """

    def __init__(self, source: str | Path | Archive, isolation: Isolation | None = None) -> None:
        self._own = None if isinstance(source, Archive) else Archive(source, isolation)
        archive = source if isinstance(source, Archive) else self._own
        if archive is None:
            raise BadInput("no FMU given")
        self.description: FmuDescription = archive.description
        self.name = archive.path.name
        self.time = 0.0
        self._sent: tuple[Array, Array] | None = None  # times and inputs that an instance apart has
        try:
            kind = _kind(self.description)
            self._instance: Instance = self._safely(archive.made, kind, self.description.name)
        except BaseException:
            if self._own:
                self._own.close()
            raise

    @property
    def instance(self) -> Instance:
        """The calls behind the names, for loops that make them many times."""
        return self._instance

    def restart(self, t0: float = 0.0, **start: float) -> None:
        """Reset, set states, parameters and inputs, initialise at time t0, s."""
        self._safely(self._instance.initialise, self.references(start), list(start.values()), t0)
        self.time = t0

    def step(self, dt: float, **inputs: float) -> None:
        """Set inputs (or tunable parameters) and advance by dt, s."""
        self.set(**inputs)
        self._safely(self._instance.step, self.time, dt)
        self.time += dt

    def set(self, **values: float) -> None:
        """Set variables by name."""
        self._safely(self._instance.set, self.references(values), list(values.values()))

    def __getitem__(self, name: str) -> float:
        return self.read([name])[0]

    def read(self, names: Sequence[str]) -> list[float]:
        """Values of variables by name."""
        values: list[float] = self._safely(self._instance.get, self.references(names))
        return values

    def simulate(
        self, t: Array, inputs: Mapping[str, Array], outputs: Sequence[str], start: Mapping[str, float],
        every: int = 1,
    ) -> Array:  # fmt: skip
        """Restart at t[0] and run freely through t; outputs (N, n_y), the first row at t[0].

        t: (N,) s, increasing. inputs: (N,) samples each: over a step the mean of both ends acts, which is
        exact to second order for signals sampled from continuous ones, and outputs are read with the
        sample of their time; or (N-1,), the value held over each step. every: of the rows, only each so
        manyth is returned, ((N - 1) // every + 1, n_y).
        """
        first, u = _driving(t, inputs)
        begin = {**start, **first}
        read, driven = self.references(outputs), self.references(inputs)
        times, held = (t, u) if isinstance(self._instance, Instance) else self._news(t, u)
        y: Array = self._safely(
            self._instance.simulate,
            self.references(begin),
            list(begin.values()),
            times,
            held,
            driven,
            read,
            every,
        )
        self.time = float(t[-1])
        return y

    def simulate_frame(
        self,
        t: Array,
        inputs: "Mapping[str, Any] | pd.DataFrame | None" = None,
        outputs: Sequence[str] | None = None,
        start: Mapping[str, float] | None = None,
    ) -> "pd.DataFrame":
        """As `simulate`, as a table with the index `time`, s, and the units in `attrs["units"]`.

        inputs: by name, samples or one number each, by default the FMU's own values. outputs: by default all.
        start: states and parameters that differ from the FMU's own values.
        """
        import pandas as pd  # takes longer to load than a simulation

        t = np.asarray(t, dtype=float)
        given = {} if inputs is None else {str(name): x for name, x in inputs.items()}
        samples = {
            n: np.full(len(t), x) if np.ndim(x) == 0 else np.asarray(x, float) for n, x in given.items()
        }
        for name, x in samples.items():
            if len(x) not in (len(t), len(t) - 1):
                raise BadInput(f"{self.name}: input '{name}' has {len(x)} samples for {len(t)} times")
        names = list(self.description.widened.outputs if outputs is None else outputs)
        y = self.simulate(t, samples, names, start or {})
        table = pd.DataFrame(y, columns=names, index=pd.Index(t, name="time"))
        variables = self.description.widened.variables
        table.attrs["units"] = {n: variables[n].unit for n in names if variables[n].unit is not None}
        return table

    def __repr__(self) -> str:
        about = self.description
        count = (
            f"{len(about.inputs)} inputs, {len(about.outputs)} outputs, {len(about.parameters)} parameters"
        )
        return f"<Fmu {about.name} ({self.name}), FMI {about.fmi_version}: {count}, at {self.time:g} s>"

    def _news(self, t: Array, u: Array) -> tuple[Array | None, Array | None]:
        """Times and inputs to send to another process; None if they are those of the last simulation."""
        if self._sent and all(map(np.array_equal, self._sent, (t, u))):
            return None, None
        self._sent = t.copy(), u.copy()
        return t, u

    @property
    def at_once(self) -> int:
        """How many rows `simulate_rows` advances in the time of little more than one."""
        return rows_at_once(self._instance)

    @property
    def joins(self) -> bool:
        """Whether a step of `simulate_rows` may go over several samples."""
        return joins(self._instance)

    def simulate_rows(
        self,
        t: Array,
        inputs: Mapping[str, Array],
        outputs: Sequence[str],
        starts: Sequence[Mapping[str, float]],
        joined: bool = False,
        every: int = 1,
    ) -> Array | None:
        """As `simulate` for each of k starts with the same names: outputs (k, N, n_y).

        joined: whether a step goes over four samples, see fmus/integrators/joined.py. The times must be
        evenly spaced then, and the inputs samples (N,) of continuous signals. every: a divisor of N - 1; the
        outputs of the first sample and of every so-manyth one after it are returned.
        None if the FMU does not offer it, or refuses a start; simulations one by one say which and why.
        """
        if not offers_rows(self._instance) or (joined and not self.joins):
            return None
        first, u = _driving(t, inputs)
        acting, ends = (_means(u), u[1:]) if len(u) == len(t) else (u, None)
        if joined:
            acting, ends = u, None
        names = [name for name in starts[0] if name not in first]
        put, get, driven = (np.array(self.references(n), dtype=np.uint32) for n in (names, outputs, inputs))
        rows = np.array([[start[name] for name in names] for start in starts], dtype=float)
        found = np.empty((len(starts), (len(t) - 1) // every + 1, len(outputs)))
        call = Rows(self._instance.library, base_of(self.description, first), put, get)
        last = None if ends is None else np.ascontiguousarray(ends)
        held = Inputs(driven, np.ascontiguousarray(acting), last, joined)
        refused = call.run(rows, np.ascontiguousarray(t, dtype=float), found, held, every) >= 0
        return None if refused else found

    def save(self) -> Any:
        """The FMU's state, for `restore` and then `forget`."""
        return self._safely(self._instance.state)

    def restore(self, state: Any) -> None:
        """Go back to a saved state; the caller keeps the time."""
        self._safely(self._instance.restore, state)

    def serialised(self, state: Any) -> bytes:
        """A saved state as bytes."""
        data: bytes = self._safely(self._instance.serialised, state)
        return data

    def deserialised(self, data: bytes) -> Any:
        """A saved state from bytes."""
        return self._safely(self._instance.deserialised, data)

    def forget(self, state: Any) -> None:
        """Free a saved state."""
        self._safely(self._instance.forget, state)

    def references(self, names: Sequence[str] | Mapping[str, Any]) -> list[int]:
        """Value references of names; BadInput with the nearest name where one is not in the FMU."""
        variables = self.description.variables
        if not all(name in variables for name in names):
            variables = self.description.widened.variables
        for name in names:
            if name not in variables:
                raise BadInput(f"{self.name}: {self.description.widened.missing(name)}")
        return [variables[name].reference for name in names]

    def close(self) -> None:
        """Free the instance, and the unpacked file where it is this one's own."""
        self._instance.close()
        if self._own:
            self._own.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _safely(self, call: Any, *args: Any) -> Any:
        try:
            return call(*args)
        except AskedToEnd as error:
            raise SimulationEnds(f"{self.name}: {error}") from error
        except CallFailed as error:
            raise FmuError(f"{self.name}: {error}") from error


def _kind(about: FmuDescription) -> type[Instance]:
    """The class of its instances."""
    fmi3 = about.fmi_version == "3.0"
    if about.exchange is None:
        return Fmi3Instance if fmi3 else Fmi2Instance
    from fmus.host.exchange import Fmi2Exchange, Fmi3Exchange  # loads a solver

    return Fmi3Exchange if fmi3 else Fmi2Exchange


def _means(u: Array) -> Array:
    """Means (N-1, n_u) of the values at both ends of each step; u: (N, n_u)."""
    means: Array = u[1:] + u[:-1]
    means /= 2
    return means


def _driving(t: Array, inputs: Mapping[str, Array]) -> tuple[dict[str, float], Array]:
    """The first values of inputs by name, and all of them, (N, n_u) or (N-1, n_u)."""
    u = np.column_stack([*inputs.values()]) if inputs else np.empty((len(t) - 1, 0))
    return dict(zip(inputs, u[0].tolist(), strict=True)) if inputs else {}, u
