"""Prepare the system of a filter from an experiment: samples, unknowns, noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from estimator.access.copies import Copies
from estimator.access.recipe import Way
from estimator.filters.history import Samples, samples
from estimator.filters.observability import needed
from estimator.filters.process_noise import motion
from estimator.filters.sensor_noise import SensorNoise, correlated
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.unknown_input import NoisyInput, UnknownInput
from estimator.record import Array, Record
from fmus.aside import mean_square, set_aside
from fmus.errors import BadInput, did_you_mean
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError
from fmus.model import declared
from fmus.models import model_class
from scenarios.estimating.delays import undelayed
from scenarios.estimating.form import choices, parameters_of_form
from scenarios.estimating.input_noise import declared_errors, possible_errors
from scenarios.estimating.policy import POLICY
from scenarios.estimating.sensors import Sought, check_noise, noise_of, sought
from scenarios.estimating.unknowns import (
    check_options,
    inputs_of,
    parameters_of,
    states_of,
    usual,
)
from scenarios.experiment.estimated import Alarm, Options
from scenarios.experiment.experiment import Experiment
from scenarios.experiment.sampling import step_of

BAND = 1.959964  # half width of the 95 % band in standard deviations
Bands = Mapping[str, Mapping[str, tuple[float, float]]]


@dataclass(frozen=True)
class Setup:
    """An experiment prepared for a filter.

    scale: (n_states,) motion of each state per sqrt(s), for process noise that is not declared.
    """

    experiment: Experiment
    options: Options
    samples: Samples
    sensors: tuple[SensorNoise, ...]  # noise of each output
    sought: tuple[Sought, ...]  # what of it the record is to say
    constants: dict[str, float]
    states: tuple[UnknownState, ...]
    parameters: tuple[UnknownParameter, ...]
    unknown: tuple[UnknownInput, ...]
    scale: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    free_run: Array  # (N, m) outputs simulated with the start values, nan where it fails
    form: tuple[str, ...] = ()  # parameters that stand for what the model's form leaves open
    choices: tuple[dict[str, float], ...] = ({},)  # of the form, each a set of constants
    bands: Bands = field(default_factory=dict)  # 95 % bands of what was sought, by output
    input_noise: tuple[NoisyInput, ...] = ()  # of the known inputs
    possible: tuple[NoisyInput, ...] = ()  # which the record has to confirm

    @property
    def asked(self) -> list[str]:
        """Names of the unknown parameters without those of the form."""
        return [p.name for p in self.parameters if p.name not in self.form]

    @property
    def noise(self) -> Array:
        """Standard deviation of each output's noise (m,), of its white and its correlated part together."""
        return np.array([n.std for n in self.sensors])

    @property
    def accepted(self) -> Array:
        """Error of the simulation that is accepted in each state (n_states,); 0 if it is not measured."""
        noise = dict(zip(self.outputs, self.noise.tolist(), strict=True))
        return POLICY.told_apart * np.array([noise.get(s.name, 0.0) for s in self.states])

    @property
    def moving(self) -> bool:
        """Whether the share of the states' motion that is noise is to be found, for want of declarations."""
        return any(state.name not in self.options.process_std for state in self.states)

    def sensing(self, sensors: tuple[SensorNoise, ...]) -> "Setup":
        """The same with other noise of the sensors, which leaves the start of a measured state no surer."""
        least = {n.output: POLICY.measured_start * n.std for n in sensors}
        states = tuple(
            s if s.name in self.options.initial_std else replace(s, std=max(s.std, least.get(s.name, 0.0)))
            for s in self.states
        )
        return replace(self, sensors=sensors, states=states)

    def chosen(self, choice: Mapping[str, float]) -> "Setup":
        """The same with one choice of the form."""
        return replace(self, constants={**self.constants, **choice})

    def noise_of(self, part: float) -> list[float]:
        """Process noise of each state, unit/sqrt(s): the declared one, or `part` of its motion."""
        given = self.options.process_std
        return [
            given.get(s.name, part * scale) for s, scale in zip(self.states, self.scale.tolist(), strict=True)
        ]

    def joint(self, archive: Archive, part: float) -> Joint:
        """The system; a state without declared noise is driven by noise of `part` of its motion."""
        noise = self.noise_of(part)
        states = [replace(state, noise=x) for state, x in zip(self.states, noise, strict=True)]
        s = self.samples
        return Joint(
            archive, self.outputs, states, self.parameters, self.unknown, self.inputs, self.constants,
            dt=s.step, t0=float(s.t[0]), sensor_noise=correlated(self.sensors),
            input_noise=self.input_noise,
        )  # fmt: skip


def set_up(e: Experiment, options: Options, record: Record, archive: Archive) -> Setup:
    """All that the filter needs before its first sample; raises BadInput for wrong names or values."""
    d = archive.description
    check_options(e, options, d)
    check_noise(e, options)
    record = undelayed(e, record, d.variable_step)
    run = record.runs[0]
    every = _every(e, options, step_of(run.t))
    s = samples(run.t, run.u, run.y, every)
    if len(s.t) < POLICY.fewest_samples:
        raise BadInput(
            f"{e.file}: [estimate] rate leaves {len(s.t)} samples of the record; use a higher rate"
        )
    _check_measured(e, record, s)
    sensors = noise_of(e, options, record, s.step)
    noise = np.array([n.std for n in sensors])
    constants = {**e.parameters, **e.initial}
    parameters = tuple(parameters_of(e, options, d))
    form = tuple(parameters_of_form(e, options, d, [p.name for p in parameters]))
    unknown = tuple(inputs_of(e, options))
    values = constants | {p.name: p.start for p in (*parameters, *form)}
    names = tuple(e.estimate.states) if e.estimate else ()
    states = names or _needed(archive, values, s, record)
    _check_alarms(e, options, (*states, *(u.name for u in (*parameters, *unknown))))
    options = with_alarms(e, options)
    s, run_of = _fine_enough(archive, values, record, states, noise, every, options.input_parts)
    nominal = np.array([usual(d.variables[n], constants.get(n)) for n in states])
    return Setup(
        e, options, s, sensors, sought(e, options, record, sensors), constants,
        tuple(states_of(e, options, d, record, noise, states)), (*parameters, *form), unknown,
        motion(s.t, run_of[:, len(record.outputs) :], nominal) if states else np.empty(0),
        record.inputs, record.outputs, run_of[:, : len(record.outputs)], tuple(p.name for p in form),
        tuple(choices(e, options)), input_noise=declared_errors(record, every),
        possible=possible_errors(options, record, every),
    )  # fmt: skip


def _every(e: Experiment, options: Options, step: float) -> int:
    """The filter uses every so manyth sample of the record; step: usual time between two of these, s.

    Raises BadInput if the record has fewer samples than the rate asks for, or if they are too few for the
    frequency of an unknown input.
    """
    if not e.estimate:
        return 1
    recorded, rate = 1 / step, e.estimate.rate
    if rate and rate > recorded * (1 + POLICY.faster):
        raise BadInput(
            f"{e.file}: [estimate] rate = {rate:g} Hz is above the {recorded:.6g} Hz of the record; "
            "leave it out to use every sample"
        )
    every = max(1, round(recorded / rate)) if rate else 1
    for name, unknown in e.estimate.inputs.items():
        if name not in options.random_walk and unknown.frequency > recorded / every / 2:
            raise BadInput(
                f"{e.file}: [estimate.inputs.{name}] frequency = {unknown.frequency:g} Hz does not show in "
                f"samples at {recorded / every:.6g} Hz; name one of at most half of that"
            )
    return every


def _check_measured(e: Experiment, record: Record, s: Samples) -> None:
    """Raise BadInput if an output has no measurements, or too few to estimate its undeclared noise."""
    for j, name in enumerate(record.outputs):
        if not np.isfinite(s.y[:, j]).any():
            raise BadInput(
                f"{e.file}: [estimate] rate leaves no measurement of output '{name}'; use a higher rate"
            )
        found = int(np.isfinite(record.runs[0].y[:, j]).sum())
        if np.isnan(record.noise_std[j]) and found < POLICY.fewest_samples:
            raise BadInput(
                f"{e.file}: [outputs.{name}] has {found} measurements, too few to estimate its noise; "
                "add noise_std = ..."
            )


def _check_alarms(e: Experiment, options: Options, estimated: tuple[str, ...]) -> None:
    """Raise BadInput if an alarm is declared for a quantity that is not estimated."""
    for name in options.alarms:
        if name not in estimated:
            where = f"{e.file}: [estimate.options] alarms '{name}'"
            raise BadInput(f"{where} is not estimated; {did_you_mean(name, estimated)}")


def with_alarms(e: Experiment, options: Options) -> Options:
    """The options; if they declare no alarms, those of the model are used (a foreign FMU has none)."""
    if e.model is None or "alarms" in options.model_fields_set:
        return options
    alarms = {
        name: Alarm(below=v.alarm_below, above=v.alarm_above)
        for name, v in declared(model_class(e.model)).items()
        if v.alarm_below is not None or v.alarm_above is not None
    }
    return options.model_copy(update={"alarms": alarms})


def _needed(archive: Archive, values: Mapping[str, float], s: Samples, record: Record) -> tuple[str, ...]:
    """The states on which the measured outputs depend, found by restarting the FMU."""
    d = archive.description
    states = d.states
    if not states:
        return ()
    scale = np.array([usual(d.variables[n], values.get(n)) for n in states])
    put = [*states, *record.inputs]
    first = [values.get(n, d.variables[n].start or 0.0) for n in states]
    constants = {n: v for n, v in values.items() if n not in put}
    get = [*states, *(n for n in record.outputs if n not in states)]
    with archive.made(Copies, Way.RESTART, put, get, constants, float(s.t[0])) as copies:
        row = np.array([*first, *s.u[0].tolist()])
        return tuple(needed(copies, row, states, record.outputs, scale, float(s.t[0]), s.step))


def _fine_enough(
    archive: Archive, values: Mapping[str, float], record: Record, states: tuple[str, ...], noise: Array,
    every: int, parts: int | None,
) -> tuple[Samples, Array]:  # fmt: skip
    """The samples, each step divided until finer parts change the outputs less than noise, and a simulation.

    In a stiff model, the slip at the end of a step differs between a constant input and a changing one.
    """
    run = record.runs[0]
    found = samples(run.t, run.u, run.y, every, parts or 1)
    free = _free_run(archive, values, found, record, states)
    while parts is None and found.held.shape[1] < POLICY.most_parts:
        finer = samples(run.t, run.u, run.y, every, 2 * found.held.shape[1])
        other = _free_run(archive, values, finer, record, states)
        if not np.any(_apart(free, other, len(noise)) > POLICY.told_apart * noise):
            break
        found, free = finer, other
    return found, free


def _apart(one: Array, other: Array, n: int) -> Array:
    """Root mean square (n,) of the difference of the first columns of two arrays (N, k)."""
    difference = partial(lambda a, b, rows: b[rows, :n] - a[rows, :n], one, other)
    return np.asarray(np.sqrt(mean_square(difference, len(one), 8 * n)))


def _free_run(
    archive: Archive, values: Mapping[str, float], s: Samples, record: Record, states: tuple[str, ...]
) -> Array:
    """Outputs and states (N, m + n) simulated with the start values; nan where the FMU fails."""
    names, parts = [*record.outputs, *states], s.held.shape[1]
    with Fmu(archive) as fmu:
        try:
            return set_aside(fmu.simulate(*finely(s, record.inputs), names, dict(values), every=parts))
        except FmuError:
            return np.full((len(s.t), len(names)), np.nan)


def finely(s: Samples, names: Sequence[str]) -> tuple[Array, dict[str, Array]]:
    """Times (M,) at which the parts of the steps begin, and the inputs by name at these times, (M,) each."""
    parts = s.held.shape[1]
    share = np.arange(parts) / parts
    t = np.append((s.t[:-1, None] + np.diff(s.t)[:, None] * share).ravel(), s.t[-1])
    return t, {name: np.interp(t, s.t, s.u[:, j]) for j, name in enumerate(names)}
