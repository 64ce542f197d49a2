"""Tread and flange of a wheel as two contacts: division of the load, steadiness, balances, energy."""

from functools import cache

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from fmus.bogie import axle
from fmus.bogie.model import Bogie
from fmus.bogie.two_contacts import load_division
from fmus.contact.geometry.nearest import WheelGrid
from fmus.contact.geometry.search import stand
from fmus.contact.geometry.sides import sides_of
from fmus.contact.normal import hertz
from fmus.errors import BadInput
from fmus.vehiclelateral.model import VehicleLateral
from fmus.wheelset.model import SIGN
from tests.helpers.evaluated import Evaluated

G, E, NU = 9.81, 2 * 8e10 * 1.28, 0.28
APART = {"wheel": "EN15302_WheelH", "rail": "EN15302_RailA", "cant": 0.0}  # tread and flange, with a wide gap
NEAR = {"wheel": "EN15302_WheelH"}  # the same wheel on 60E1, with half of that gap
PAIRS = {"apart": APART, "near": NEAR, "in one": {}}
SLOW = pytest.param("near", marks=pytest.mark.slow)  # tables of its own, between those of the others
LOADS = ("Y_1_right", "Q_1_right", "T_gamma_1_right")


@cache
def bogie(pair, contacts=2):
    return Evaluated(Bogie(contacts=contacts, **PAIRS[pair]))


def at(pair, y, contacts=2, **more):
    """Outputs of a bogie in a curve of 600 m whose leading wheelset is shifted by -y, to the right rail."""
    in_curve = {"V": 20.0, "kappa_1": 1 / 600, "kappa_2": 1 / 600, "psi_1": -2e-3}
    return bogie(pair, contacts).outputs(**in_curve, **more, y_1=-y)


part = st.floats(0.0, 3e-4)


@settings(max_examples=200)
@given(st.floats(1e3, 1e5), part, part, part, st.floats(0.1, 3.0), st.floats(0.05, 3.0))
def test_the_load_is_divided_at_the_height_where_both_carry_it(Q, tread, flange, above, c_t, c_f):
    """Against the root of the same springs by bisection."""
    c_t, c_f, barrier = c_t * 2e10, c_f * 2e10, max(tread, flange) + above
    deep = barrier - np.array([tread, flange])
    share = (deep + 1e-12) / (deep + 1e-12).sum()

    def carried(height):
        joined = max(height - barrier, 0.0) ** 1.5
        own = np.maximum(height - np.array([tread, flange]), 0.0) ** 1.5
        return np.array([c_t, c_f]) * (own - (1 - share) * joined)

    height = brentq(lambda h: carried(h).sum() - Q, 0.0, 1.0, xtol=1e-16)
    found = load_division()(*(np.full(2, x) for x in (Q, tread, flange, barrier, c_t, c_f)))
    got = np.array([float(x[0]) for x in found[:2]])
    assert got.sum() == pytest.approx(Q, rel=1e-7)
    assert_allclose(got, carried(height), rtol=1e-4, atol=1e-4 * Q)


@pytest.mark.parametrize("pair", ["apart", SLOW, "in one"])
@pytest.mark.parametrize("y", [-3e-3, 0.0, 2e-3, 4e-3, 5e-3])
def test_away_from_the_flange_both_forms_agree(pair, y):
    one, two = at(pair, y, 1), at(pair, y, 2)
    for name in LOADS:
        assert two[name] == pytest.approx(one[name], rel=1e-6, abs=1e-3), name


@pytest.mark.parametrize("y", [6.0e-3, 6.2e-3, 6.6e-3, 7.5e-3])
def test_what_no_gap_parts_is_one_contact(y):
    """S1002 runs from its tread to its flank without a gap, so that both forms agree on the way."""
    one, two = at("in one", y, 1), at("in one", y, 2)
    for name in LOADS:
        assert two[name] == pytest.approx(one[name], rel=0.02), name


@pytest.mark.parametrize("pair", ["apart", SLOW, "in one"])
def test_forces_change_steadily_on_the_way_to_the_flange(pair):
    """In steps of 1 um no force makes a jump, only as much as a steep flank asks for."""
    way = np.arange(5.6e-3, 7.0e-3, 1e-6)
    found = [at(pair, y) for y in way]
    for name, most in (("Y_1_right", 0.02), ("Q_1_right", 0.01), ("T_gamma_1_right", 0.02)):
        values = np.array([o[name] for o in found])
        assert np.abs(np.diff(values)).max() < most * np.ptp(values), name


@pytest.mark.parametrize("pair", ["apart", SLOW])
def test_both_parts_carry_where_their_distances_are_near(pair):
    way = np.arange(5.6e-3, 7.0e-3, 1e-5)
    share = [o["T_gamma_flange_1_right"] / o["T_gamma_1_right"] for o in (at(pair, y) for y in way)]
    assert share[0] == pytest.approx(0.0, abs=1e-3)
    assert share[-1] == pytest.approx(1.0, abs=1e-3)
    assert sum(0.02 < s < 0.98 for s in share) > 2
    assert np.diff(share).min() > -0.02


@pytest.mark.parametrize("pair", ["apart", SLOW])
def test_loads_are_those_of_two_ellipses_found_by_looking_at_every_place(pair):
    """Hertz's springs at the nearest places of tread and flange, with curvatures over 1 mm there."""
    given = {"wheel": "S1002", "rail": "60E1", "cant": 1 / 40} | PAIRS[pair]
    sides = sides_of(**given, gauge=1.435, r0=0.46, back_to_back=1.36)
    grid = WheelGrid.of(sides.left)
    from fmus.bogie.two_contacts import FIELDS, both_parts, stiffness
    from fmus.wheelset.track import Track

    track, tried = Track(**PAIRS[pair]), 0
    for q in np.arange(5.6e-3, 7.0e-3, 2e-5):
        fields = dict(zip(FIELDS, both_parts(track)(1, np.full(2, q))[0, :].full()[0], strict=True))
        standing = stand(sides, np.array([q]))
        gap = grid.gaps(standing.y, standing.phi)[0] - standing.left.gap[0]
        steep = (np.arctan(grid.pair.wheel.slope(grid.eta)) > 0.5) & (grid.eta > grid.tip) & (grid.eta < 0)
        border = grid.eta[steep].max()
        spots = [np.argmin(np.where(side, gap, np.inf)) for side in (grid.eta >= border, steep)]
        if gap[spots].max() > 4e-5 or gap[spots[1] : spots[0]].max() < 6e-5:
            continue
        stiff, phi = [], float(standing.phi[0])
        for k in spots:
            slope = np.arctan(grid.pair.wheel.slope(grid.eta[k]))
            near = slice(k - 5, k + 6)
            bend = np.mean(grid.curvature[near]) - np.mean(
                grid.rail_curvature(np.arange(k - 5, k + 6), np.full(11, q), np.full(11, phi))
            )
            r = 0.46 - grid.z[k]
            approach = hertz(np.cos(slope) / (2 * r), max(bend / 2, 0.05), 55e3, E, NU)[2]
            stiff.append(float(stiffness(approach, slope + phi, 1.0)))
        ours = [
            stiffness(fields[f"approach_{p}"], fields[f"delta_{p}"] + phi, 1.0) for p in ("tread", "flange")
        ]
        gaps = [fields["gap_tread"], fields["gap_flange"], fields["barrier"]]
        by_hand = [*gap[spots], gap[spots[1] : spots[0]].max()]
        found, other = (
            np.array(
                [float(x[0]) for x in load_division()(*(np.full(2, float(v)) for v in (6e4, *g, *c)))[:2]]
            )
            for g, c in ((gaps, ours), (by_hand, stiff))
        )
        assert np.abs(found - other).max() < 0.08 * 6e4, q
        tried += 1
    assert tried > 1


@cache
def curving(pair, cant):
    """Equilibrium in a curve of 600 m, begun at the flange."""
    built = bogie(pair)
    both = {f"{name}_{i}": v for name, v in (("kappa", 1 / 600), ("cant", cant)) for i in (1, 2)}
    said = {"V": 10.0, **both}
    at_flange = {"y_1": -6.2e-3, "y_2": 2e-3, "psi_1": -2e-3}
    x = built.equilibrium(**said, **at_flange)
    return said, x, built.outputs(**{**said, **x})


@pytest.mark.parametrize("cant", [0.0, pytest.param(0.08, marks=pytest.mark.slow)])
def test_a_flange_that_carries_balances_a_curve(cant):
    said, _, o = curving("apart", cant)
    assert o["flange_contact"] == 1.0
    assert 0.0 < o["T_gamma_flange_1_right"] < o["T_gamma_1_right"]
    V, kappa = said["V"], said["kappa_1"]
    across = V**2 * kappa * np.cos(cant) - G * np.sin(cant)
    down = G * np.cos(cant) + V**2 * kappa * np.sin(cant)
    F_Y = sum(o[f"Y_{i}_right"] - o[f"Y_{i}_left"] for i in (1, 2))
    assert pytest.approx((2615 + 2 * 1813) * across + o["F_y_c"], rel=1e-6, abs=1e-2) == F_Y
    Q = sum(o[f"Q_{i}_{side}"] for i in (1, 2) for side in ("left", "right"))
    assert pytest.approx((32000 / 2 + 2615 + 2 * 1813) * down, rel=1e-9) == Q


@pytest.mark.parametrize("contacts", [1, 2])
@pytest.mark.parametrize("y", [0.0, 5e-3, 6.26e-3, 6.6e-3, 7.5e-3])
@pytest.mark.parametrize(
    ("psi", "y_dot", "psi_dot", "omega"),
    [(0.0, 0.02, 0.0, 0.0), (4e-3, 0.0, 0.0, 0.1), (-5e-3, -0.01, 0.02, -0.2), (2e-3, 0.05, -0.03, 0.0)],
)
def test_forces_take_the_power_that_creepages_dissipate(contacts, y, psi, y_dot, psi_dot, omega):
    """Of both contacts on all motions of a wheelset, also on a flank of 70 degrees; 4 %."""
    power, dissipated, size = energies(contacts)([y, psi, y_dot, psi_dot, omega])
    assert float(power) == pytest.approx(-float(dissipated), abs=0.04 * float(size))


@cache
def energies(contacts):
    """Function of a motion -> power of the forces of contact, W, what creepages dissipate, and its size."""
    m = bogie("apart", contacts).model
    x = cs.SX.sym("x", 5)
    V = m.free_symbols["V"]
    motion = axle.Motion(-x[0], x[1], x[2], x[3], x[4], 0.0, 0.0, 0.0)
    touch = axle.touching(m, motion)
    planes = [axle.Plane(p.delta + SIGN * touch.phi) for p in touch.patches]
    N = cs.DM([6e4, 5e4])
    forces, _ = axle.normal_forces(m, touch, planes, N, [1.0] * len(planes))
    forces = [cs.fmax(f, 1.0) for f in forces]
    found = [axle.creep(m, motion, touch, *each) for each in zip(touch.patches, planes, forces, strict=True)]
    Q = sum(f * p.cos + SIGN * c.F_y * p.cos * p.tan for f, p, c in zip(forces, planes, found, strict=True))
    total = axle.summed(m, motion, touch, planes, Q, forces, found)
    Omega = V / m.r0 + x[4]
    power, dissipated, size = total.M_z * x[3] + total.M_y * Omega, 0.0, 0.0
    for patch, plane, f, c in zip(touch.patches, planes, forces, found, strict=True):
        r = m.r0 + patch.growth
        lateral = c.F_x * x[1] + c.F_y * plane.cos - SIGN * f * plane.cos * plane.tan
        vertical = f * plane.cos + SIGN * c.F_y * plane.cos * plane.tan
        speed = x[2] + r * touch.phi_dot
        power += cs.sum1((c.F_x - c.F_y * x[1] / plane.cos) * V + lateral * speed)
        power += cs.sum1(vertical * SIGN * plane.tan * speed)
        spin = x[3] * plane.cos - SIGN * Omega * cs.sin(patch.delta)
        each = [c.F_x * c.xi_x * V, c.F_y * c.xi_y * V, c.M_z * spin]
        dissipated -= cs.sum1(sum(each))
        size += cs.sum1(sum(cs.fabs(e) for e in each))
    free = cs.Function("free", [*m.free_symbols.values(), x], [power, dissipated, size])
    starts = [float(m.variables[name].start or 0.0) for name in m.free_symbols]
    return lambda motion: free.call([*starts, motion])


def test_the_vehicle_has_two_contacts_too():
    built = Evaluated(VehicleLateral(contacts=2, **APART))
    o = built.outputs(V=20.0, y_3=-6.6e-3)
    assert o["T_gamma_flange_3_right"] > 0.0
    assert o["flange_contact"] == 1.0


@pytest.mark.parametrize("contacts", [0, 3, "1.5", "two"])
def test_another_number_of_contacts_is_refused(contacts):
    with pytest.raises(BadInput, match="contacts"):
        Bogie(contacts=contacts)
