"""Any FMU as a black box x+ = f(x, u, theta), y = h(x, u, theta), by restart from a state."""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from multiprocessing.util import Finalize
from pathlib import Path

import numpy as np

from estimator.record import Array, Run
from fmus.host.fmu import Fmu


class Plant:
    """An FMU instance with chosen inputs and outputs, by the names in its description."""

    def __init__(self, fmu: Fmu, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        self.fmu, self.inputs, self.outputs = fmu, tuple(inputs), tuple(outputs)
        self.states = tuple(fmu.description.states)

    def simulate(
        self,
        run: Run,
        start: Mapping[str, float],
        more: Sequence[str] = (),
        push: Mapping[str, Array] | None = None,
    ) -> Array:
        """Free run through a record from its first sample: outputs, then `more`, (N, n_y + n_more).

        start: states and parameters by name. Inputs act as samples of continuous signals, see Fmu.simulate.
        push: samples (N,) added to inputs.
        """
        inputs = {name: run.u[:, j] for j, name in enumerate(self.inputs)}
        for name, samples in (push or {}).items():
            inputs[name] = inputs.get(name, 0.0) + samples
        return self.fmu.simulate(run.t, inputs, (*self.outputs, *more), start)

    def transition(
        self, x: Array, u: Mapping[str, float], theta: Mapping[str, float], dt: float
    ) -> tuple[Array, Array]:
        """One restart and step: the next state (n,) and the outputs (n_y,) there."""
        states = dict(zip(self.states, x.tolist(), strict=True))
        self.fmu.restart(0.0, **{**theta, **u, **states})
        self.fmu.step(dt)
        values = np.array(self.fmu.read((*self.states, *self.outputs)))
        return values[: len(x)], values[len(x) :]

    def response(self, x: Array, given: Mapping[str, float], dt: float) -> tuple[Array, Array]:
        """Restart in a state: the state after a step (n,), and the outputs before it (n_y,).

        given: inputs and parameters by name.
        """
        self.fmu.restart(0.0, **{**given, **dict(zip(self.states, x.tolist(), strict=True))})
        y = np.array(self.fmu.read(self.outputs))
        self.fmu.step(dt)
        return np.array(self.fmu.read(self.states)), y


class Plants:
    """Running FMUs of this process, opened when first asked for; the least used ones are closed."""

    def __init__(self, most: int = 24) -> None:
        self.most = most
        self._open: OrderedDict[tuple[Path, tuple[str, ...], tuple[str, ...]], Plant] = OrderedDict()

    def get(self, fmu: Path, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Plant:
        """The plant of an FMU file with these inputs and outputs."""
        key = (fmu, inputs, outputs)
        if key not in self._open:
            if len(self._open) >= self.most:
                self._open.popitem(last=False)[1].fmu.close()
            self._open[key] = Plant(Fmu(fmu), inputs, outputs)
        self._open.move_to_end(key)
        return self._open[key]

    def close(self) -> None:
        """Close all."""
        while self._open:
            self._open.popitem()[1].fmu.close()


PLANTS = Plants()
Finalize(None, PLANTS.close, exitpriority=10)  # before the folders of their FMUs are deleted
