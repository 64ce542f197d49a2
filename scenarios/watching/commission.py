"""The filter of a stream as the experiment's own record sets it up, by which the machine is commissioned."""

from dataclasses import dataclass, replace

import numpy as np

from estimator.filters import filters
from estimator.filters.bounds import Transform
from estimator.filters.carried import Carried, begun_again
from estimator.filters.estimator import Estimate
from estimator.filters.history import Steps
from estimator.filters.sensor_noise import SensorNoise, correlated
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.unknown_input import NoisyInput, Shaped, UnknownInput, Wandering
from estimator.monitoring.directions import FORCE, GAIN, PARAMETER, Effect, Tried
from estimator.record import Array, Record, Run
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.description import FmuDescription
from scenarios.estimating.findings import Tell, prepared
from scenarios.estimating.likelihood import request
from scenarios.estimating.setup import Setup, set_up
from scenarios.estimating.unknowns import states_of, usual
from scenarios.experiment.experiment import Experiment


@dataclass(frozen=True)
class Commissioned:
    """The numbers that a filter is made of; a codec can write them, so that a restart makes the same one.

    states: with their process noise; usual: s between the samples that are used, one in `every`; parts: in
    which inputs act over a step; u: (n_u,) inputs of a first sample; sensors: noise of each output.
    """

    states: tuple[UnknownState, ...]
    parameters: tuple[UnknownParameter, ...]
    unknown: tuple[UnknownInput, ...]
    constants: dict[str, float]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sensors: tuple[SensorNoise, ...]
    u: Array
    t0: float
    usual: float
    every: int
    parts: int
    input_noise: tuple[NoisyInput, ...]

    @property
    def noise(self) -> Array:
        """Standard deviations of the outputs' noise (m,)."""
        return np.array([n.std for n in self.sensors])


KEPT = (Commissioned, UnknownState, UnknownParameter, Transform, Shaped, Wandering, SensorNoise, NoisyInput)


def commissioned(e: Experiment, archive: Archive, record: Record, tell: Tell) -> Commissioned:
    """What `estimate` would set up for the record of the experiment; raises BadInput where it cannot."""
    if e.estimate is None:
        raise BadInput(f"{e.file}: has no [estimate]; list there the parameters, states or inputs to find")
    options = e.estimate.options
    if options.smooth:
        raise BadInput(f"{e.file}: [estimate.options] smooth needs a whole record; leave it out for a stream")
    if e.estimate.delay:
        raise BadInput(f"{e.file}: [estimate.delay] needs a whole record; leave it out for a stream")
    setup = set_up(e, options, record, archive)
    if len(setup.choices) > 1:
        names = ", ".join(setup.choices[0])
        raise BadInput(
            f"{e.file}: the form of the model leaves {names} open, and a stream has one filter; give "
            "values in [parameters], or form = false in [estimate.options]"
        )
    setup, share = prepared(setup.chosen(setup.choices[0]), archive, tell)
    return _numbers(setup, share or 0.0, record)


def _numbers(s: Setup, share: float, record: Record) -> Commissioned:
    given = s.options.process_std
    states = tuple(
        replace(state, noise=given.get(state.name, share * scale))
        for state, scale in zip(s.states, s.scale.tolist(), strict=True)
    )
    every = max(1, round(s.samples.step / record.runs[0].sample))
    return Commissioned(
        states, s.parameters, s.unknown, s.constants, s.inputs, s.outputs, s.sensors, s.samples.u[0],
        float(s.samples.t[0]), s.samples.step, every, s.samples.held.shape[1],
        s.input_noise,
    )  # fmt: skip


class Making:
    """Makes the filter of a stream, its start values, and the effects that innovations are compared with."""

    def __init__(self, e: Experiment, c: Commissioned, archive: Archive) -> None:
        self._e, self._c, self._archive = e, c, archive
        self.joint = self._joint(c.inputs)
        self._description = archive.description

    def _joint(self, inputs: tuple[str, ...]) -> Joint:
        c = self._c
        return Joint(
            self._archive, c.outputs, c.states, c.parameters, c.unknown, inputs, c.constants,
            dt=c.usual, t0=c.t0, sensor_noise=correlated(c.sensors),
            input_noise=c.input_noise,
        )  # fmt: skip

    def carried(self) -> Carried:
        """The filter, which has not begun."""
        options = self._e.estimate.options if self._e.estimate else None
        if options is None:
            raise ValueError("a filter needs the options of an experiment")
        asked, kind = request(options, self._c.sensors, self._c.usual, self._c.u), filters()[options.filter]
        if not kind.moments:
            raise BadInput(
                f"{self._e.file}: [estimate.options] filter = '{options.filter}' knows more than mean and "
                "covariance, which a gap in a stream does not keep; choose 'ukf' or 'ekf'"
            )

        def begin(start: Estimate) -> Steps:
            return kind.of(self.joint, start, asked)

        return Carried(begin, self._c.usual, self._c.every, self._c.parts)

    def start(self, t: float, u: Array, y: Array, now: Estimate | None) -> Estimate:
        """The estimate before a first sample at t; now: the last one before a gap, whose parameters are kept.

        u: (1, n_u), y: (1, m) of that sample. Measured states begin at it, with ten times the noise, others
        as the experiment says for its record.
        """
        c, e, run = self._c, self._e, Run(np.array([t]), u, y, *[np.ones(1, np.bool_)] * 3)
        record = Record((run,), c.inputs, c.outputs, c.noise)
        if e.estimate is None:
            raise ValueError("a filter needs the options of an experiment")
        seen = {n for n, v in zip(c.outputs, y[0].tolist(), strict=True) if np.isfinite(v)}
        declared = {n: v for n, v in e.initial.items() if n not in seen}
        of_record = e.model_copy(update={"initial": declared})
        names = tuple(s.name for s in c.states)
        states = [*states_of(of_record, e.estimate.options, self._description, record, c.noise, names)]
        prior = self.joint.start(t)
        x, P = prior.x.copy(), prior.P.copy()
        for i, state in enumerate(states):
            x[i], P[i, i] = state.start, state.std**2
        prior = prior._replace(x=x, P=P)
        if now is None:
            return prior
        n, p = len(c.states), len(c.parameters)
        kept = np.arange(len(x)) >= n
        kept[n + p :] = False
        walk = np.array([*(0.0 for _ in c.states), *(q.in_z(q.walk) ** 2 for q in c.parameters)])
        return begun_again(prior, now, kept, np.append(walk, np.zeros(len(x) - n - p)))

    def directions(self) -> Tried:
        """The effects that innovations are compared with, on an instance of the FMU of their own."""
        c = self._c
        taken = {*c.inputs, *(p.name for p in c.parameters), *(n for w in c.unknown for n in w.feeds)}
        effects = [*_effects(self._e, self._description, c.inputs, taken)]
        more = tuple(f.variable for f in effects if f.what != GAIN)
        joint = self._joint((*c.inputs, *more))
        self.joint.owns(joint.close)
        first = self._description.variables
        constants = np.array([c.constants.get(n, first[n].start or 0.0) for n in more])
        return Tried(joint, effects, constants, c.noise, c.usual)


def _effects(e: Experiment, d: FmuDescription, inputs: tuple[str, ...], taken: set[str]) -> "list[Effect]":
    """Forces at the ports, other values of uncertain parameters, other gains of measured inputs."""
    ports = [p.force for p in e.ports] if e.ports else [n for n in d.inputs if n.endswith("_ext")]
    found = [Effect(FORCE, n, usual(d.variables[n], None)) for n in ports if n not in taken]
    found += [
        Effect(PARAMETER, n, usual(d.variables[n], e.parameters.get(n)))
        for n in e.calibrate
        if n not in taken
    ]
    return found + [Effect(GAIN, n, 1.0) for n in inputs if n in e.input_columns]
