"""The friction case as a simple script would filter it: FMPy for each sigma point, and filterpy's filter."""

from pathlib import Path

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from benchmarks.friction import ALIGNMENT, DT, FRICTION, NOISE, STATES, R, V
from estimator.filters.system import Joint
from estimator.record import Array


class PlainFilter:
    """One FMPy instance, which is restarted for each sigma point; start and noise are those of `same`."""

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

    def close(self) -> None:
        """Free the instance."""
        self.slave.freeInstance()

    def _references(self, names: list[str]) -> list[int]:
        return [self.references[n] for n in names]
