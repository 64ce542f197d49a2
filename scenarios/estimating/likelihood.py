"""The filter that an experiment asks for, and the noise for which its innovations are likeliest."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from math import exp, log

import numpy as np

from estimator.filters import filters
from estimator.filters.estimator import Adaptation, Diverged, Estimate, Gate
from estimator.filters.history import Samples, Steps, filtered
from estimator.filters.named import Request
from estimator.filters.noise_likelihood import Innovations, Likeliest, climbed, innovations
from estimator.filters.policy import POLICY as OF_FILTER
from estimator.filters.process_noise import COARSE, LEAST, MOST, likeliest
from estimator.filters.sensor_noise import SensorNoise, correlated
from estimator.filters.system import Joint
from estimator.filters.ukf import Spread
from estimator.record import Array
from fmus.host.archive import Archive
from scenarios.estimating.policy import POLICY
from scenarios.estimating.sensors import STD, TIME, changed
from scenarios.estimating.setup import BAND, Setup
from scenarios.experiment.estimated import Options


def filter_of(s: Setup, joint: Joint, start: Estimate) -> Steps:
    """The filter that the options ask for."""
    asked = request(s.options, s.sensors, s.samples.step, s.samples.u[0])
    return filters()[s.options.filter].of(joint, start, asked)


def request(o: Options, sensors: Sequence[SensorNoise], dt: float, u: Array) -> Request:
    """What the options ask of a filter; sensors: noise of each output; u: (n_u,) first inputs."""
    gate = None if o.gate is None else Gate(o.gate)
    adapt = (
        Adaptation(measurement="measurement" in o.adapt, process="process" in o.adapt) if o.adapt else None
    )
    R = np.diag([n.white(dt) ** 2 for n in sensors])
    return Request(R, dt, u, gate, adapt, Spread(o.alpha, o.beta, o.kappa))


def likelihood_of(s: Setup, joint: Joint, samples: Samples) -> float:
    """Log likelihood of samples by the filter of a setup and its joint system; -inf if it diverges."""
    try:
        found = filtered(filter_of(s, joint, joint.start(float(samples.t[0]))), samples)
    except Diverged:
        return -np.inf
    return -np.inf if found.broken else found.log_likelihood


def noise_share(s: Setup, archive: Archive) -> float:
    """The share of the states' motion that is noise, by maximum likelihood over the first samples."""
    first = s.samples.first(OF_FILTER.noise_samples)
    with s.joint(archive, 0.0) as joint:  # one for all, since the ways into the FMU are tried out for each

        def likelihood(part: float) -> float:
            joint.set_noise(s.noise_of(part))
            return likelihood_of(s, joint, first)

        return likeliest(likelihood)


def with_noise(s: Setup, archive: Archive) -> tuple[Setup, float | None]:
    """The setup with the noise of the sensors that makes the record likeliest, and the share of motion.

    The share of the states' motion that is noise is sought with it, if it is not declared: what the noise of
    a sensor does not account for, the motion has to. The first samples show where to search, and a longer
    part of the record gives the numbers.
    """
    low, high = _bounds(s)
    found: Likeliest | None = None
    with s.joint(archive, 0.0) as joint:

        def of(samples: Samples) -> Callable[[Array], Innovations | None]:
            return lambda at: _innovations(s, joint, samples, at)

        few, many = (s.samples.first(n) for n in (OF_FILTER.noise_samples, OF_FILTER.noise_learnt))
        run = of(few)
        at = max(_starts(s, low, high), key=lambda at: x.log_likelihood if (x := run(at)) else -np.inf)
        for samples in (few, many)[len(many.t) == len(few.t) :]:
            found = climbed(of(samples), at, low, high) or found
            at = found.at if found else at
    new, share = _at(s, at)
    return replace(new, bands=_bands(s, found)) if found else new, share


def likelier(
    one: tuple[Setup, float | None], other: tuple[Setup, float | None], archive: Archive
) -> tuple[Setup, float | None]:
    """Of two setups, each with its share of noise in the motion, the one with the likelier first samples."""

    def likelihood(found: tuple[Setup, float | None]) -> float:
        s, share = found
        with s.joint(archive, share or 0.0) as joint:
            return likelihood_of(s, joint, s.samples.first(OF_FILTER.noise_samples))

    return max((other, one), key=likelihood)


def _innovations(s: Setup, joint: Joint, samples: Samples, at: Array) -> Innovations | None:
    """Of samples, with the noise at coordinates (p,)."""
    new, share = _at(s, at)
    joint.set_noise(s.noise_of(share or 0.0), correlated(new.sensors))
    return innovations(lambda: filter_of(new, joint, joint.start(float(samples.t[0]))), samples)


def _at(s: Setup, at: Array) -> tuple[Setup, float | None]:
    """The setup with the noise at coordinates (p,) of what is sought, the last of which is the share."""
    n = len(s.sought)
    return s.sensing(changed(s.sensors, s.sought, at[:n])), exp(at[n]) if s.moving else None


def _bounds(s: Setup) -> tuple[Array, Array]:
    """The lowest and highest coordinates (p,)."""
    bounds = [(w.low, w.high) for w in s.sought] + [(LEAST * log(10), MOST * log(10))] * s.moving
    low, high = np.array(bounds).T
    return low, high


def _starts(s: Setup, low: Array, high: Array) -> Iterator[Array]:
    """Coordinates (p,) from which the search may begin."""
    first = np.array([w.of(noise) for w in s.sought for noise in s.sensors if noise.output == w.output])
    what = np.array([w.what for w in s.sought])
    larger = (1.0, POLICY.noise_larger) if STD in what else (1.0,)
    times = POLICY.correlation_short, POLICY.correlation_middle, POLICY.correlation_long
    longer = [time / POLICY.correlation_middle for time in times] if TIME in what else [1.0]
    shares = np.linspace(LEAST, MOST, COARSE) * log(10)
    for up, out, share in product(larger, longer, shares if s.moving else shares[:1]):
        at = first + log(up) * (what == STD) + log(out) * (what == TIME)
        yield np.clip(np.append(at, share) if s.moving else at, low, high)


def _bands(s: Setup, found: Likeliest) -> dict[str, dict[str, tuple[float, float]]]:
    """The 95 % band of each quantity that was sought, by output."""
    bands: dict[str, dict[str, tuple[float, float]]] = {w.output: {} for w in s.sought}
    for w, at, std in zip(s.sought, found.at.tolist(), found.std.tolist(), strict=False):
        low, high = (w.value(float(np.clip(at + side * BAND * std, w.low, w.high))) for side in (-1, 1))
        bands[w.output][w.what] = low, high
    return bands
