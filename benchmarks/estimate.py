"""What a step of a joint UKF costs: here, and the plain way with FMPy calls per sigma point and filterpy.

Run: python -m benchmarks.estimate. The rig with friction and rolling radius unknown, 200 Hz: two states,
two parameters, nine sigma points. Figures are medians over rounds in which the ways take turns, so that a
drift of the machine's speed touches all of them; read the ratios.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from estimator.joint import Joint, UnknownParameter, UnknownState
from estimator.record import Array
from estimator.transform import bounded
from estimator.ukf import Ukf
from fmus.errors import BadInput
from fmus.export.pythonfmu import build_python
from fmus.testrig.model import Testrig

STEPS, ROUNDS, DT = 400, 5, 5e-3
STATES = {"omega_w": 12.16, "omega_r": 9.36}
PARAMETERS = {"mu0": 0.35, "r_w": 0.348}
NAMES = (*STATES, *PARAMETERS)
NOISE = np.diag([2e-3, 2e-3]) ** 2
TORQUE = 300.0  # N.m
Q = np.diag([1e-4, 1e-4, 1e-12, 1e-12]) * DT
P = np.diag([1e-4, 1e-4, 1e-3, 1e-7])


class Plain:
    """As a script would do it: one FMPy instance, a restart for each sigma point, filterpy as it is."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        described = read_model_description(str(fmu))
        self.references = {v.name: v.valueReference for v in described.modelVariables}
        self.slave = FMU2Slave(
            guid=described.guid,
            unzipDirectory=extract(str(fmu), unzipdir=str(folder)),
            modelIdentifier=described.coSimulation.modelIdentifier,
            instanceName="plain",
        )
        self.slave.instantiate()
        points = MerweScaledSigmaPoints(4, 1.0, 2.0, 0.0)
        self.ukf = UnscentedKalmanFilter(4, 2, DT, lambda x: x[:2], self.move, points)
        self.ukf.x, self.ukf.P = np.array([*STATES.values(), *PARAMETERS.values()]), P.copy()
        self.ukf.Q, self.ukf.R = Q, NOISE

    def move(self, x: Array, dt: float) -> Array:
        """A sigma point by restart and step."""
        slave = self.slave
        slave.reset()
        slave.setReal([self.references[n] for n in (*NAMES, "T_P")], [*x.tolist(), TORQUE])
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.doStep(0.0, dt)
        return np.array([*slave.getReal([self.references[n] for n in STATES]), *x[2:]])

    def step(self, y: Array) -> Array:
        """Predict and correct."""
        self.ukf.predict()
        self.ukf.update(y)
        found: Array = self.ukf.x
        return found


class Ours:
    """The same by the filter of this repository."""

    def __init__(self, fmu: Path, compiled: bool) -> None:
        std = dict(zip(NAMES, np.sqrt(np.diag(P)).tolist(), strict=True))
        states = [UnknownState(n, v, std[n]) for n, v in STATES.items()]
        unknown = [UnknownParameter(n, v, std[n], bounded(None)) for n, v in PARAMETERS.items()]
        self.joint = Joint(fmu, list(STATES), states, unknown, inputs=["T_P"], dt=DT, compiled=compiled)
        self.filter = Ukf(self.joint, self.joint.start(), Q, NOISE, DT)
        self.u = np.array([TORQUE])
        self.filter.step(self.u, np.full(2, np.nan))  # the first one moves no time

    def step(self, y: Array) -> Array:
        """Predict and correct."""
        return self.filter.step(self.u, y).x


def ways(folder: Path) -> dict[str, Any]:
    """All that can be run here; native FMUs where a compiler is at hand."""
    python = build_python(Testrig(), folder / "python")
    found: dict[str, Any] = {
        "plain, PythonFMU": Plain(python, folder / "unpacked"),
        "ours, PythonFMU": Ours(python, True),
        "ours, PythonFMU, without numba's loop": Ours(python, False),
    }
    try:
        from fmus.export.native.build import build_native

        native = build_native(Testrig(), folder / "native")
    except (ImportError, BadInput) as error:
        print(f"no native FMU: {error}")
        return found
    return found | {
        "plain, native": Plain(native, folder / "unpacked_native"),
        "ours, native": Ours(native, True),
        "ours, native, without numba's loop": Ours(native, False),
    }


def main() -> None:
    """Measure, check that all estimates agree, print."""
    with tempfile.TemporaryDirectory() as name:
        made = ways(Path(name))
        rng = np.random.default_rng(1)
        times: dict[str, list[float]] = {way: [] for way in made}
        for _ in range(ROUNDS):
            y = np.array(list(STATES.values())) + 2e-3 * rng.standard_normal((STEPS, 2))
            last: list[Array] = []
            for way, filter in made.items():
                begun = time.perf_counter()
                for row in y:
                    found = filter.step(row)
                times[way].append((time.perf_counter() - begun) / STEPS * 1e6)
                last.append(found)
            spread = float(np.max(np.abs(np.array(last) / last[0] - 1)))
        _print(times, spread)
        for filter in made.values():
            if isinstance(filter, Ours):
                filter.joint.close()


def _print(times: dict[str, list[float]], spread: float) -> None:
    print(f"joint UKF of the rig, {DT * 1e3:g} ms, nine sigma points; medians of {ROUNDS} x {STEPS} steps")
    for way, us in times.items():
        plain = np.array(times["plain, native" if "native" in way else "plain, PythonFMU"])
        typical = float(np.median(us))
        print(
            f"{way:40} {typical:8.0f} µs a step  {np.median(plain / us):5.1f} times the plain way's speed  "
            f"{DT * 1e6 / typical:6.1f} times real time"
        )
    print(f"estimates at the end agree within {spread:.1g} relative")


if __name__ == "__main__":
    main()
