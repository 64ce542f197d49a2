"""Truth of a driven wheelset, independent of the product: plain NumPy and SciPy.

Written from Mal et al. 2020, eq. 1 to 17, as they follow from the quantities of its Table 1. Differs in form:
absolute angles of motor and wheels instead of twists, matrices instead of single equations, Mal's way to
Polach's stress gradient, or FASTSIM's tractions; inputs linear between samples; an adaptive stiff method.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from tests.truth.contact import Array, Patch, fastsim
from tests.truth.laws import Law

SLOWEST = 0.01  # m/s, below which the creepage no longer grows
BRAKE_ROUNDING = 1e-3  # rad/s
INPUTS = ("T_m", "T_b", "y", "psi", "y_dot", "psi_dot", "y_irr", "F_x_ext")
STATES = ("theta_left", "theta_right", "theta_m", "x", "omega_left", "omega_right", "omega_m", "V")
Push = tuple[str, Law]  # a place and the law there
CREEPS = np.geomspace(1e-3, 1e3, 121)  # at which FASTSIM is worked out, in units of full slip's order


@dataclass(frozen=True)
class Traction:
    """Parameters, SI; Mal et al. 2020, Tables 1 and 3 (dry), if given there. form: polach or fastsim."""

    I_left: float = 64.0
    I_right: float = 64.0
    J_m: float = 2.8
    i_g: float = 5.0
    k_s: float = 6063260.0
    c_s: float = 0.0
    k_g: float = 2e7
    c_g: float = 500.0
    M_v: float = 15000.0
    F_n: float = 79.7e3
    r0: float = 0.5
    lambda_w: float = 0.15
    s: float = 0.75
    a: float = 7.0e-3
    b: float = 5.0e-3
    mu0: float = 0.46
    A: float = 0.4
    B: float = 0.6
    k_A: float = 1.0
    k_S: float = 1.0
    G: float = 8e10
    form: str = "polach"

    @property
    def inertia(self) -> Array:
        """Of left wheel, right wheel and motor, kg.m2."""
        return np.array([self.I_left, self.I_right, self.J_m])

    def shafts(self, stiffness: float, drive: float) -> Array:
        """Matrix (3, 3) of axle and drive over the angles of left wheel, right wheel and motor."""
        axle, gear = np.array([-1.0, 1.0, 0.0]), np.array([0.0, -1.0, 1 / self.i_g])
        matrix: Array = stiffness * np.outer(axle, axle) + drive * np.outer(gear, gear)
        return matrix

    def frequencies(self) -> Array:
        """Torsional natural frequencies [Hz] of the wheelset lifted off the rails, without damping."""
        values = eigh(self.shafts(self.k_s, self.k_g), np.diag(self.inertia), eigvals_only=True)
        found: Array = np.sqrt(np.maximum(values[1:], 0.0)) / (2 * np.pi)
        return found


@dataclass(frozen=True)
class Inputs:
    """Samples of the inputs over time t (n,), s; those not given are zero."""

    t: Array
    given: Mapping[str, Array] = field(default_factory=dict)

    def at(self, now: float) -> dict[str, float]:
        """Values at a time, on straight lines between the samples."""
        k = min(max(int(np.searchsorted(self.t, now)), 1), len(self.t) - 1)
        part = (now - self.t[k - 1]) / (self.t[k] - self.t[k - 1])
        part = min(max(part, 0.0), 1.0)
        return {
            name: float((1 - part) * self.given[name][k - 1] + part * self.given[name][k])
            if name in self.given
            else 0.0
            for name in INPUTS
        }


@cache
def saturation(a: float, b: float) -> Array:
    """Share of mu N over the dimensionless creep, both (n,), by FASTSIM without spin, from zero.

    A simplified theory without spin knows one number only: rigid slip over flexibility, over the traction
    bound per length. The patch is worked out along rolling; the load and friction are of no account.
    """
    N, mu, G = 1e4, 0.3, 8e10
    patch = Patch(a, b, N, mu, G)
    per_unit = 3 * mu * N / (G * a * b * patch.kalker()[0])
    shares = [-fastsim(patch, q * per_unit, 0.0, 0.0)[0] / (mu * N) for q in CREEPS]
    return np.array([[0.0, *CREEPS], [0.0, *shares]])


def creep_forces(p: Traction, along: float, across: float, V: float) -> Array:
    """(F_x, F_y) [N] on a wheel whose contact slips at along, across [m/s] while it travels at V [m/s]."""
    slip = float(np.hypot(along, across))
    if slip == 0.0:
        return np.zeros(2)
    mu = p.mu0 * (p.A + (1 - p.A) * np.exp(-p.B * slip))
    speed = float(np.hypot(V, SLOWEST))
    creep = np.array([along, across]) / speed
    c11, c22 = Patch(p.a, p.b, p.F_n, mu, p.G).kalker()[:2]
    if p.form == "fastsim":
        linear = p.G * p.a * p.b * np.array([c11, c22]) * creep
        size = float(np.hypot(*linear))
        q, share = saturation(p.a, p.b)
        return -linear / size * mu * p.F_n * float(np.interp(size / (3 * mu * p.F_n), q, share))
    c = np.hypot(c11 * creep[0], c22 * creep[1]) / np.hypot(*creep)
    C = 3 * p.G * c / (8 * p.a)  # Mal's eq. 11, contact shear stiffness
    epsilon = 2 / 3 * C * np.pi * p.a**2 * p.b / (p.F_n * mu) * np.hypot(*creep)
    part = p.k_A * epsilon / (1 + (p.k_A * epsilon) ** 2) + np.arctan(p.k_S * epsilon)
    return -2 * p.F_n * mu / np.pi * part * np.array([along, across]) / slip


def contacts(p: Traction, x: Sequence[float], u: Mapping[str, float]) -> dict[str, float]:
    """Rolling radii, slips over speed and creep forces of both wheels at a state and inputs."""
    found = {}
    V = x[7]
    for side, sign, omega in (("left", 1.0, x[4]), ("right", -1.0, x[5])):
        r = p.r0 + sign * p.lambda_w * (u["y"] - u["y_irr"])
        along = V - r * omega - sign * p.s * u["psi_dot"]
        across = u["y_dot"] - V * u["psi"]
        F_x, F_y = creep_forces(p, along, across, V)
        speed = float(np.hypot(V, SLOWEST))
        named = {"r": r, "xi_x": along / speed, "xi_y": across / speed, "F_x": F_x, "F_y": F_y}
        found |= {f"{name}_{side}": float(value) for name, value in named.items()}
    return found


def direction(p: Traction, place: str) -> Array:
    """How a force at a place enters the four coordinates, (4,); its motion there is this times theirs."""
    left, right, motor, along = np.eye(4)
    return {
        "wheel_left": left,
        "wheel_right": right,
        "motor": motor,
        "vehicle": along,
        "axle": right - left,
        "drive": motor / p.i_g - right,
        "contact_left": p.r0 * left - along,
        "contact_right": p.r0 * right - along,
    }[place]


def pushed(p: Traction, pushes: Sequence[Push], t: float, x: Array) -> Array:
    """Generalised forces (4,) of laws at places, for the states x (8,)."""
    total = np.zeros(4)
    for place, law in pushes:
        b = direction(p, place)
        total += b * law.force(t, float(b @ x[:4]), float(b @ x[4:]), ())
    return total


def motion(p: Traction, inputs: Inputs, pushes: Sequence[Push] = ()) -> Callable[[float, Array], Array]:
    """Right-hand side for the STATES, with laws that have no memory at places."""
    springs, dampers = p.shafts(p.k_s, p.k_g), p.shafts(p.c_s, p.c_g)

    def rates(t: float, x: Array) -> Array:
        u = inputs.at(t)
        at = contacts(p, x, u)
        brake = u["T_b"] * np.tanh(x[4:6] / BRAKE_ROUNDING)
        outside = np.array(
            [-at["r_left"] * at["F_x_left"] - brake[0], -at["r_right"] * at["F_x_right"] - brake[1], u["T_m"]]
        )
        more = pushed(p, pushes, t, x)
        spun = (outside + more[:3] - springs @ x[:3] - dampers @ x[4:7]) / p.inertia
        pull = at["F_x_left"] + at["F_x_right"] + u["F_x_ext"] + more[3]
        return np.array([x[4], x[5], x[6], x[7], *spun, pull / p.M_v])

    return rates


def rolling(p: Traction, V: float) -> Array:
    """State (8,) of free rolling at V [m/s], nothing twisted."""
    omega = V / p.r0
    return np.array([0.0, 0.0, 0.0, 0.0, omega, omega, p.i_g * omega, V])


def simulate(
    inputs: Inputs,
    p: Traction,
    start: Array,
    changes: Sequence[tuple[float, Traction]] = (),
    tolerance: float = 1e-9,
    pushes: Sequence[Push] = (),
) -> Array:
    """States (n, 8) at the times of the inputs; changes: times [s] and the parameters from then on.

    pushes: laws at places, see `direction`.

    Raises ValueError where the integration fails.
    """
    t = inputs.t
    edges = [0, *(int(np.searchsorted(t, when)) for when, _ in changes), len(t) - 1]
    rows, x = [start[None]], start
    for (first, last), now in zip(pairwise(edges), (p, *(q for _, q in changes)), strict=True):
        solution = solve_ivp(
            motion(now, inputs, pushes), (t[first], t[last]), x, method="LSODA",
            t_eval=t[first + 1 : last + 1], rtol=tolerance, atol=1e-2 * tolerance, max_step=1e-2,
        )  # fmt: skip
        if not solution.success:
            raise ValueError(f"inputs: integration stopped at {solution.t[-1]:g} s: {solution.message}")
        rows.append(solution.y.T)
        x = rows[-1][-1]
    return np.vstack(rows)


def outputs(p: Traction, x: Array, u: Mapping[str, float]) -> dict[str, float]:
    """What the product's FMU calls by these names, at a state (8,)."""
    at = contacts(p, x, u)
    twist, drive = x[1] - x[0], x[2] / p.i_g - x[1]
    T_s = p.k_s * twist + p.c_s * (x[5] - x[4])
    T_g = p.k_g * drive + p.c_g * (x[6] / p.i_g - x[5])
    torques = {"T_s": T_s, "T_g": T_g, "theta_s": twist, "theta_g": drive}
    speeds = {"omega_left": x[4], "omega_right": x[5], "omega_m": x[6], "V": x[7]}
    return {**at, **torques, **speeds, "F_x": at["F_x_left"] + at["F_x_right"]}
