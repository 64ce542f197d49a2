"""The contact table: rolling radii, contact angles, roll and patches of a wheelset over its lateral shift."""

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from fmus.contact.arguments import (
    Array,
    between,
    checked,
)
from fmus.contact.cache import Arrays, remembered
from fmus.contact.geometry.pair import Pair, Sides
from fmus.contact.geometry.search import (
    FLANGE_ANGLE,
    Contact,
    check_touches,
    quasi_elastic_contact,
    rigid_contact,
    stand,
)
from fmus.contact.geometry.sides import Both, Given, number, said, sides_of
from fmus.contact.normal import hertz, virtual_penetration
from fmus.errors import BadInput, did_you_mean

G, NU = 8e10, 0.28  # Pa, 1; steel (thesis Table 3.4, Kalker 1990)
YOUNG = 2 * G * (1 + NU)  # Pa
SHIFTS = 401  # of the table by default
UPRIGHT_SHIFTS = 1001  # without roll: the conicity beside a jump depends on how near it is resolved
REACH = 0.010  # m, half its range by default, and at least
BEYOND_FLANGE = 0.003  # m, how much further than flange contact the table goes
B_MIN = 0.05  # 1/m, least lateral curvature of a patch: surfaces of 10 m radius, flat for a rail of 0.07 m
SEARCHES = ("rigid", "quasi_elastic")
PATCHES = ("hertz", "virtual_penetration")
# fmt: off
COLUMNS = (
    "r_left", "r_right", "delta_left", "delta_right", "phi", "a_left", "b_left", "a_right", "b_right",
    "z", "eta_left", "eta_right", "A_left", "B_left", "A_right", "B_right",
)
# fmt: on


def contact_table(
    wheel: Both[Given] = "S1002",
    rail: Both[Given] = "60E1",
    cant: float = 1 / 40,
    gauge: float = 1.435,
    r0: Both[float] = 0.46,
    N: float = 55e3,
    search: str = "quasi_elastic",
    patch: str = "hertz",
    *,
    back_to_back: float = 1.36,
    shifts: ArrayLike | None = None,
    E: float = YOUNG,
    nu: float = NU,
    smoothing: float | None = None,
    roll: bool = True,
) -> pd.DataFrame:
    """Contact of both wheels over the wheelset's lateral shift, indexed by `y`, m, positive to the left.

    wheel, rail: names of exact profiles, paths of point files (see measured.py), or profiles; cant:
    inward inclination of the rails as a slope; gauge: m, 14 mm below the crown; r0: wheel radius at the
    tape circle, m; wheel, rail and r0 may each be a pair (left, right). N: normal force in each contact,
    N; search: "rigid" or "quasi_elastic"; patch: "hertz" or "virtual_penetration"; back_to_back: m
    between the flange backs; shifts: (n,) m, increasing, by default 401 (without roll 1001) over 10 mm to
    both sides or 3 mm beyond flange contact; E, Pa, and nu of both bodies; smoothing: rms, m, that is
    taken for noise in point files, by default found from the data; roll: whether the wheelset rolls until
    both wheels touch, or each wheel is lowered upright onto its own rail, as EN 15302 does.

    Columns, per wheel `_left` and `_right`: r rolling radius, m; delta contact angle, rad, positive where
    the radius grows towards the flange; phi roll, rad, positive with the left wheel up; a, b semi-axes
    along and across rolling, m; then z lift of the wheelset's centre, m, 0 when centred (without roll the
    mean lift of both wheels); eta place on the wheel from the tape circle, m, positive to the field side; A,
    B curvature sums of the patch, 1/m, where the surfaces part by A x² + B y²; B is at least 0.05. `attrs`
    tells what the table was made with.
    BadInput, a ValueError, names an argument that is wrong, or a file and its line.
    """
    for name, value, known in (("search", search, SEARCHES), ("patch", patch, PATCHES)):
        if value not in known:
            raise BadInput(f"{name} = {value!r} is not known; {did_you_mean(str(value), known)}")
    cant, N, E = (
        number("cant", "1", cant),
        number("N", "N", N, positive=True),
        number("E", "Pa", E, positive=True),
    )
    nu = float(checked("nu", "1", nu, between(0, 0.5)))
    sides = sides_of(wheel, rail, cant, gauge, r0, back_to_back, smoothing)
    given = None if shifts is None else _shifts(shifts)
    settings = (roll, search, patch, N, E, nu)
    content = ("table", pair_content(sides.left), pair_content(sides.right), given, settings)
    made = remembered(content, lambda: _columns(sides, given, *settings))
    table = pd.DataFrame({name: made[name] for name in COLUMNS}, index=pd.Index(made["y"], name="y"))
    left, right = sides.left, sides.right
    table.attrs = {
        "wheel": said(left.wheel.name, right.wheel.name), "rail": said(left.rail.name, right.rail.name),
        "wheel_found": said(left.wheel.found, right.wheel.found),
        "rail_found": said(left.rail.found, right.rail.found), "r0": said(left.r0, right.r0),
        "cant": cant, "gauge": left.gauge, "back_to_back": left.back_to_back, "roll": roll,
        "N": N, "search": search, "patch": patch, "E": E, "nu": nu,
    }  # fmt: skip
    return table


def pair_content(pair: Pair) -> tuple[object, ...]:
    """All that a pair is made of, for a hash."""
    return pair.wheel, pair.rail, pair.cant, pair.gauge, pair.r0, pair.back_to_back


def default_shifts(pair: Pair | Sides, roll: bool = True) -> Array:
    """Shifts, m, of 10 mm to both sides, or 3 mm beyond flange contact where that is further away.

    401 with roll, and 1001 without, because the conicity by EN 15302 depends on how near a jump is resolved.
    """
    sides = Sides.of(pair)
    probe = np.arange(0.0, 2.5 * REACH, REACH / 20)
    reach, end = REACH, np.inf
    for side, (one, sign) in list(sides.named.items())[: 1 if sides.alike else 2]:
        standing = stand(sides, sign * probe, roll)
        angle = np.arctan(one.wheel.slope(getattr(standing, side).eta))
        touches = np.flatnonzero(standing.rests & (angle > FLANGE_ANGLE))
        if touches.size:
            reach = max(reach, float(probe[touches[0]]) + BEYOND_FLANGE)
        if not standing.rests.all():
            end = min(end, float(probe[np.argmin(standing.rests)]))
    if end <= reach:
        reach = end - REACH / 20
    return np.linspace(-reach, reach, SHIFTS if roll else UPRIGHT_SHIFTS)


def _columns(sides: Sides, given: Array | None, roll: bool, search: str, patch: str, *load: float) -> Arrays:
    """The columns of the table by name, with the shifts `y`."""
    check_touches(sides, roll)
    y = default_shifts(sides, roll) if given is None else given
    # the shift 0 rides along for the lift that counts as none
    standing = stand(sides, np.append(y, 0.0), roll)
    if not standing.rests.all():
        far = standing.y[np.argmin(standing.rests)]
        raise BadInput(
            f"shifts: at {far:g} m a wheel is at the end of its profile or rail; take smaller ones"
        )
    made = {"y": y, "phi": standing.phi[:-1], "z": (standing.lift - standing.lift[-1])[:-1]}
    for side, (pair, sign) in sides.named.items():
        touch = getattr(standing, side)
        if search == "rigid":
            contact = rigid_contact(pair, touch)
        else:
            contact = quasi_elastic_contact(pair, sign * standing.y, sign * standing.phi, touch)
        wheel = _wheel(pair, contact, patch, *load)
        made |= {f"{name}_{side}": values[:-1] for name, values in wheel.items()}
    return made


def _wheel(pair: Pair, contact: Contact, patch: str, N: float, E: float, nu: float) -> dict[str, Array]:
    """What the table tells of one wheel."""
    r, delta, A, B = curvature_sums(pair, contact)
    a, b, approach, _ = hertz(A, B, N, E, nu)
    if patch == "virtual_penetration":
        a, b = virtual_penetration(A, B, approach)
    named = {"r": r, "delta": delta, "a": a, "b": b, "eta": contact.eta, "A": A, "B": B}
    return {name: np.asarray(values) for name, values in named.items()}


def curvature_sums(pair: Pair, contact: Contact) -> tuple[Array, Array, Array, Array]:
    """Rolling radius r, m, contact angle delta, rad, and curvature sums A and B, 1/m, of a contact (n,)."""
    r = pair.r0 - pair.wheel.height(contact.eta)
    delta = np.arctan(pair.wheel.slope(contact.eta))
    A = np.cos(delta) / (2 * r)
    B = np.maximum((contact.kappa_wheel - contact.kappa_rail) / 2, B_MIN)
    return r, delta, A, B


def _shifts(shifts: ArrayLike) -> Array:
    y = np.atleast_1d(checked("shifts", "m", shifts))
    if y.ndim != 1 or not y.size or not (np.diff(y) > 0).all():
        raise BadInput("shifts must be one row of increasing numbers [m]")
    return y
