"""One wheelset on its rails: where its wheels touch, what they carry, and the forces in both contacts.

The contact curves, creep laws and creep coefficients are those of the plan-view wheelset. Curves, wheel
loads that differ from side to side, and free rolling are added. Equations: README.md beside this file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import casadi as cs

from fmus.contact.forces.coefficients import looked_up
from fmus.contact.forces.friction import friction_coefficient
from fmus.contact.forces.laws import selected_law
from fmus.variables import Expr
from fmus.wheelset.curves import FIELDS, both_contacts
from fmus.wheelset.model import S_MIN, SIGN, V_MIN, patch_scale

if TYPE_CHECKING:
    from fmus.bogie.running_gear import RunningGear

LEAST_LOAD = 100.0  # N, that a wheel is taken to carry at least: its lift from the rail is not modelled
STEEPEST = 0.25  # least share of the cosine of the contact angle by which a wheel load is carried
GIVEN = (0.0, 0.0, 0.0, 0.0)  # creep coefficients are Kalker's


@dataclass(frozen=True)
class Motion:
    """Motion of a wheelset along the track, SI; omega: rolling speed over V/r0, kappa: curvature."""

    y: Expr
    psi: Expr
    y_dot: Expr
    psi_dot: Expr
    omega: Expr
    y_irr: Expr
    y_irr_dot: Expr
    kappa: Expr


class Touching(NamedTuple):
    """Where both wheels touch, columns of two, and the roll that follows, rad, rad/s."""

    growth: Expr
    delta: Expr
    a: Expr
    b: Expr
    phi: Expr
    phi_dot: Expr


class Contact(NamedTuple):
    """Forces of both contacts: columns of two, left and right, and what they sum up to on the wheelset.

    Y: guiding force on the rail, N, positive outwards; Q: wheel load, N; F_y, M_z: lateral force, N, and yaw
    moment, N.m; M_y: moment about the axle, N.m.
    """

    Y: Expr
    Q: Expr
    delta: Expr
    F_y: Expr
    M_z: Expr
    M_y: Expr


def touching(m: RunningGear, at: Motion) -> Touching:
    """Contact of both wheels at their shifts towards their flanges; semi-axes under the tabulated load."""
    shifts = SIGN * (at.y - at.y_irr)
    new, worn = (m.call(both_contacts(track), m.contact_search, shifts)[0] for track in (m.track, m.worn))
    curves = dict(zip(FIELDS, cs.horzsplit(new + m.wear * (worn - new)), strict=True))
    a, b = (
        k * cs.if_else(m.patch > 0.5, curves[f"{which}_virtual"], curves[f"{which}_hertz"])
        for which, k in (("a", m.k_a), ("b", m.k_b))
    )
    per_base = 1 / (2 * m.track.half_distance)
    lift, slope = curves["lift"], curves["lift_slope"]
    phi = (lift[0] - lift[1]) * per_base
    phi_dot = (slope[0] + slope[1]) * (at.y_dot - at.y_irr_dot) * per_base
    return Touching(curves["growth"], curves["delta"], a, b, phi, phi_dot)


def contact(m: RunningGear, at: Motion, touch: Touching, Q: Expr) -> Contact:
    """Forces of both contacts under the wheel loads Q, N, a column of two.

    Normal force N and creep force carry Q together: Q = N cos(slope) ± F_y sin(slope). Creep forces are
    worked out for N without the second term and then follow N in proportion.
    """
    slope = touch.delta + SIGN * touch.phi  # of the contact planes over the track
    Q = cs.fmax(Q, LEAST_LOAD)
    first = Q / cs.cos(slope)
    F_x, F_y, M_z = creep(m, at, touch, first)
    carried = cs.fmax(1 + SIGN * F_y / first * cs.tan(slope), STEEPEST)
    N = first / carried
    F_x, F_y, M_z = F_x / carried, F_y / carried, M_z / carried
    r = m.r0 + touch.growth
    across = F_y * cs.cos(slope)
    forward = F_x - across * at.psi
    lateral = F_x * at.psi + across - SIGN * N * cs.sin(slope)
    R_y = SIGN * m.s + r * touch.phi
    R_x = -R_y * at.psi
    M = R_x * lateral - R_y * forward + M_z * cs.cos(slope)
    return Contact(-SIGN * lateral, Q, touch.delta, cs.sum1(lateral), cs.sum1(M), -cs.sum1(r * F_x))


def creep(m: RunningGear, at: Motion, touch: Touching, N: Expr) -> tuple[Expr, Expr, Expr]:
    """Creep forces, N, and spin moments, N.m, of both wheels under the normal forces N, a column of two."""
    V = cs.fmax(m.V, V_MIN)
    per_V = cs.if_else(m.V > V_MIN, 1 / V, 1 / V_MIN)
    rolls, turns = m.V * per_V, (at.psi_dot + m.V * at.kappa) * per_V
    r = m.r0 + touch.growth
    xi_x = -(rolls / m.r0) * touch.growth - r * (at.omega * per_V) - SIGN * m.s * turns
    xi_y = at.y_dot * per_V + r * (touch.phi_dot * per_V) - rolls * at.psi
    xi_s = turns - SIGN * (rolls / m.r0 + at.omega * per_V) * touch.delta
    size = patch_scale(N, m.G, m.nu)
    a, b = size * touch.a, size * touch.b
    mu = friction_coefficient(V * cs.sqrt(xi_x**2 + xi_y**2 + S_MIN**2), m.mu0, m.A, m.B)
    c11, c22, c23, c33 = m.call(looked_up(), a, b, m.nu)
    # the laws take one load for both wheels, and friction and load by their product only
    load = m.F_n
    return tuple(
        m.call(
            selected_law(),
            m.creep_law, a, b, load, mu * N / load, m.G, c11, c22, m.k_spin * c23, m.k_spin * c33,
            xi_x, xi_y, xi_s, m.k_A, m.k_S, *GIVEN,
        )
    )  # fmt: skip
