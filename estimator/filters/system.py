"""An FMU as the system of a filter, whose x holds chosen states, parameters and unknown inputs."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from scipy.linalg import block_diag

from estimator.access.copies import Copies, Refused
from estimator.access.exchange import Exchange, continuous_states
from estimator.access.probe import Access, by_exchange, probe
from estimator.access.recipe import Way
from estimator.filters.bounds import Transform
from estimator.filters.estimator import Diverged, Estimate
from estimator.filters.layout import collect, layout
from estimator.filters.sensor_noise import SensorNoise
from estimator.filters.unknown_input import NoisyInput, UnknownInput
from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from fmus.host.archive import Archive

KEPT = 256  # number of step lengths for which transition and noise are cached


@dataclass(frozen=True)
class UnknownParameter:
    """A parameter to estimate, with its prior and its random walk.

    start, std: prior mean and standard deviation, in its unit; walk: standard deviation of its change in one
    second, in its unit.
    """

    name: str
    start: float
    std: float
    transform: Transform
    walk: float = 0.0

    @property
    def z(self) -> float:
        """The filter's coordinate of the prior mean."""
        return self.transform.z(self.start)

    def in_z(self, std: float) -> float:
        """A deviation of the parameter about the prior mean, converted to the filter's coordinate."""
        return self.transform.deviation(self.z, std)


@dataclass(frozen=True)
class UnknownState:
    """A state to estimate; start, std: prior of its start value; noise: process noise, unit/sqrt(s)."""

    name: str
    start: float
    std: float
    noise: float = 0.0


class Joint:
    """A System (see estimator.filters.estimator) that simulates an FMU.

    x = states, coordinates of the parameters (`transform`), states of the unknown inputs, errors of known
    inputs, noise of sensors that is correlated in time; y = outputs with this noise. The other states of the
    FMU are not estimated; they follow the mean. Close the object after use.
    way: an access to use instead of the one that the probe chooses; compiled: False avoids numba;
    sensor_noise: of outputs, correlated in time; input_noise: of known inputs, white.
    """

    def __init__(
        self,
        fmu: str | Path | Archive,
        outputs: Sequence[str],
        states: Sequence[UnknownState],
        parameters: Sequence[UnknownParameter] = (),
        unknown: Sequence[UnknownInput] = (),
        inputs: Sequence[str] = (),
        constants: Mapping[str, float] | None = None,
        dt: float = 1e-3,
        t0: float = 0.0,
        way: Way | None = None,
        compiled: bool = True,
        sensor_noise: Sequence[SensorNoise] = (),
        input_noise: Sequence[NoisyInput] = (),
    ) -> None:
        self._stack = ExitStack()
        self._steps: dict[float, Array] = {}
        self._parts: dict[tuple[float, int], Array] = {}
        self.archive = fmu if isinstance(fmu, Archive) else self._stack.enter_context(Archive(fmu))
        self.outputs, self.inputs = tuple(outputs), tuple(inputs)
        self.states, self.parameters, self.unknown = tuple(states), tuple(parameters), tuple(unknown)
        self.sensor_noise, self.input_noise = tuple(sensor_noise), tuple(input_noise)
        fed = [n for w in unknown for n in w.feeds]
        mine = [s.name for s in states]
        self.names = (*mine, *(p.name for p in parameters), *(n for w in self._shaped for n in w.states))
        known = self.archive.description.states or continuous_states(self.archive)
        self.others = tuple(n for n in known if n not in mine)
        self._constants = dict(constants or {})
        put = [*mine, *self.others, *(p.name for p in parameters), *inputs, *fed]
        get = [*mine, *self.others, *(n for n in outputs if n not in (*mine, *self.others))]
        self._check(put, get)
        self._places(get)
        try:
            self._open(put, get, dt, t0, way, compiled)
        except BaseException:
            self._stack.close()
            raise

    def start(self, t: float = 0.0) -> Estimate:
        """The prior estimate before the first sample at t."""
        x = [*(s.start for s in self.states), *(p.z for p in self.parameters)]
        variance = [*(s.std**2 for s in self.states), *(p.in_z(p.std) ** 2 for p in self.parameters)]
        for w in self._shaped:
            x += [0.0] * len(w.states)
            variance += w.variance.tolist()
        return Estimate(t, np.array(x), np.diag(variance), carried=self._first_carried)

    def set_noise(self, noise: Sequence[float], sensor_noise: Sequence[SensorNoise] | None = None) -> None:
        """Drive the states by this process noise, unit/sqrt(s), in their order, in place of what they had.

        sensor_noise: of the same outputs as before; None leaves it as it is.
        """
        self.states = tuple(replace(s, noise=x) for s, x in zip(self.states, noise, strict=True))
        self.sensor_noise = self.sensor_noise if sensor_noise is None else tuple(sensor_noise)
        self._steps.clear()
        self._parts.clear()

    def set_walks(self, parameters: Sequence[UnknownParameter]) -> None:
        """Let the parameters wander as these do, which are the same in all else."""
        walks = {p.name: p.walk for p in parameters}
        self.parameters = tuple(replace(p, walk=walks[p.name]) for p in self.parameters)
        self._steps.clear()

    @property
    def _shaped(self) -> tuple[UnknownInput | NoisyInput | SensorNoise, ...]:
        """The random processes whose states follow those of the FMU and the parameters in x."""
        return (*self.unknown, *self.input_noise, *self.sensor_noise)

    @property
    def noises(self) -> dict[str, str]:
        """Names of the last states of x, which are noise, and the input or output that each belongs to."""
        return {n: w.name for w in self.input_noise for n in w.states} | {
            n: w.output for w in self.sensor_noise for n in w.states
        }

    def noise(self, dt: float) -> Array:
        """Process noise covariance (n, n) of a step of dt [s]."""
        if dt not in self._steps:
            if len(self._steps) >= KEPT:
                self._steps.clear()
            walks = np.array([*(s.noise for s in self.states), *(p.in_z(p.walk) for p in self.parameters)])
            Q = block_diag(np.diag(walks**2 * dt), *(w.discrete(dt)[1] for w in self._shaped))
            self._steps[dt] = np.ascontiguousarray(Q, dtype=float)
        return self._steps[dt]

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """See System. Unknown inputs act with the mean of both ends of a step, like known ones."""
        parts = np.atleast_2d(u)
        part = dt / len(parts)
        for i, (held, F) in enumerate(zip(parts, self.transitions(part, len(parts)), strict=True)):
            values, after = self.layout.rows(X, held, carried, F)
            found = self._asked(self.copies.advance, values, t + i * part, part)
            X, carried = after, np.empty(len(carried))
            collect(found, len(self.states), X, carried)
        return X, carried

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """See System; the FMU is evaluated only if an output is not a state."""
        if self.direct is not None:
            seen = X[:, self.direct]
        else:
            seen = self._asked(self.copies.evaluate, self.rows(X, u, carried), t)[:, self.seen]
        return seen + X[:, -len(self.adds) :] @ self.adds if len(self.adds) else seen

    def rows(self, X: Array, u: Array, carried: Array) -> Array:
        """Values to set in the FMU for each row (k, n) of X, with the present unknown inputs, (k, n_put)."""
        return self.layout.rows(X, u, carried, self.still)[0]

    def transitions(self, part: float, parts: int) -> Array:
        """Transition matrices (parts, n_w, n_w) of the random processes over the parts of a step; part: s."""
        if (part, parts) not in self._parts:
            if len(self._parts) >= KEPT:
                self._parts.clear()
            F = np.zeros((parts, *self.still.shape))
            at = 0
            for w in self._shaped:
                own = slice(at, at + len(w.states))
                F[:, own, own] = w.within(parts) if isinstance(w, NoisyInput) else w.discrete(part)[0]
                at = own.stop
            self._parts[part, parts] = F
        return self._parts[part, parts]

    def settled(self, x: Array) -> Array:
        """See System; clips parameters whose bounds are kept by clipping."""
        if self.clipped:
            x = x.copy()
            for i, transform in self.clipped:
                x[i] = transform.settled(x[i])
        return x

    def values(self, x: Array, std: Array) -> tuple[Array, Array]:
        """x (N, n) and its standard deviations (N, n), converted to the FMU's units."""
        x, std = x.copy(), std.copy()
        for i, p in enumerate(self.parameters, len(self.states)):
            std[:, i] = p.transform.spread(x[:, i], std[:, i])
            x[:, i] = p.transform.theta(x[:, i])
        return x, std

    def responses(self, x: Array, u: Array, t: float, dt: float, change: Mapping[str, float]) -> Array:
        """Changes (k, m) of the outputs after a step of dt from x (n,) if each of k inputs is changed.

        u: (n_u,) inputs that act over the step; change: by how much an input is changed, by its name.
        """
        row = self.rows(x[None], u, self._first_carried)[0]
        values = np.tile(row, (1 + len(change), 1))
        first = len(self.states) + len(self.others) + len(self.parameters)
        for k, (name, by) in enumerate(change.items(), 1):
            values[k, first + self.inputs.index(name)] += by
        after = self._asked(self.copies.advance, values, t, dt)[:, self.seen]
        found: Array = after[1:] - after[0]
        return found

    def exchange(self) -> Exchange:
        """A new instance by model exchange, which the caller must close; raises BadInput if there is none."""
        told = self._put, self._get, self._fixed
        access = self.access
        if access.way is not Way.EXCHANGE:
            access = self.archive.called(by_exchange, *told, self._first, self._t0, self._dt)
        return self.archive.made(Exchange, *told, self._t0, access.parts)

    def owns(self, close: Callable[[], None]) -> None:
        """Register a function to call when this object is closed."""
        self._stack.callback(close)

    def close(self) -> None:
        """Free the copies, and the unpacked FMU if this object unpacked it."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _places(self, get: list[str]) -> None:
        """Set up the positions of unknowns in x, in the rows set in the FMU and in the rows read from it."""
        n, transforms = len(self.states), [p.transform for p in self.parameters]
        self.layout = layout(n, len(self.others), transforms, self.inputs, self.unknown, self.input_noise)
        self.clipped = [(i, t) for i, t in enumerate(transforms, n) if t.kind == "clip"]
        self.still = np.eye(len(self.names) - n - len(transforms))
        self.seen = [get.index(name) for name in self.outputs]
        self.adds = np.array([[float(n.output == o) for o in self.outputs] for n in self.sensor_noise])
        self.direct: slice | list[int] | None = None
        if all(i < n for i in self.seen):
            row = self.seen == list(range(len(self.seen)))
            self.direct = slice(0, len(self.seen)) if row else self.seen

    def _open(
        self, put: list[str], get: list[str], dt: float, t0: float, way: Way | None, compiled: bool
    ) -> None:
        variables = self.archive.description.variables
        first = {n: variables[n].start or 0.0 for n in put} | {
            n: v for n, v in self._constants.items() if n in put
        }
        first |= {s.name: s.start for s in self.states} | {p.name: p.start for p in self.parameters}
        self._first_carried = np.array([first[n] for n in self.others])
        constants = self._fixed = {n: v for n, v in self._constants.items() if n not in put}
        self._t0, self._dt, self._first = t0, dt, first
        self.access: Access = self.archive.called(probe, put, get, constants, first, t0, dt, compiled)
        late = sorted(self.access.late & set(self.outputs) - {s.name for s in self.states})
        if late:
            way_out = (
                "leave it out of [outputs] or measure a state" if self.states
                else "the FMU declares no states, so name them: [estimate] states = [...]"
            )  # fmt: skip
            raise BadInput(
                f"{self.archive.path}: output '{late[0]}' is computed in steps only, not from the states, "
                f"and a short step does not show it; {way_out}"
            )
        if way is Way.EXCHANGE:
            self.access = self.archive.called(by_exchange, put, get, constants, first, t0, dt)
        chosen = self.access.way if way is None else way
        self._put, self._get = tuple(put), tuple(get)
        self.copies: Copies | Exchange
        if chosen is Way.EXCHANGE:
            self.copies = self.exchange()
            self._stack.callback(self.copies.close)
            return
        free = self.access.free_time if chosen is self.access.way else False
        self.copies = self.archive.made(
            Copies, chosen, put, get, constants, t0, free, compiled, self.access.look
        )  # fmt: skip
        self._stack.callback(self.copies.close)

    def _check(self, put: list[str], get: list[str]) -> None:
        d = self.archive.description
        for name in (*put, *get, *self._constants):
            if name not in d.variables:
                raise BadInput(f"{d.name}: has no variable '{name}'; {did_you_mean(name, d.variables)}")
        twice = sorted({n for n in put if put.count(n) > 1})
        if twice:
            raise BadInput(
                f"{d.name}: '{twice[0]}' is named twice among states, parameters and inputs; name it once"
            )

    @staticmethod
    def _asked(call: Callable[..., Array], *arguments: Any) -> Array:
        try:
            return call(*arguments)
        except Refused as error:
            raise Diverged(str(error)) from error
