"""Computing time of a filter step in the friction case, compared with FMPy per sigma point and filterpy.

Run: python -m benchmarks.estimate. The case is the wheelset at 40 m/s and 1 kHz: six states, mu0 and the
alignment, an unknown input with a shaping filter (nine unknowns, 19 sigma points), from four noisy outputs.
The filters alternate in rounds, so that changes of the machine's speed affect all of them; the ratios are
meaningful. The last lines are for the whole record with the filter of `railfmi estimate` and its history.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from estimator.filters.bounds import bounded
from estimator.filters.history import filtered, samples
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from estimator.filters.unknown_input import Shaped
from estimator.record import Array
from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.host.fmu import Fmu
from fmus.wheelset.model import Wheelset

DT, SECONDS = 1e-3, 75.0
STEPS, ROUNDS = 100, 7
V, MU0 = 40.0, 0.5  # m/s, 1
NOISE = {"y": 1e-4, "psi": 1e-5, "y_dot": 1e-3, "psi_dot": 1e-3}
STATES = [
    UnknownState("y", 0.0, 1e-3, 1e-9),
    UnknownState("psi", 0.0, 1e-3, 1e-9),
    UnknownState("y_dot", 0.0, 1e-2, 1e-6),
    UnknownState("psi_dot", 0.0, 1e-2, 1e-6),
    UnknownState("y_m", 0.0, 1e-3, 1e-9),
    UnknownState("y_m_dot", 0.0, 1e-2, 1e-6),
]
FRICTION = UnknownParameter("mu0", 0.4, 0.1, bounded((0.01, 0.6)), walk=0.005)
ALIGNMENT = Shaped("y_irr", 0.8e-3, 1.5, "y_irr_dot", 1.0)
R = np.diag(np.square([*NOISE.values()]))
NOTHING = np.empty(0)  # there are no known inputs besides V


def record(fmu: Path, seconds: float) -> Array:
    """Noisy outputs (N, 4) of a simulation over waves of 6 to 60 m length with random phases."""
    rng, t = np.random.default_rng(1), np.arange(round(seconds / DT) + 1) * DT
    omega = 2 * np.pi * V / np.geomspace(6.0, 60.0, 40)
    waves = np.outer(t, omega) + rng.uniform(0, 2 * np.pi, 40)
    size = ALIGNMENT.std * np.sqrt(2 / 40) * np.minimum(t, 1.0)[:, None]  # grows from zero in 1 s
    y_irr = (size * np.sin(waves)).sum(axis=1)
    inputs = {"y_irr": y_irr, "y_irr_dot": np.gradient(y_irr, DT)}
    with Fmu(fmu) as plant:
        y = plant.simulate(t, inputs, list(NOISE), {"V": V, "mu0": MU0})
    return y + rng.standard_normal(y.shape) * [*NOISE.values()]


class Ours:
    """The unscented filter of railfmi."""

    def __init__(self, fmu: Path, compiled: bool = True) -> None:
        self.joint = Joint(
            fmu, list(NOISE), STATES, [FRICTION], [ALIGNMENT], constants={"V": V}, dt=DT, compiled=compiled
        )
        self.filter = Ukf(self.joint, self.joint.start(), self.joint.noise, R, DT)
        self.filter.step(NOTHING, np.full(len(NOISE), np.nan))  # the first step does not advance the time

    def step(self, y: Array) -> Array:
        """Predict and correct."""
        return self.filter.step(NOTHING, y).x


class Plain:
    """The filter of a simple script: one FMPy instance, a restart for each sigma point, filterpy's filter."""

    def __init__(self, fmu: Path, folder: Path, same: Joint) -> None:
        described = read_model_description(str(fmu))
        self.references = {v.name: v.valueReference for v in described.modelVariables}
        self.slave = FMU2Slave(
            guid=described.guid,
            unzipDirectory=extract(str(fmu), unzipdir=str(folder)),
            modelIdentifier=described.coSimulation.modelIdentifier,
            instanceName="plain",
        )
        self.slave.instantiate()
        start, n = same.start(), len(same.names)
        points = MerweScaledSigmaPoints(n, 1.0, 2.0, 0.0)
        self.ukf = UnscentedKalmanFilter(n, len(NOISE), DT, lambda x: x[: len(NOISE)], self.move, points)
        self.ukf.x, self.ukf.P, self.ukf.Q, self.ukf.R = start.x, start.P, same.noise(DT), R
        self.walk = ALIGNMENT.discrete(DT)[0]
        states = [s.name for s in STATES]
        self.into = self._references([*states, "mu0", "y_irr", "y_irr_dot", "V"])
        self.out = self._references(states)

    def move(self, x: Array, dt: float) -> Array:
        """Propagate a sigma point by a restart and a step."""
        n, slave, after = len(STATES), self.slave, self.walk @ x[-2:]
        acting = (x[-2:] + after) / 2
        slave.reset()
        slave.setReal(self.into, [*x[:n], float(FRICTION.transform.theta(x[n])), *acting, V])
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.doStep(0.0, dt)
        return np.array([*slave.getReal(self.out), x[n], *after])

    def step(self, y: Array) -> Array:
        """Predict and correct."""
        self.ukf.predict()
        self.ukf.update(y)
        found: Array = self.ukf.x
        return found

    def _references(self, names: list[str]) -> list[int]:
        return [self.references[n] for n in names]


@dataclass(frozen=True)
class Way:
    """A filter with its label and the label of the filter with which it is compared."""

    label: str
    plain: str
    filter: Ours | Plain


def builds(folder: Path) -> Iterator[tuple[str, Path]]:
    """The FMUs that can be built on this machine."""
    yield "PythonFMU", build_python(Wheelset(), folder / "python")
    try:
        from fmus.export.builders.native.build import build_native

        yield "native", build_native(Wheelset(), folder / "native")
    except (ImportError, BadInput) as error:
        print(f"the native FMU is left out, it cannot be built: {error}")


def ways(made: dict[str, Path], folder: Path) -> Iterator[Way]:
    """All filters for the given FMUs."""
    for kind, fmu in made.items():
        ours, plain = Ours(fmu), f"plain, {kind}"
        yield Way(plain, plain, Plain(fmu, folder / f"unpacked_{kind}", ours.joint))
        yield Way(f"ours, {kind}", plain, ours)
        yield Way(f"ours, {kind}, without numba's loop", plain, Ours(fmu, compiled=False))


def measured(found: list[Way], y: Array) -> tuple[dict[str, list[float]], float]:
    """Time of a step in µs by label and round, and the largest difference of estimates, in deviations."""
    times: dict[str, list[float]] = {way.label: [] for way in found}
    for rows in np.array_split(y[: STEPS * ROUNDS], ROUNDS):
        last = []
        for way in found:
            begun = time.perf_counter()
            for row in rows:
                x = way.filter.step(row)
            times[way.label].append((time.perf_counter() - begun) / len(rows) * 1e6)
            last.append(x)
    P = next(way.filter.filter.now.P for way in found if isinstance(way.filter, Ours))
    return times, float(np.max(np.abs(np.array(last) - last[0]) / np.sqrt(np.diag(P))))


def report(found: list[Way], times: dict[str, list[float]], apart: float) -> None:
    """Print the medians with their ratios, and the fastest round, which other programs disturbed least."""
    print(f"friction case, 19 sigma points, {DT * 1e3:g} ms; medians of {ROUNDS} rounds of {STEPS} steps")
    for way in found:
        us, real = np.array(times[way.label]), DT * 1e6
        faster = np.median(np.array(times[way.plain]) / us)
        print(
            f"{way.label:36} {np.median(us):7.0f} µs per step  {faster:6.1f} times the plain filter's speed  "
            f"{real / np.median(us):6.2f} times real time ({real / us.min():.2f} at best)"
        )
    print(f"the final estimates agree within {apart:.1g} standard deviations")


def whole(kind: str, fmu: Path, y: Array) -> str:
    """Filter the whole record; the speed and the final estimate of mu0 as a sentence."""
    s = samples(np.arange(len(y)) * DT, np.empty((len(y), 0)), y)
    made = Ours(fmu)
    begun = time.perf_counter()
    found = filtered(Ukf(made.joint, made.joint.start(), made.joint.noise, R, DT), s)
    took = time.perf_counter() - begun
    mu0 = made.joint.values(found.x[-1:], found.std[-1:])[0][0, len(STATES)]
    made.joint.close()
    speed = f"{s.t[-1]:g} s in {took:.1f} s, {s.t[-1] / took:.2f} times real time"
    return f"{kind}: {speed}; mu0 {mu0:.3f}, true {MU0:g}"


def main(arguments: Any = None) -> None:
    """Measure the times, compare the estimates and print both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="length of the whole record")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        made = dict(builds(Path(name)))
        y = record(list(made.values())[-1], max(given.seconds, STEPS * ROUNDS * DT))
        found = list(ways(made, Path(name)))
        report(found, *measured(found, y))
        for kind, fmu in made.items():
            print(whole(kind, fmu, y[: round(given.seconds / DT) + 1]))
        for way in found:
            if isinstance(way.filter, Ours):
                way.filter.joint.close()


if __name__ == "__main__":
    main()
