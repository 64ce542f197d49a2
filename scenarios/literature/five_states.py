"""The extended Kalman filter of Mal et al. 2020 with creep, friction and force as states (eq. 18 to 36).

Its equations are pictures that were not at hand. What its text says is kept: the five states lateral
velocity, yaw rate, creep, friction coefficient and creep force; equal creep on both wheels (eq. 19); forward
Euler steps of 50 us (eq. 25 to 29); accelerometer and gyro; the Jacobian matrices (eq. 35 and 36); R and Q
(eq. 37 to 40).
The rates of creep, friction and force (eq. 22 to 24) are those of its eq. 6, 9 and 8 by the chain rule.
"""

from dataclasses import dataclass
from time import perf_counter

import casadi as cs
import numpy as np

from estimator.record import Array
from fmus.variables import Expr
from scenarios.literature.cone_model import CONICITY, HALF, I_Z, R0, TANGENT, M, N, Surface
from scenarios.literature.contact_force_ekf import YAW_STIFFNESS

STATES = ("y_dot", "psi_dot", "creep", "U", "force")
STEP = 50e-6  # s, its section 4
R = np.diag([1e-7, 1e-13])  # m2/s4, rad2/s2: accelerometer and gyro, eq. 37
Q = {  # of a step, eq. 38 to 40
    "dry": np.diag([5e-14, 1e-14, 1e-14, 1e-14, 1e-14]),
    "wet": np.diag([0.5e-12, 9e-17, 1e-12, 1e-12, 1e-12]),
    "poor": np.diag([1e-13, 9e-17, 1e-12, 1e-12, 1e-12]),
    "worst": np.diag([1e-13, 9e-17, 1e-12, 1e-12, 1e-12]),
}
FIRST = 1e-6  # creep at the start; it divides by the creep
ROUNDED = 1e-7  # creep, by which the division is rounded
LARGEST = 1e9  # an estimate beyond it has left the numbers that the equations are for


@dataclass(frozen=True)
class Estimates:
    """The five states over a record, (N, 5); nan from the sample on at which the filter was lost.

    Creep and force, which are magnitudes, may both turn their sign at zero: the motion is the same.
    """

    x: Array
    seconds: float
    lost: int | None  # the number of that sample

    def of(self, name: str) -> Array:
        """One of STATES, (N,)."""
        found: Array = self.x[:, STATES.index(name)]
        return found


def rates(V: float, on: Surface) -> cs.Function:
    """Rates (5,) of the states (eq. 20 to 24) from these, y and psi, and the alignment with its rate."""
    x, way, track = cs.SX.sym("x", 5), cs.SX.sym("way", 2), cs.SX.sym("track", 2)
    y_dot, psi_dot, creep, U, F = cs.vertsplit(x)
    y, psi = cs.vertsplit(way)
    y_t, y_t_dot = cs.vertsplit(track)
    along, across = CONICITY * (y - y_t) / R0 + HALF * psi_dot / V, y_dot / V - psi
    per_creep = creep / (creep**2 + ROUNDED**2)
    y_ddot = -2 * F * per_creep * across / M
    psi_ddot = (-2 * F * per_creep * HALF * along - YAW_STIFFNESS * psi) / I_Z
    along_dot = CONICITY * (y_dot - y_t_dot) / R0 + HALF * psi_ddot / V
    creep_dot = (along * along_dot + across * (y_ddot / V - psi_dot)) * per_creep
    U_dot = -on["B"] * V * (U - on["A"] * on["mu0"]) * creep_dot
    force = polach(creep, U, on)
    F_dot = cs.gradient(force, creep) * creep_dot + cs.gradient(force, U) * U_dot
    return cs.Function("rates", [x, way, track], [cs.vertcat(y_ddot, psi_ddot, creep_dot, U_dot, F_dot)])


def polach(creep: Expr, U: Expr, on: Surface) -> Expr:
    """Creep force of a wheel, N, at a total creep and a friction coefficient (eq. 8, 10 and 11)."""
    eps = TANGENT * creep / (N * U)
    adhesion = on["k_A"] * eps / (1 + (on["k_A"] * eps) ** 2)
    return 2 * N * U / np.pi * (adhesion + cs.atan(on["k_S"] * eps))


def step(V: float, on: Surface, noise: Array) -> cs.Function:
    """One step of the filter: (x, P, way) and what is told -> the same a step later.

    Told are y_t, y_t_dot of the last sample, and y_t, y_t_dot, y_ddot, psi_dot of this one.
    """
    f = rates(V, on)
    x, P, way, told = cs.SX.sym("x", 5), cs.SX.sym("P", 5, 5), cs.SX.sym("way", 2), cs.SX.sym("told", 6)
    moved = x + STEP * f(x, way, told[:2])
    F = cs.jacobian(moved, x)
    P1, way1 = F @ P @ F.T + noise, way + STEP * x[:2]
    seen = cs.SX.sym("seen", 5)
    h = cs.vertcat(f(seen, way1, told[2:4])[0], seen[1])
    at = cs.Function("at", [seen, x, P, way, told], [h, cs.jacobian(h, seen)])
    expected, H = at(moved, x, P, way, told)
    S = H @ P1 @ H.T + R
    K = P1 @ H.T @ cs.inv(S)
    x2, P2 = moved + K @ (told[4:] - expected), (cs.SX.eye(5) - K @ H) @ P1
    state = cs.vertcat(x, cs.vec(P), way)
    after = cs.vertcat(x2, cs.vec(P2), way1)
    return cs.Function("step", [state, told], [after])


def five_states(V: float, on: Surface, noise: Array, y_t: Array, y_t_dot: Array, y: Array) -> Estimates:
    """The filter from rest over outputs y (N, 2) every 50 us, with the alignment (N,) that it is told.

    on: the surface that it knows; noise: Q. The source prints no covariance of the start; Q is taken.
    """
    first = [0.0, 0.0, FIRST, on["mu0"], float(polach(cs.DM(FIRST), cs.DM(on["mu0"]), on))]
    start = np.concatenate([first, noise.ravel(order="F"), np.zeros(2)])
    track = np.column_stack([y_t, y_t_dot])
    told = np.column_stack([track[:-1], track[1:], y[1:]])
    began = perf_counter()
    after = np.array(step(V, on, noise).mapaccum("run", len(told))(start, told.T)).T
    x = np.vstack([first, after[:, :5]])
    gone = ~(np.abs(x).max(axis=1) < LARGEST)
    lost = int(np.argmax(gone)) if gone.any() else None
    if lost is not None:
        x[lost:] = np.nan
    return Estimates(x, perf_counter() - began, lost)
