"""Conicity as a spline over the shift that a filter learns while it runs (Charles et al. 2008)."""

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.record import Array
from scenarios.literature.conicity_model import Along


class Tabled(Along):
    """Conicity moves with the slope of a table (eq. 10 and 11); the filter's estimates correct its nodes.

    nodes: shifts (m,), m; start, std: of the conicity at each; memory: how much of an estimate's
    information a sample leaves, since one follows from the other; kept: see Along. The curve is redrawn
    every few samples.
    """

    EVERY = 25  # samples

    def __init__(self, nodes: Array, start: float, std: float, memory: float, kept: float = 1.0) -> None:
        super().__init__(kept)
        self.nodes, self.values = nodes, np.full(len(nodes), start)
        self._weight, self._memory = np.full(len(nodes), std**-2.0), memory
        self._count = 0
        self._draw()

    def moved(self, more: Array, shift: Array, by: Array) -> Array:
        """See Belief."""
        after = super().moved(more, shift, by)
        at = np.clip(shift + by / 2, self.nodes[0], self.nodes[-1])
        after[:, 0] += self._slope(at) * by
        return after

    def learn(self, shift: float, conicity: float, variance: float) -> None:
        """Correct the nodes about a shift [m] by an estimate of the conicity there and its variance."""
        share = np.maximum(1 - np.abs(shift - self.nodes) / (self.nodes[1] - self.nodes[0]), 0.0)
        gained = self._memory * share / variance
        self._weight += gained
        self.values += gained / self._weight * (conicity - float(self._curve(shift)))
        self._count += 1
        if self._count % self.EVERY == 0:
            self._draw()

    def curve(self, shift: Array) -> Array:
        """Conicity at shifts (n,), m."""
        found: Array = CubicSpline(self.nodes, self.values)(shift)
        return found

    def _draw(self) -> None:
        self._curve = CubicSpline(self.nodes, self.values)
        self._slope = self._curve.derivative()
