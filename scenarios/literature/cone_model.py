"""Wheelset of Mal et al. 2020 on its cone (eq. 3 to 13, Table 1): lateral and yaw motion, a yaw spring alone.

Its equations are pictures that were not at hand. These follow from its text, its symbols and its Table 1. The
axes are those of ISO 8855: x forward, y left; the left wheel has the upper sign.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimator.filters.bounds import Transform
from estimator.record import Array
from fmus.contact.forces.coefficients import coefficients
from scenarios.literature.contact_force_ekf import BODY, GRAVITY, TABLE_1, YAW_STIFFNESS

R0, HALF, CONICITY = 0.5, TABLE_1["s"], 0.15  # m, m, 1: wheel radius, half gauge, cone, Table 1
M, I_Z = TABLE_1["m_w"], TABLE_1["I_wz"]  # kg, kg.m2
N = (BODY + M) * GRAVITY / 2  # N, wheel load
A_PATCH, B_PATCH = 7.0e-3, 5.0e-3  # m, by Hertz for N, R0 and a rail of 0.3 m
G, NU = 80e9, 0.25  # Pa, 1: a column of Kalker's table
C11 = float(coefficients(A_PATCH / B_PATCH, NU).c11)
TANGENT = np.pi * G * A_PATCH * B_PATCH * C11 / 4  # N: gradient of tangential stress times mu N, per creep
SMALLEST = 1e-9  # of a total creep, by which it is rounded at zero
MOTION = ("y", "psi", "y_dot", "psi_dot")
OUTPUTS = ("y_ddot", "psi_dot")
SIDES = {"left": 1.0, "right": -1.0}

Surface = Mapping[str, float]  # mu0, A, B, k_A, k_S


def total_force(V: float, creep: Array, mu0: Array | float, on: Surface) -> Array:
    """Creep force (k,) of a wheel, N, by Polach with falling friction at total creeps (k,): eq. 8 to 11."""
    bound = N * mu0 * ((1 - on["A"]) * np.exp(-on["B"] * V * creep) + on["A"])
    eps = TANGENT * creep / bound
    adhesion = on["k_A"] * eps / (1 + (on["k_A"] * eps) ** 2)
    found: Array = 2 * bound / np.pi * (adhesion + np.arctan(on["k_S"] * eps))
    return found


def wheels(V: float, X: Array, y_irr: Array | float, mu0: Array | float, on: Surface) -> dict[str, Array]:
    """Creepages, creep forces [N] and accelerations (k,) at motions X (k, 4): eq. 3 to 7, 12 and 13."""
    found: dict[str, Array] = {}
    lateral, moment = np.zeros(len(X)), -YAW_STIFFNESS * X[:, 1]
    across = X[:, 2] / V - X[:, 1]
    for name, side in SIDES.items():
        along = -side * (CONICITY * (X[:, 0] - y_irr) / R0 + HALF * X[:, 3] / V)
        creep = np.sqrt(along**2 + across**2 + SMALLEST**2)
        share = -total_force(V, creep, mu0, on) / creep
        lateral, moment = lateral + share * across, moment - side * HALF * share * along
        found |= {f"xi_x_{name}": along, f"xi_y_{name}": across}
        found |= {f"F_x_{name}": share * along, f"F_y_{name}": share * across}
    return {**found, "y_ddot": lateral / M, "psi_ddot": moment / I_Z}


@dataclass(frozen=True)
class Cone:
    """The wheelset as the System of a filter: its motion and z of mu0; the alignment is the one input.

    on: the surface whose A, B, k_A and k_S are known; transform: of mu0. A step is one of Runge and Kutta.
    """

    V: float  # m/s
    on: Surface
    transform: Transform
    names: tuple[str, ...] = (*MOTION, "mu0")
    outputs: tuple[str, ...] = OUTPUTS

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """See System."""
        after, x, mu0 = X.copy(), X[:, :4], self.transform.theta(X[:, 4])
        k1 = self._rates(x, u, mu0)
        k2 = self._rates(x + dt / 2 * k1, u, mu0)
        k3 = self._rates(x + dt / 2 * k2, u, mu0)
        k4 = self._rates(x + dt * k3, u, mu0)
        after[:, :4] = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return after, carried

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """See System."""
        seen = wheels(self.V, X[:, :4], u[0], self.transform.theta(X[:, 4]), self.on)
        return np.column_stack([seen["y_ddot"], X[:, 3]])

    def _rates(self, x: Array, u: Array, mu0: Array) -> Array:
        seen = wheels(self.V, x, u[0], mu0, self.on)
        return np.column_stack([x[:, 2], x[:, 3], seen["y_ddot"], seen["psi_ddot"]])

    def settled(self, x: Array) -> Array:
        """See System."""
        return x

    def values(self, x: Array, std: Array) -> tuple[Array, Array]:
        """x (n, 5) and its deviations, with mu0 in place of its coordinate."""
        x, std = x.copy(), std.copy()
        std[:, 4] = self.transform.spread(x[:, 4], std[:, 4])
        x[:, 4] = self.transform.theta(x[:, 4])
        return x, std
