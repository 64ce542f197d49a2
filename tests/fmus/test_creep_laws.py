"""Creep laws: laws of physics, the linear limit, derivatives, and what creep_forces takes and refuses."""

import subprocess
import sys

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import fmus.contact
from fmus.contact import creep_forces, kalker
from fmus.contact.forces.friction import friction_coefficient
from fmus.contact.forces.laws import LAWS, selected_law
from fmus.contact.forces.laws.fastsim import Fastsim
from fmus.contact.forces.laws.law import ARGUMENTS, RESULTS

G = 8e10
EVERY_LAW = list(LAWS)
SATURATING = [law for law in LAWS if law != "linear"]
WITH_SPIN = [law for law in LAWS if law != "polach_no_spin"]
laws, saturating, signs = st.sampled_from(EVERY_LAW), st.sampled_from(SATURATING), st.sampled_from([-1, 1])
sizes = st.floats(1e-6, 1e-2)
creepages = st.tuples(signs, sizes).map(lambda x: x[0] * x[1]) | st.just(0.0)
spins = st.tuples(signs, st.floats(1e-3, 3.0)).map(lambda x: x[0] * x[1]) | st.just(0.0)  # 1/m
patches = st.fixed_dictionaries(
    {
        "a": st.floats(2e-3, 1e-2),
        "b": st.floats(2e-3, 1e-2),
        "N": st.floats(5e3, 2e5),
        "mu": st.floats(0.03, 0.6),
        "G": st.just(G),
        "nu": st.floats(0.0, 0.5),
    }
)


def forces(law, patch, *creepage, **more):
    xi_x, xi_y, xi_s = creepage
    return np.array(creep_forces(law, **patch, xi_x=xi_x, xi_y=xi_y, xi_s=xi_s, **more))


def bound(patch):
    return patch["mu"] * patch["N"]


def size(patch):
    return np.sqrt(patch["a"] * patch["b"])


def linear_creepage(patch, part=1.0):
    """Creepage at which the linear theory's force is that part of mu N."""
    return part * bound(patch) / (patch["G"] * patch["a"] * patch["b"] * 4)


@given(laws, patches)
def test_no_creep_no_force(law, patch):
    assert_array_equal(forces(law, patch, 0, 0, 0), 0)


@given(saturating, patches, creepages, creepages, spins)
def test_never_more_than_friction(law, patch, xi_x, xi_y, xi_s):
    F_x, F_y, _ = forces(law, patch, xi_x, xi_y, xi_s)
    assert np.hypot(F_x, F_y) <= bound(patch) * (1 + 1e-9)


@given(patches, creepages, creepages, st.floats(0, 1), st.floats(0, 1))
def test_polach_with_its_factors_never_exceeds_friction(patch, xi_x, xi_y, k_A, part):
    F = forces("polach", patch, xi_x, xi_y, 0.0, k_A=k_A, k_S=part * k_A)
    assert np.hypot(F[0], F[1]) <= bound(patch) * (1 + 1e-12)


@given(laws, patches, creepages, creepages)
def test_creepage_never_feeds_energy(law, patch, xi_x, xi_y):
    F_x, F_y, _ = forces(law, patch, xi_x, xi_y, 0.0)
    assert F_x * xi_x <= 0
    assert F_y * xi_y <= 0


@given(st.sampled_from(WITH_SPIN), patches, creepages, creepages, spins)
def test_creepage_and_spin_together_never_feed_energy(law, patch, xi_x, xi_y, xi_s):
    if law == "polach":  # its moment saturates apart from its forces, which holds up to a = 2 b
        patch = patch | {"a": min(patch["a"], 2 * patch["b"])}
    F_x, F_y, M_z = forces(law, patch, xi_x, xi_y, xi_s)
    power = np.array([F_x * xi_x, F_y * xi_y, M_z * xi_s])
    assert power.sum() <= 1e-12 * np.abs(power).sum()


@given(laws, patches, creepages, creepages, spins)
def test_mirrored_creep_gives_mirrored_forces(law, patch, xi_x, xi_y, xi_s):
    F_x, F_y, M_z = forces(law, patch, xi_x, xi_y, xi_s)
    tolerance = 1e-9 * np.abs([F_x, F_y, M_z]).max() + 1e-12
    # the plane of the track: left becomes right
    assert_allclose(forces(law, patch, xi_x, -xi_y, -xi_s), [F_x, -F_y, -M_z], atol=tolerance)
    # traction becomes braking
    assert_allclose(forces(law, patch, -xi_x, xi_y, xi_s), [-F_x, F_y, M_z], atol=tolerance)


@given(st.sampled_from(WITH_SPIN), patches, st.floats(1e-3, 0.3))
def test_spin_alone_is_opposed(law, patch, xi_s):
    F_x, F_y, M_z = forces(law, patch, 0.0, 0.0, xi_s)
    assert abs(F_x) <= 1e-9 * bound(patch)
    assert F_y < 0
    assert M_z < 0


@given(patches, creepages, creepages, spins)
def test_polach_without_spin_does_not_see_it(patch, xi_x, xi_y, xi_s):
    with_spin = forces("polach_no_spin", patch, xi_x, xi_y, xi_s)
    assert_array_equal(with_spin, forces("polach_no_spin", patch, xi_x, xi_y, 0.0))
    assert_array_equal(with_spin, forces("polach", patch, xi_x, xi_y, 0.0))


@given(laws, patches, st.sampled_from(["xi_x", "xi_y", "xi_s"]))
def test_small_creep_has_the_slope_of_kalkers_coefficients(law, patch, which):
    small = linear_creepage(patch, 1e-7)
    c11, c22, c23, c33 = kalker(patch["a"] / patch["b"], patch["nu"])
    stiffness = patch["G"] * patch["a"] * patch["b"]
    expected = {
        "xi_x": [-stiffness * c11 * small, 0],
        "xi_y": [0, -stiffness * c22 * small],
        "xi_s": [0, -stiffness * c23 * small],
    }[which]
    creep = {"xi_x": 0.0, "xi_y": 0.0, "xi_s": 0.0} | {
        which: small / size(patch) if which == "xi_s" else small
    }
    if law == "polach_no_spin" and which == "xi_s":
        expected = [0, 0]
    found = forces(law, patch, *creep.values(), **({"n": (60, 60)} if law == "fastsim" else {}))
    # FASTSIM: the strips' ends on a grid of 60
    assert_allclose(found[:2], expected, rtol=3e-3 if law == "fastsim" else 2e-6, atol=1e-9 * bound(patch))
    if law in ("linear", "shen"):
        moment = {"xi_x": 0, "xi_y": c23, "xi_s": -c33}[which] * stiffness * size(patch) * small
        assert_allclose(found[2], moment, rtol=2e-6, atol=1e-20)


@given(patches, signs, st.floats(0.1, 1.0), st.floats(0.0, 1.0))
def test_polachs_factors_reduce_the_slope_by_their_mean(patch, sign, k_A, part):
    k_S, creep = part * k_A, sign * linear_creepage(patch, 1e-7)
    full = forces("polach", patch, creep, 0.0, 0.0)[0]
    reduced = forces("polach", patch, creep, 0.0, 0.0, k_A=k_A, k_S=k_S)[0]
    assert_allclose(reduced, full * (k_A + k_S) / 2, rtol=1e-6)


@given(patches, st.floats(0.0, 6.3), st.floats(3.0, 100.0))
def test_shen_is_all_friction_from_three_times_it_on(patch, angle, times):
    c11, c22, _, _ = kalker(patch["a"] / patch["b"], patch["nu"])
    force = times * bound(patch) / (patch["G"] * patch["a"] * patch["b"])
    F = forces("shen", patch, force * np.cos(angle) / c11, force * np.sin(angle) / c22, 0.0)
    assert_allclose(np.hypot(F[0], F[1]), bound(patch), rtol=1e-12)


@given(saturating, patches, st.floats(0.0, 6.3))
def test_large_creepage_slides_against_its_direction(law, patch, angle):
    direction = np.array([np.cos(angle), np.sin(angle)])
    F = forces(law, patch, *1e3 * direction, 0.0)[:2]
    if law in ("shen", "fastsim"):  # they slide along the force, not the slip
        assert_allclose(np.hypot(*F), bound(patch), rtol=1e-3)
    else:
        assert_allclose(F, -bound(patch) * direction, rtol=1e-3, atol=1e-3 * bound(patch))


@given(laws, patches, creepages, creepages, spins, st.floats(0.1, 10.0))
def test_load_scales_by_its_third_root(law, patch, xi_x, xi_y, xi_s, factor):
    # under N times k³ a patch is k times as large; creepages k times, the same spin: forces k³, moments k⁴
    k = np.cbrt(factor)
    larger = patch | {"a": k * patch["a"], "b": k * patch["b"], "N": factor * patch["N"]}
    F = forces(law, patch, xi_x, xi_y, xi_s) * [k**3, k**3, k**4]
    assert_allclose(forces(law, larger, k * xi_x, k * xi_y, xi_s), F, rtol=1e-9, atol=1e-10 * np.abs(F).max())


@given(patches, creepages, creepages, spins)
def test_finer_grids_converge(patch, xi_x, xi_y, xi_s):
    coarse, fine, finest = (forces("fastsim", patch, xi_x, xi_y, xi_s, n=(n, n))[:2] for n in (10, 20, 80))
    assert np.abs(fine - finest).max() <= 0.05 * bound(patch)
    assert np.abs(fine - finest).max() <= np.abs(coarse - finest).max() + 0.02 * bound(patch)


def test_laws_have_their_names_and_codes():
    assert {law: made.code for law, made in LAWS.items()} == {
        "linear": 0,
        "shen": 1,
        "fastsim": 2,
        "polach_no_spin": 3,
        "polach": 4,
    }


CONTACT = (6e-3, 4e-3, 8e4, 0.3, G)  # a, b, N, mu, G
EXAMPLE = dict(zip(ARGUMENTS, (*CONTACT, 4.6, 4.3, 2.0, 0.9, 1e-3, -5e-4, 0.2, 1, 1), strict=True))
CREEPS = [(0, 0, 0), (1e-3, 0, 0), (0, 1e-3, 0), (0, 0, 0.1), (1e100, 0, 0), (0, 5e-324, 0)]


def test_one_function_selects_among_the_laws():
    chosen = selected_law()
    for law in LAWS.values():
        alone = [float(x) for x in law().function()(*EXAMPLE.values())]
        both = [x.full().ravel().tolist() for x in chosen(law.code, *EXAMPLE.values(), 0, 0, 0, 0)]
        assert both == [[x, x] for x in alone]


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("creep", CREEPS)
def test_forces_have_finite_derivatives(law, creep):
    made = LAWS[law]().function()
    x = cs.MX.sym("x", 3)
    given = [cs.DM(value) for value in EXAMPLE.values()]
    given[9:12] = cs.vertsplit(x)
    slope = cs.Function("slope", [x], [cs.jacobian(cs.vertcat(*made(*given)), x)])
    assert np.isfinite(slope(creep).full()).all()


def test_at_rest_linear_shen_and_fastsim_are_as_stiff_as_kalkers_theory():
    x = cs.MX.sym("x", 3)
    given = [cs.DM(value) for value in EXAMPLE.values()]
    given[9:12] = cs.vertsplit(x)
    slopes = {
        law: cs.Function("s", [x], [cs.jacobian(cs.vertcat(*LAWS[law]().function()(*given)), x)])(0).full()
        for law in ("linear", "shen", "fastsim")
    }
    assert_allclose(slopes["shen"], slopes["linear"], rtol=1e-12)
    assert_allclose(slopes["fastsim"][:2], slopes["linear"][:2], rtol=0.01, atol=1e-6)


def test_fastsim_as_an_expression_is_its_function():
    # in SX its loops unfold, as a model without calls would have it
    symbols = [cs.SX.sym(name) for name in ARGUMENTS]
    law = Fastsim((7, 5))
    unfolded = cs.Function("unfolded", symbols, list(law.function()(*symbols)))
    expected = [float(x) for x in law.function()(*EXAMPLE.values())]
    assert_allclose([float(x) for x in unfolded(*EXAMPLE.values())], expected, rtol=1e-12)


def test_functions_say_their_arguments_and_results():
    for law in LAWS.values():
        made = law().function()
        assert tuple(made.name_in()) == ARGUMENTS
        assert tuple(made.name_out()) == RESULTS


def test_a_law_is_there_without_tables_and_their_libraries():
    code = "import fmus.contact.forces.laws, sys; sys.exit('pandas' in sys.modules or 'scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_public_names_are_found_where_they_are_defined():
    for name, module in fmus.contact.PUBLIC.items():
        assert getattr(fmus.contact, name).__module__ == f"fmus.contact.{module}"
        assert name in dir(fmus.contact)
    with pytest.raises(AttributeError, match="no attribute 'creep_force'"):
        fmus.contact.creep_force  # noqa: B018


HERE = {"a": 6e-3, "b": 4e-3, "N": 8e4, "mu": 0.3, "G": G, "nu": 0.28}


@pytest.mark.parametrize("law", EVERY_LAW)
def test_arrays_broadcast_and_floats_stay_floats(law):
    assert all(type(x) is float for x in creep_forces(law, **HERE, xi_x=1e-3, xi_y=0, xi_s=0))
    xi_x, b = np.linspace(-1e-2, 1e-2, 5), np.array([[2e-3], [4e-3], [8e-3]])
    found = np.array(creep_forces(law, **HERE | {"b": b}, xi_x=xi_x, xi_y=1e-4, xi_s=0.1))
    assert found.shape == (3, 3, 5)
    one = creep_forces(law, **HERE | {"b": 2e-3}, xi_x=xi_x[3], xi_y=1e-4, xi_s=0.1)
    assert_allclose(found[:, 0, 3], one, rtol=1e-12)
    assert creep_forces(law, **HERE, xi_x=np.zeros((0, 4)), xi_y=0, xi_s=0)[2].shape == (0, 4)


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("a", [1e-5, 1.0])
def test_extreme_contacts_stay_finite(law, a):
    for creep in (5e-324, 1e-300, 1.0, 1e6, 1e100):
        F = forces(law, HERE | {"a": a}, creep, -creep, creep)
        assert np.isfinite(F).all()
        if law in ("shen", "fastsim", "polach_no_spin"):
            assert np.hypot(F[0], F[1]) <= bound(HERE) * (1 + 1e-9)


@pytest.mark.parametrize("law", SATURATING)
@pytest.mark.parametrize("without", ["N", "mu"])
def test_without_load_or_friction_there_is_no_force(law, without):
    assert_allclose(forces(law, HERE | {without: 0.0}, 1e-3, -1e-3, 0.1), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"law": "polack"}, "law 'polack' is not known; did you mean 'polach'"),
        ({"a": 0.0}, "a must be finite and greater than 0"),
        ({"b": -1e-3}, "b must be finite and greater than 0"),
        ({"N": -1.0}, "N must be finite and 0 or greater"),
        ({"mu": -0.1}, "mu must be finite and 0 or greater"),
        ({"G": 0.0}, "G must be finite and greater than 0"),
        ({"nu": 0.51}, "nu must be finite and from 0 to 0.5"),
        ({"xi_x": np.array([0.0, np.nan])}, "xi_x must be finite"),
        ({"xi_s": np.inf}, "xi_s must be finite"),
        ({"k_A": -1.0}, "k_A must be finite and 0 or greater"),
        ({"k_A": 0.5}, "k_S must not exceed k_A"),
        ({"n": 20}, "n must be two whole numbers"),
        ({"n": (20, 0)}, "n must be 1 or greater"),
        ({"n": (20, 2.5)}, "n must be two whole numbers"),
        ({"xi_x": np.zeros(2), "xi_y": np.zeros(3)}, r"do not broadcast together: xi_x \(2,\), xi_y \(3,\)"),
    ],
)
def test_what_physics_does_not_allow_is_named(wrong, words):
    given = {"law": "fastsim"} | HERE | {"xi_x": 0.0, "xi_y": 0.0, "xi_s": 0.0} | wrong
    with pytest.raises(ValueError, match=words):
        creep_forces(**given)


@given(st.floats(0, 100), st.floats(0.01, 1), st.floats(0, 1), st.floats(0, 5))
def test_friction_falls_from_its_value_at_rest_to_its_limit(w, mu0, A, B):
    mu = float(friction_coefficient(w, mu0, A, B))
    assert A * mu0 * (1 - 1e-12) <= mu <= mu0 * (1 + 1e-12)
    assert float(friction_coefficient(0.0, mu0, A, B)) == pytest.approx(mu0)
    assert mu <= float(friction_coefficient(w / 2, mu0, A, B)) * (1 + 1e-12)
