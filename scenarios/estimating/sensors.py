"""The noise of the measured outputs in an estimate: what is declared of it, and what the record is to say."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log
from typing import Any

import numpy as np
from scipy.special import expit, logit

from estimator.filters import filters
from estimator.filters.policy import POLICY as OF_FILTER
from estimator.filters.sensor_noise import SensorNoise
from estimator.noise import white_noise
from estimator.record import Array, Record
from estimator.rounding import step_of
from fmus.errors import BadInput, did_you_mean
from scenarios.estimating.policy import POLICY
from scenarios.estimating.rounding import least_std, rounded_noise, with_rounding
from scenarios.experiment.estimated import ESTIMATED, Options, OutputNoise
from scenarios.experiment.experiment import Experiment

STD, SHARE, TIME = "std", "share", "time"
FLOOR = 1e-9  # of a channel's standard deviation: the noise of a record without rounding


@dataclass(frozen=True)
class Sought:
    """A quantity of an output's noise that the record is to say: `what` is STD, SHARE or TIME.

    The search is for the logarithm of a standard deviation or time and the logit of a share, between low and
    high.
    """

    output: str
    what: str
    low: float
    high: float

    def of(self, noise: SensorNoise) -> float:
        """The coordinate of the quantity in this noise."""
        value = float(getattr(noise, self.what))
        return float(np.clip(logit(value) if self.what == SHARE else log(value), self.low, self.high))

    def value(self, coordinate: float) -> float:
        """The quantity, in its unit."""
        return float(expit(coordinate)) if self.what == SHARE else exp(coordinate)


def check_noise(e: Experiment, o: Options) -> None:
    """Raise BadInput if [estimate.noise] names no output, or asks for what the filter cannot find."""
    for name, noise in _declared(e).items():
        where = f"{e.file}: [estimate.noise.{name}]"
        if name not in e.outputs:
            raise BadInput(f"{where} is none of [outputs]; {did_you_mean(name, e.outputs)}")
        open_ones = ESTIMATED in (noise.std, noise.time, noise.share) or e.outputs[name].noise_std is None
        if open_ones and not likelihood_says(o):
            raise BadInput(
                f"{where}: what is estimated of noise needs the likelihood of all samples, which filter = "
                f"'{o.filter}', gate or adapt does not allow; give numbers and noise_std, or change these"
            )


def likelihood_says(o: Options) -> bool:
    """Whether the options allow to compare noises by the likelihood of the innovations.

    Samples that a gate leaves out have none, noise that is adapted is another one at every sample, and the
    particles of a filter scatter by more than the noises differ.
    """
    return filters()[o.filter].moments and o.gate is None and not o.adapt


def noise_of(e: Experiment, o: Options, record: Record, dt: float) -> tuple[SensorNoise, ...]:
    """The noise of each output, as declared, or else as third differences and the sensor's steps show it.

    dt: s, between samples. Noise that the record is to say has values with which the search begins.
    """
    found = []
    for j, name in enumerate(record.outputs):
        std, declared = float(record.noise_std[j]), _declared(e).get(name, OutputNoise(std=ESTIMATED))
        seen = _seen(record, j)
        step = step_of([seen])
        if np.isnan(std):
            if not np.ptp(seen):
                raise BadInput(
                    f"{e.file}: [outputs.{name}] is constant over the record, which does not show its noise; "
                    "add noise_std, or leave the output out"
                )
            rough = rounded_noise(seen) if step else _rough(seen)
            std = max(rough, FLOOR * float(np.std(seen)), least_std(step), 1e-300)
        noise = SensorNoise(name, std)
        if declared.time is None:
            if step > std and filters()[o.filter].noises:
                noise = with_rounding(noise, seen, step, record.runs[0].sample)
        else:
            time = declared.time if isinstance(declared.time, float) else POLICY.correlation_middle * dt
            share = declared.share if isinstance(declared.share, float) else POLICY.correlated_share
            noise = replace(noise, time=time, share=share)
        found.append(noise)
    return tuple(found)


def sought(e: Experiment, o: Options, record: Record, noise: Sequence[SensorNoise]) -> tuple[Sought, ...]:
    """What the record is to say of the noise of its outputs."""
    if not likelihood_says(o):
        return ()
    found, t = [], record.runs[0].t
    step, far = log(float(np.median(np.diff(t)))), -float(logit(OF_FILTER.least_share))
    for j, n in enumerate(noise):
        declared, spread = _declared(e).get(n.output), float(np.std(_seen(record, j)))
        if np.isnan(record.noise_std[j]) or (declared and declared.std == ESTIMATED):
            low = min(max(FLOOR * spread, least_std(step_of([_seen(record, j)])), 1e-300), n.std)
            found.append(Sought(n.output, STD, log(low), log(max(spread, n.std))))
        if declared and declared.share == ESTIMATED:
            found.append(Sought(n.output, SHARE, -far, far))
        if declared and declared.time == ESTIMATED:
            found.append(Sought(n.output, TIME, step, log(float(t[-1] - t[0]))))
    return tuple(found)


def changed(noise: Sequence[SensorNoise], wanted: Sequence[Sought], at: Array) -> tuple[SensorNoise, ...]:
    """The noise with the sought quantities at coordinates (p,)."""
    new: dict[str, dict[str, Any]] = {n.output: {} for n in noise}
    for s, coordinate in zip(wanted, at.tolist(), strict=True):
        new[s.output][s.what] = s.value(coordinate)
    return tuple(replace(n, **new[n.output]) for n in noise)


def _rough(y: Array) -> float:
    """Standard deviation of the noise of a channel y (N,), also of one that rests with few digits."""
    return white_noise([y]) or white_noise([y], quantised=True)


def _declared(e: Experiment) -> Mapping[str, OutputNoise]:
    return e.estimate.noise if e.estimate else {}


def _seen(record: Record, j: int) -> Array:
    """The measurements of output number j of a record."""
    y = record.runs[0].y[:, j]
    found: Array = y[np.isfinite(y)]
    return found
