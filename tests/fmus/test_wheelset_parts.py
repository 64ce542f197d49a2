"""The parts that a step of the wheelset is made of give what the plain formulas give, and once a step."""

import casadi as cs
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fmus.contact.forces.coefficients import coefficients, kalker, looked_up
from fmus.model import equations
from fmus.variables import Input, Parameter, State
from fmus.wheelset.curves import FIELDS, contact_curves
from fmus.wheelset.model import Wheelset, powers_of
from fmus.wheelset.track import Track

LIFT, SLOPE = FIELDS.index("lift"), FIELDS.index("lift_slope")


def curve(shifts):
    return contact_curves(Track()).map(len(shifts))(1, shifts.reshape(1, -1)).full()


def test_the_slope_of_the_lift_is_its_derivative():
    middle, off = np.linspace(-9e-3, 9e-3, 400), 1e-9
    by_difference = (curve(middle + off)[LIFT] - curve(middle - off)[LIFT]) / (2 * off)
    assert_allclose(curve(middle)[SLOPE], by_difference, rtol=1e-6, atol=1e-6)  # lift is known to 1e-16 m


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_beyond_the_table_the_last_contact_holds_and_lifts_no_further(side):
    near, far = curve(side * np.array([0.05, 0.1])).T
    assert_array_equal(near, far)
    assert near[SLOPE] == 0.0


@pytest.mark.parametrize("nu", [0.0, 0.28, 0.5])
def test_rows_looked_up_for_both_contacts_are_the_coefficients_of_each(nu):
    ratios = np.concatenate([np.geomspace(0.02, 50.0, 301), [0.1, 0.3, 1.0, 1 / 0.3, 10.0]])
    both = np.vstack([ratios, np.random.default_rng(1).permutation(ratios)])  # also one slender, one not
    found = looked_up().map(ratios.size)(both, np.ones_like(both), np.full((1, ratios.size), nu))
    for mine, expected in zip(found, kalker(both, np.full_like(both, nu)), strict=True):
        assert_allclose(mine.full(), expected, rtol=1e-13)


def test_rows_looked_up_have_the_slopes_of_the_coefficients():
    r, nu = cs.SX.sym("r"), cs.SX.sym("nu")
    alone = cs.Function("alone", [r, nu], [cs.jacobian(cs.vertcat(*coefficients(r, nu)), cs.vertcat(r, nu))])
    pair, n = cs.MX.sym("pair", 2), cs.MX.sym("nu")
    left = cs.vertcat(*(both[0] for both in looked_up().call([pair, cs.DM.ones(2), n])))
    slopes = cs.Function(
        "slopes", [pair, n], [cs.horzcat(cs.jacobian(left, pair)[:, 0], cs.jacobian(left, n))]
    )
    for ratio in (0.05, 0.33, 0.97, 1.4, 4.0, 30.0):
        assert_allclose(slopes([ratio, 1.2], 0.28).full(), alone(ratio, 0.28).full(), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("exponent", [0.0, 0.4, 1.0, 1.7])
def test_a_power_and_its_slopes_are_those_of_a_power_also_at_one(exponent):
    bases = np.array([0.3, 1.0, 2.5])
    found = powers_of(3)
    assert_allclose(found(bases, exponent).full().ravel(), bases**exponent, rtol=1e-15)
    by_base, by_exponent = found.jacobian()(bases, exponent, 0)
    assert_allclose(by_base.full(), np.diag(exponent * bases ** (exponent - 1)), rtol=1e-14)
    assert_allclose(by_exponent.full().ravel(), np.log(bases) * bases**exponent, rtol=1e-14)


def test_what_the_states_do_not_decide_is_worked_out_once_a_step():
    made = equations(Wheelset())

    def count(function, operation):
        return [function.instruction_id(i) for i in range(function.n_instructions())].count(operation)

    assert count(made.step, cs.OP_CONSTPOW) == count(made.f, cs.OP_CONSTPOW) == 1  # the patches' size
    # one of the calls in the derivatives is for the patch at usual shifts
    stages, calls = 4, count(made.f, cs.OP_CALL)
    assert count(made.step, cs.OP_CALL) == stages * (calls - 1) + 1


def test_the_exponent_of_the_shift_has_its_slope_also_at_one():
    model = Wheelset()
    h, at = equations(model).h, [v.name for v in model.of(Parameter)].index("k_c")
    x, u, p = (np.array([v.start for v in model.of(k)]) for k in (State, Input, Parameter))
    x[0], more = 3e-3, 1e-5 * np.eye(len(p))[at]
    found = h.jacobian()(x, u, p, 0)[2].full()[:, at]
    expected = (h(x, u, p + more) - h(x, u, p - more)).full().ravel() / 2e-5
    assert np.abs(found).max() > 0
    assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
