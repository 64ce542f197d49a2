"""Creep laws against an independent truth, and against Kalker's full theory (CONTACT)."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.contact import creep_forces
from tests.helpers.paths import SHARED
from tests.truth.contact import Patch, fastsim, polach

# forces of Kalker's full theory (CONTACT), of FASTSIM 400 x 400 by another program, and of Polach's formulas
REFERENCE = SHARED / "data" / "contact" / "creep_force_reference.csv"
G, NU = 8e10, 0.25
signs, sizes = st.sampled_from([-1, 1]), st.floats(1e-6, 1e-2)
creepages = st.tuples(signs, sizes).map(lambda x: x[0] * x[1]) | st.just(0.0)
spins = st.tuples(signs, st.floats(1e-3, 3.0)).map(lambda x: x[0] * x[1])  # 1/m


@pytest.mark.parametrize("axes", [(6e-3, 4e-3), (3e-3, 9e-3), (5e-3, 5e-3)])
def test_fastsim_is_the_independent_one(axes):
    patch, n = Patch(*axes, N=55e3, mu=0.3, G=G), 200
    for creep in [(1e-3, 0, 0), (0, 2e-3, 0), (4e-4, -3e-4, 0.2), (0, 0, 1.0), (-1e-3, 1e-3, -0.5)]:
        found = np.array(creep_forces("fastsim", *axes, 55e3, 0.3, G, NU, *creep, n=(n, n)))
        limit = 0.3 * 55e3 * np.array([1, 1, axes[0]])
        # Kalker's full steps take the tractions half a cell too far: 1 % on this grid
        assert (np.abs(found - fastsim(patch, *creep, n=n)) <= 0.012 * limit).all()


@given(st.floats(2e-3, 9e-3), st.floats(2e-3, 9e-3), creepages, creepages, spins)
def test_polach_is_the_independent_one(a, b, xi_x, xi_y, xi_s):
    patch = Patch(a, b, N=55e3, mu=0.3, G=G)
    expected = polach(patch, xi_x, xi_y, xi_s, k_A=0.6, k_S=0.2)
    F = creep_forces("polach", a, b, 55e3, 0.3, G, NU, xi_x, xi_y, xi_s, k_A=0.6, k_S=0.2)
    # the source's polynomial loses digits where the spin's stress gradient is large
    assert_allclose(F[:2], expected, rtol=1e-9, atol=1e-9 * 0.3 * 55e3)


@pytest.fixture(scope="module")
def reference():
    if not REFERENCE.is_file():
        pytest.skip(f"{REFERENCE} is not there; the data come beside the repository")
    return pd.read_csv(REFERENCE)


def at(reference, law, **more):
    """Forces and moment over mu N and mu N sqrt(ab) at the rows of the reference, (n, 3)."""
    r = reference
    found = creep_forces(
        law,
        r.a_mm / 1e3,
        r.b_mm / 1e3,
        r.N_N,
        r.mu,
        r.G_MPa * 1e6,
        r.nu,
        r.xi_x,
        r.xi_y,
        r.phi_per_mm * 1e3,
        **more,
    )
    return np.column_stack(found) / scale(r)


def scale(r):
    limit = (r.mu * r.N_N).to_numpy()
    return np.column_stack([limit, limit, limit * np.sqrt(r.a_mm * r.b_mm) / 1e3])


def from_contact(reference, found):
    r = reference
    return found - np.column_stack([r.Fx_CONTACT, r.Fy_CONTACT, r.Mz_CONTACT / 1e3]) / scale(r)


def worst_force(error, rows):
    return np.hypot(*error[rows.to_numpy(), :2].T).max()


def test_fastsim_against_the_full_theory(reference):
    r = reference
    error = from_contact(r, at(r, "fastsim", n=(100, 100)))
    assert worst_force(error, r.phi_per_mm == 0) < 0.065
    assert worst_force(error, (r.phi_per_mm > 0) & (r.phi_per_mm <= 2e-4)) < 0.065
    assert worst_force(error, r.a_mm > 0) < 0.12
    # the moment of its tractions; Shen's would be off by 1.3
    assert np.abs(error[:, 2]).max() < 0.12


@pytest.mark.parametrize("law", ["polach", "polach_no_spin"])
def test_polach_without_spin_against_the_full_theory(reference, law):
    r = reference
    assert worst_force(from_contact(r, at(r, law)), r.phi_per_mm == 0) < 0.08


def test_polach_with_spin_against_the_full_theory(reference):
    r = reference
    some = (r.phi_per_mm > 0) & (r.phi_per_mm <= 2e-4) & (r.a_mm <= r.b_mm)
    assert worst_force(from_contact(r, at(r, "polach")), some) < 0.14


def test_shen_against_the_full_theory(reference):
    r = reference
    error = from_contact(r, at(r, "shen"))
    # its own figures: without spin as good as FASTSIM, with little spin while a <= b
    assert worst_force(error, r.phi_per_mm == 0) < 0.065
    some = (r.phi_per_mm > 0) & (r.phi_per_mm <= 2e-4)
    assert worst_force(error, some & (r.a_mm <= r.b_mm)) < 0.065
    assert worst_force(error, some) < 0.11


def test_moments_have_the_sign_of_the_full_theory(reference):
    r = reference
    clear = (np.abs(r.Mz_CONTACT / 1e3) / scale(r)[:, 2] > 0.02).to_numpy()
    # Shen's moment has its sign from the linear theory, wrong where a patch turns from sticking to sliding
    for law, share in (("fastsim", 1.0), ("shen", 0.95)):
        agrees = np.sign(at(r, law)[clear, 2]) == np.sign(r.Mz_CONTACT[clear])
        assert agrees.mean() >= share


@pytest.mark.parametrize("n", [(100, 100), (200, 50)])
def test_fastsim_against_a_fine_one_by_another_program(reference, n):
    r = reference
    fine = np.column_stack([r.Fx_FASTSIM400, r.Fy_FASTSIM400]) / scale(r)[:, :2]
    assert np.abs(at(r, "fastsim", n=n)[:, :2] - fine).max() < 0.02


def test_polach_is_its_formula(reference):
    r = reference
    found = at(r, "polach") * scale(r)
    # given to 1e-4 N
    assert_allclose(found[:, 0], r.Fx_Polach, rtol=1e-9, atol=5.1e-5)
    assert_allclose(found[:, 1], r.Fy_Polach, rtol=1e-9, atol=5.1e-5)
