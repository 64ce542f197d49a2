"""Truth model of the tram wheel test rig, independent of the product: numpy, scipy and numba only.

Differs in form from the product's model: c11 interpolated here, inputs linear between
samples, slip smoothed at standstill in its own way, an adaptive stiff integrator.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan, copysign, exp, hypot, pi

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from tests.truth.laws import Crack, ImpactTrain
from tests.truth.more import At, acting, changed
from tests.truth.passing import NOT_CHANGED, arrived
from tests.truth.rig_effects import NOTHING, Effects
from tests.truth.rig_inputs import Array, Inputs

STANDSTILL = 0.01  # m/s, below it the reference speed of the creepage no longer falls
C11_CIRCLE = (3.40, 4.12, 5.20)  # Kalker 1990, a/b = 1, at nu = 0, 0.25, 0.5


@dataclass(frozen=True)
class Rig:
    """Parameters of the rig, SI; defaults as declared for the measured records."""

    J_w: float = 17.86  # kg.m2, wheel side
    J_r: float = 47.2  # kg.m2, roller side
    r_w: float = 0.3482  # m
    r_r: float = 0.45215  # m
    N: float = 8000.0  # N, wheel load
    a: float = 0.0027  # m, contact semi-axis along rolling
    b: float = 0.0027  # m, lateral
    mu0: float = 0.4
    A: float = 0.4
    B: float = 0.6  # s/m
    k_A: float = 1.0
    k_S: float = 0.4
    V_Th: float = 212.3438  # V at f_nom
    R_Th: float = 0.0226  # ohm
    X_Th: float = 0.2007  # ohm at f_nom
    X_2: float = 0.301  # ohm at f_nom
    R_2: float = 0.0181  # ohm
    pole_pairs: int = 5
    f_nom: float = 50.0  # Hz
    G: float = 8e10  # Pa
    nu: float = 0.28


DECLARED = Rig()


def c11_circular(nu: float) -> float:
    """Kalker's longitudinal coefficient for a circular patch: parabola through three values of nu."""
    low, middle, high = C11_CIRCLE
    u = nu / 0.25
    return low + u * (middle - low) + u * (u - 1) / 2 * (high - 2 * middle + low)


def creep_force(p: Rig, V_r: float, V_w: float, mu0: float) -> float:
    """Longitudinal force F_x [N] on the wheel by Polach without spin; rim speeds V_r, V_w in m/s.

    mu0: friction at vanishing slip. The force opposes the slip V_r - V_w.
    """
    slip = V_r - V_w
    mu = mu0 * (p.A + (1 - p.A) * exp(-p.B * abs(slip)))
    creepage = abs(slip) / hypot(V_r, STANDSTILL)
    eps = p.G * pi * p.a * p.b * c11_circular(p.nu) * creepage / (4 * p.N * mu)
    adhesion_part = p.k_A * eps / (1 + (p.k_A * eps) ** 2)
    return copysign(2 * p.N * mu / pi * (adhesion_part + atan(p.k_S * eps)), -slip)


def motor_torque(p: Rig, f: float, omega_r: float) -> float:
    """Torque [N.m] of the asynchronous motor at supply frequency f [Hz], constant V/f, speed in rad/s.

    The Thevenin formula multiplied out by the slip, so that f = 0 needs no exception.
    """
    k = f / p.f_nom
    nominal = 2 * pi * p.f_nom / p.pole_pairs  # rad/s, synchronous at f_nom
    lag = k - omega_r / nominal  # slip times k
    impedance = (p.R_Th * lag + p.R_2 * k) ** 2 + (k * lag * (p.X_Th + p.X_2)) ** 2
    return 3 / nominal * p.V_Th**2 * p.R_2 * lag * k**2 / (impedance + 1e-24)


def held_linear(t: Array, values: Array) -> Callable[[float], float]:
    """Piecewise linear function through the samples, constant outside them."""
    times: list[float] = t.tolist()
    levels: list[float] = values.tolist()

    def at(now: float) -> float:
        i = bisect_right(times, now)
        if i == 0 or i == len(times):
            return levels[max(i - 1, 0)]
        part = (now - times[i - 1]) / (times[i] - times[i - 1])
        return levels[i - 1] + part * (levels[i] - levels[i - 1])

    return at


def places(location: str) -> tuple[str, ...]:
    """Places of a location: itself; ValueError where it is none of the rig's."""
    if location not in ("wheel", "roller", "contact"):
        raise ValueError(f"location {location!r} is not one of wheel, roller, contact")
    return (location,)


def motion_at(p: Rig, omega_w: float, omega_r: float, theta_w: float = 0.0, theta_r: float = 0.0) -> At:
    """Displacement and velocity at each place; at the contact, way and speed of slip of the wheel's rim."""
    known = {
        "wheel": (theta_w, omega_w),
        "roller": (theta_r, omega_r),
        "contact": (p.r_w * theta_w - p.r_r * theta_r, p.r_w * omega_w - p.r_r * omega_r),
    }
    return known.__getitem__


def passed(inputs: Inputs, e: Effects) -> Inputs:
    """What arrives of the inputs."""
    how = e.more.inputs
    T_P, f_sync = (
        arrived(inputs.t, u, how.get(name, NOT_CHANGED))
        for name, u in (("T_P", inputs.T_P), ("f_sync", inputs.f_sync))
    )
    return Inputs(inputs.t, T_P, f_sync)


def motion(inputs: Inputs, declared: Rig, e: Effects) -> Callable[[float, Array], list[float]]:
    """Right-hand side for x = omega_w, omega_r [rad/s], theta_w, theta_r [rad], motor torque, memory."""
    here = passed(inputs, e)
    request, supply = held_linear(here.t, here.T_P), held_linear(here.t, here.f_sync)
    lag, delay = e.actuator.lag, e.actuator.delay
    changes, extra = e.more.changes, acting(e.more, places)

    def rates(t: float, x: Array) -> list[float]:
        omega_w, omega_r, theta_w, theta_r, given, *z = x.tolist()
        p = changed(declared, changes, t)
        T_P = e.actuator.asked(request(t - delay))
        T_P_dot = 0.0
        if lag > 0:
            T_P, T_P_dot = given, (T_P - given) / lag
        mu0 = p.mu0 + (e.mu0_step if t >= e.mu0_step_time else 0.0)
        F_x = creep_force(p, omega_r * p.r_r, omega_w * p.r_w, mu0)
        T_w = -T_P - F_x * p.r_w + e.wheel.total(t, theta_w, omega_w)
        T_r = motor_torque(p, supply(t), omega_r) + F_x * p.r_r + e.roller.total(t, theta_r, omega_r)
        at = motion_at(p, omega_w, omega_r, theta_w, theta_r)
        for place, force in extra.forces(t, at, z):
            T_w += force * {"wheel": 1.0, "contact": p.r_w}.get(place, 0.0)
            T_r += force * {"roller": 1.0, "contact": -p.r_r}.get(place, 0.0)
        own = [T_w / p.J_w, T_r / p.J_r, omega_w, omega_r, T_P_dot]
        return own + extra.rates(t, at, z)

    return rates


def steady_state(
    inputs: Inputs, parameters: Rig = DECLARED, effects: Effects = NOTHING
) -> tuple[float, float]:
    """Speeds omega_w, omega_r [rad/s] at which nothing accelerates at the first sample, angles zero.

    Raises ValueError where there is no such speed.
    """
    p, t0 = parameters, float(inputs.t[0])
    given = effects.actuator.asked(float(inputs.T_P[0]))

    rates, extra = motion(inputs, p, effects), acting(effects.more, places)

    def accelerations(z: Array) -> list[float]:
        omega_r, creepage = z[0], z[1] * 1e-4
        omega_w = omega_r * p.r_r / p.r_w * (1 - creepage)
        memory = extra.rest(motion_at(p, omega_w, omega_r))
        return rates(t0, np.array([omega_w, omega_r, 0.0, 0.0, given, *memory]))[:2]

    synchronous = 2 * pi * float(inputs.f_sync[0]) / p.pole_pairs
    found = root(accelerations, [synchronous, 0.0], tol=1e-12)
    if max(abs(value) for value in accelerations(found.x)) > 1e-6:
        raise ValueError(f"inputs: no steady state at t = {t0:g} s ({found.message})")
    omega_r = float(found.x[0])
    return omega_r * p.r_r / p.r_w * (1 - 1e-4 * float(found.x[1])), omega_r


def simulate(
    inputs: Inputs,
    parameters: Rig = DECLARED,
    effects: Effects = NOTHING,
    x0: Sequence[float] | None = None,
) -> tuple[Array, Array]:
    """True speeds omega_w, omega_r [rad/s], each (n,), at inputs.t; sensor faults are not in them.

    x0: omega_w, omega_r [rad/s] at the first sample; the steady state there if not given.
    Raises ValueError where the integration fails.
    """
    speeds = steady_state(inputs, parameters, effects) if x0 is None else x0
    given = effects.actuator.asked(float(inputs.T_P[0]))
    span = (float(inputs.t[0]), float(inputs.t[-1]))
    hit = [e.impact_width / 4 for e in (effects.wheel, effects.roller) if e.impact]
    hit += [law.width / 4 for _, law in effects.more.laws if isinstance(law, ImpactTrain)]
    hit += [law.width / 40 for _, law in effects.more.laws if isinstance(law, Crack)]  # at 40 rad/s
    memory = acting(effects.more, places).rest(motion_at(parameters, speeds[0], speeds[1]))
    solution = solve_ivp(
        motion(inputs, parameters, effects),
        span,
        np.array([*speeds, 0.0, 0.0, given, *memory]),
        method="LSODA",
        t_eval=np.clip(inputs.t, *span),
        rtol=1e-8,
        atol=1e-8,
        max_step=min([0.05, *hit]),  # no pulse of the inputs is stepped over
    )
    if not solution.success:
        raise ValueError(f"inputs: integration stopped at {solution.t[-1]:g} s: {solution.message}")
    return solution.y[0], solution.y[1]
