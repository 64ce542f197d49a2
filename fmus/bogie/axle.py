"""One wheelset on its rails: where its wheels touch, what they carry, and the forces in both contacts.

The contact curves, creep laws and creep coefficients are those of the plan-view wheelset. Curves, wheel
loads that differ from side to side, and free rolling are added. Equations: README.md beside this file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import casadi as cs

from fmus.bogie import two_contacts
from fmus.contact.forces.coefficients import looked_up
from fmus.contact.forces.friction import friction_coefficient
from fmus.contact.forces.laws import selected_law
from fmus.variables import Expr
from fmus.wheelset.curves import FIELDS, NU, G, both_contacts
from fmus.wheelset.model import S_MIN, SIGN, V_MIN, patch_scale

if TYPE_CHECKING:
    from fmus.bogie.running_gear import RunningGear
    from fmus.wheelset.track import Track

LEAST_LOAD = 100.0  # N, that a wheel is taken to carry at least: its lift from the rail is not modelled
LEAST_NORMAL = 1.0  # N, for which the creep forces of a patch are worked out at least
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


class Patch(NamedTuple):
    """A contact of each wheel, columns of two: radius beyond the nominal one, m, angle, rad, semi-axes, m."""

    growth: Expr
    delta: Expr
    a: Expr
    b: Expr


class Touching(NamedTuple):
    """Where both wheels touch, in one patch or in tread and flange, and the roll that follows, rad, rad/s.

    springs: of tread and flange, their gaps, m, with the barrier, and approaches, m; empty for one patch.
    """

    patches: tuple[Patch, ...]
    phi: Expr
    phi_dot: Expr
    springs: tuple[Expr, ...] = ()


class Plane(NamedTuple):
    """Slope of the contact planes of both wheels over the track, columns of two: cosine and tangent."""

    angle: Expr

    @property
    def cos(self) -> Expr:
        """Of the slope."""
        return cs.cos(self.angle)

    @property
    def tan(self) -> Expr:
        """Of the slope."""
        return cs.tan(self.angle)


class Creep(NamedTuple):
    """Creep forces, N, spin moment, N.m, and creepages along and across of both wheels, columns of two."""

    F_x: Expr
    F_y: Expr
    M_z: Expr
    xi_x: Expr
    xi_y: Expr

    def scaled(self, share: Expr) -> Creep:
        """The same under another normal force, to which forces are proportional."""
        return self._replace(F_x=share * self.F_x, F_y=share * self.F_y, M_z=share * self.M_z)

    @property
    def dissipated(self) -> Expr:
        """Energy that the creepages dissipate by the way, N, without spin: T gamma."""
        return -(self.F_x * self.xi_x + self.F_y * self.xi_y)


class Contact(NamedTuple):
    """Forces of both wheels: columns of two, left and right, and what they sum up to on the wheelset.

    Y: guiding force on the rail, N, positive outwards; Q: wheel load, N; delta: contact angle, rad, of two
    contacts the mean by their loads; steepest: that of the steepest contact that carries; T_gamma: energy
    dissipated by the way, N, and of it that of contacts at the flange; F_y, M_z: lateral force, N, and yaw
    moment, N.m; M_y: moment about the axle, N.m.
    """

    Y: Expr
    Q: Expr
    delta: Expr
    steepest: Expr
    T_gamma: Expr
    T_gamma_flange: Expr
    F_y: Expr
    M_z: Expr
    M_y: Expr


def touching(m: RunningGear, at: Motion) -> Touching:
    """Contact of both wheels at their shifts towards their flanges; semi-axes under the tabulated load."""
    shifts = SIGN * (at.y - at.y_irr)
    curves = _curves(m, both_contacts, FIELDS, shifts)
    per_base = 1 / (2 * m.track.half_distance)
    lift, slope = curves["lift"], curves["lift_slope"]
    phi = (lift[0] - lift[1]) * per_base
    phi_dot = (slope[0] + slope[1]) * (at.y_dot - at.y_irr_dot) * per_base
    if m.contacts == 1:
        return Touching((_patch(m, curves),), phi, phi_dot)
    parts = _curves(m, two_contacts.both_parts, two_contacts.FIELDS, shifts)
    each = [{n: parts[f"{n}_{part}"] for n in two_contacts.OF_PART} for part in two_contacts.PARTS]
    springs = (*(p["gap"] for p in each), parts["barrier"], *(p["approach"] for p in each))
    return Touching(tuple(_patch(m, p) for p in each), phi, phi_dot, springs)


def _curves(
    m: RunningGear, of: Callable[[Track], cs.Function], fields: Sequence[str], shifts: Expr
) -> dict[str, Expr]:
    """Fields of both wheels by name, between those of new and of worn wheels."""
    new, worn = (m.call(of(track), m.contact_search, shifts)[0] for track in (m.track, m.worn))
    return dict(zip(fields, cs.horzsplit(new + m.wear * (worn - new)), strict=True))


def _patch(m: RunningGear, curves: Mapping[str, Expr]) -> Patch:
    a, b = (
        k * cs.if_else(m.patch > 0.5, curves[f"{which}_virtual"], curves[f"{which}_hertz"])
        for which, k in (("a", m.k_a), ("b", m.k_b))
    )
    return Patch(curves["growth"], curves["delta"], a, b)


def contact(m: RunningGear, at: Motion, touch: Touching, Q: Expr) -> Contact:
    """Forces of both wheels under the wheel loads Q, N, a column of two.

    Normal forces N and creep forces carry Q together: Q = sum of N cos(slope) ± F_y sin(slope). Creep forces
    are worked out for normal forces without the second term and then follow them in proportion.
    """
    Q = cs.fmax(Q, LEAST_LOAD)
    planes = [Plane(patch.delta + SIGN * touch.phi) for patch in touch.patches]
    forces, together = normal_forces(m, touch, planes, Q, [1.0] * len(planes))
    # parts that are one patch have its size
    first = [cs.fmax(N + together * (sum(forces) - N), LEAST_NORMAL) for N in forces]
    found = [creep(m, at, touch, *each) for each in zip(touch.patches, planes, first, strict=True)]
    carried = [
        cs.fmax(1 + SIGN * c.F_y / N * plane.tan, STEEPEST)
        for c, N, plane in zip(found, first, planes, strict=True)
    ]
    forces, _ = normal_forces(m, touch, planes, Q, carried)
    found = [c.scaled(N / before) for c, N, before in zip(found, forces, first, strict=True)]
    return summed(m, at, touch, planes, Q, forces, found)


def normal_forces(
    m: RunningGear, touch: Touching, planes: Sequence[Plane], Q: Expr, carried: Sequence[Expr]
) -> tuple[list[Expr], Expr]:
    """Normal forces, N, of each patch of both wheels, and how far these are one, 0 to 1.

    carried: vertical force over N cos(slope) of each.
    """
    if len(planes) == 1:
        return [Q / planes[0].cos / carried[0]], 0.0
    tread, flange, barrier, *approaches = touch.springs
    scale = m.G / (1 - m.nu) * ((1 - NU) / G)
    stiff = [
        share * two_contacts.stiffness(approach, plane.angle, scale)
        for share, approach, plane in zip(carried, approaches, planes, strict=True)
    ]
    *loads, together = m.call(two_contacts.load_division(), Q, tread, flange, barrier, *stiff)
    each = zip(loads, planes, carried, strict=True)
    return [load / plane.cos / share for load, plane, share in each], together


def summed(
    m: RunningGear, at: Motion, touch: Touching, planes: Sequence[Plane], Q: Expr, forces: Sequence[Expr],
    found: Sequence[Creep],
) -> Contact:  # fmt: skip
    """What the patches do to the wheelset: their forces in the track's axes, and their levers."""
    from fmus.contact.geometry.search import FLANGE_ANGLE  # loads SciPy, which other models do without

    Y = F_y = M_z = M_y = 0.0
    for patch, plane, N, c in zip(touch.patches, planes, forces, found, strict=True):
        r = m.r0 + patch.growth
        lateral = c.F_x * at.psi + c.F_y * plane.cos - SIGN * N * plane.cos * plane.tan
        forward = c.F_x - c.F_y / plane.cos * at.psi
        R_y = SIGN * m.s + r * touch.phi
        R_x = -R_y * at.psi + SIGN * r * plane.tan * at.psi  # a yawed wheel touches ahead where it is steep
        Y -= SIGN * lateral
        F_y += cs.sum1(lateral)
        M_z += cs.sum1(R_x * lateral - R_y * forward + c.M_z * plane.cos)
        M_y -= cs.sum1(r * c.F_x + SIGN * c.M_z * cs.sin(patch.delta))
    deltas = [patch.delta for patch in touch.patches]
    delta = steepest = deltas[0]
    if len(deltas) > 1:
        delta = sum(N * d for N, d in zip(forces, deltas, strict=True)) / sum(forces)
    for N, d in zip(forces[1:], deltas[1:], strict=True):
        steepest = cs.fmax(steepest, cs.if_else(N > LEAST_LOAD, d, 0.0))
    worn = [c.dissipated for c in found]
    at_flange = [cs.if_else(d > FLANGE_ANGLE, T, 0.0) for T, d in zip(worn, deltas, strict=True)]
    return Contact(Y, Q, delta, steepest, sum(worn), sum(at_flange), F_y, M_z, M_y)


def creep(m: RunningGear, at: Motion, touch: Touching, patch: Patch, plane: Plane, N: Expr) -> Creep:
    """Creep forces of a contact of both wheels under the normal forces N, a column of two.

    A wheel cannot leave its contact plane, so that its velocity across is longer than its lateral part.
    """
    V = cs.fmax(m.V, V_MIN)
    per_V = cs.if_else(m.V > V_MIN, 1 / V, 1 / V_MIN)
    rolls, turns = m.V * per_V, (at.psi_dot + m.V * at.kappa) * per_V
    r = m.r0 + patch.growth
    xi_x = -(rolls / m.r0) * patch.growth - r * (at.omega * per_V) - SIGN * m.s * turns
    xi_y = (at.y_dot * per_V + r * (touch.phi_dot * per_V) - rolls * at.psi) / plane.cos
    spun = (rolls / m.r0 + at.omega * per_V) * cs.sin(patch.delta)
    xi_s = turns * plane.cos - SIGN * spun
    size = patch_scale(N, m.G, m.nu)
    a, b = size * patch.a, size * patch.b
    mu = friction_coefficient(V * cs.sqrt(xi_x**2 + xi_y**2 + S_MIN**2), m.mu0, m.A, m.B)
    c11, c22, c23, c33 = m.call(looked_up(), a, b, m.nu)
    # the laws take one load for both wheels, and friction and load by their product only
    load = m.F_n
    forces = m.call(
        selected_law(),
        m.creep_law, a, b, load, mu * N / load, m.G, c11, c22, m.k_spin * c23, m.k_spin * c33,
        xi_x, xi_y, xi_s, m.k_A, m.k_S, *GIVEN,
    )  # fmt: skip
    F_x, F_y, M_z = forces
    return Creep(F_x, F_y, M_z, xi_x, xi_y)
