"""Integrators: order, damping of what is stiff, and steps that shorten themselves."""

from array import array
from fractions import Fraction
from functools import partial

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from fmus.errors import BadInput
from fmus.export.runtime.stepping import Stepper
from fmus.export.runtime.symbolic import on_memory
from fmus.integrators import INTEGRATORS
from fmus.integrators.rk4 import Rk4
from fmus.integrators.rodas3 import Rodas3
from fmus.integrators.rodas4 import GAMMA, POINTS, RATES, Rodas4
from fmus.model import equations
from fmus.models import MODELS
from tests.helpers.everything import near_start, values

every_integrator = pytest.mark.parametrize("method", INTEGRATORS.values(), ids=INTEGRATORS)
stiff = pytest.mark.parametrize("method", [Rodas3, Rodas4])


def compiled(rates, n, method=Rodas3, tolerated=1e-6):
    """The step of a method for x' = rates(x, u, p) with one input and one parameter."""
    x, u, p = cs.SX.sym("x", n), cs.SX.sym("u"), cs.SX.sym("p")
    f = cs.Function("f", [x, u, p], [cs.vertcat(*rates(x, u, p))], ["x", "u", "p"], ["dx"])
    return method().step(f, [tolerated] * n)


def pendulum(x, u, p):
    return x[1], -cs.sin(x[0]) - p * x[1] ** 3 + u


def march(step, x, u, p, duration, steps):
    for _ in range(steps):
        x = step(x, u, p, duration / steps)[0]
    return np.array(x).ravel()


@every_integrator
def test_order_of_convergence(method):
    def rates(_, x):
        return [x[1], -np.sin(x[0]) - 0.3 * x[1] ** 3 + 0.2]

    exact = solve_ivp(rates, (0, 2), [1.0, 0.5], method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    step = compiled(pendulum, 2, method)
    errors = [np.abs(march(step, [1.0, 0.5], 0.2, 0.3, 2.0, n) - exact).max() for n in (40, 80, 160)]
    # 0.15: the next term of the error at these steps
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), method.order, atol=0.15)


@stiff
def test_error_estimate_has_the_methods_order_and_is_no_less_than_the_error(method):
    step, fine = compiled(pendulum, 2, method, 1e-6), compiled(pendulum, 2, Rk4)
    estimates = []
    for h in (0.1, 0.05, 0.025):
        x1, error = step([1.0, 0.5], 0.2, 0.3, h)
        true = np.abs(np.array(x1).ravel() - march(fine, [1.0, 0.5], 0.2, 0.3, h, 20)).max()
        assert float(error) >= true / 1e-6
        estimates.append(float(error))
    assert_allclose(np.log2(np.divide(estimates[:-1], estimates[1:])), method.order, atol=0.3)


def test_rk4_claims_no_error():
    assert float(compiled(pendulum, 2, Rk4)([1.0, 0.5], 0.2, 0.3, 0.5)[1]) == 0.0


@stiff
@given(real=st.floats(-1e8, 0.0), imaginary=st.floats(-1e8, 1e8))
def test_it_is_a_stable(method, real, imaginary):
    step = compiled(lambda x, u, p: (u * x[0] - p * x[1], p * x[0] + u * x[1]), 2, method)
    x1 = np.array(step([1.0, 0.0], real, imaginary, 1.0)[0])
    assert np.hypot(*x1.ravel()) <= 1 + 1e-9


@stiff
@pytest.mark.parametrize("rate", [1e4, 1e6, 1e8])
def test_it_is_l_stable(method, rate):
    step = compiled(lambda x, u, p: (-p * (x[0] - u),), 1, method)
    # one step across 1e4 to 1e8 time constants: nothing of the start is left, R(z) = O(1/z)
    assert abs(float(step([5.0], 2.0, rate, 1.0)[0]) - 2.0) < 30 / rate


@stiff
def test_prothero_robinson_follows_the_slow_solution(method):
    def rates(x, u, p):
        return -p * (x[0] - cs.cos(x[1])) - cs.sin(x[1]), 1.0

    step = compiled(rates, 2, method)
    for rate in (1e2, 1e4, 1e6):
        errors = [abs(march(step, [1.0, 0.0], 0.0, rate, 2.0, n)[0] - np.cos(2.0)) for n in (10, 20, 40)]
        assert errors[0] < 0.02 / rate  # a stiffly accurate method: the stiffer, the better
        assert errors[2] < errors[1] < errors[0]


# a twist of some mrad on a stiff shaft beside the speeds of two masses, which a contact brakes
SHAFT = [[0, 1, 0], [-300000, -4000, 2000], [1400000, 100, -100]]


def exact_step(x, h):
    """A step of the method for x' = SHAFT x in fractions, by Gauss-Jordan: no digit is lost."""
    x, h = [Fraction(v) for v in x], Fraction(h)

    def rates(point):
        return [sum(a * v for a, v in zip(row, point, strict=True)) for row in SHAFT]

    def plus(vector, shares, k, by):
        return [v + by * sum(Fraction(s) * ki[i] for s, ki in zip(shares, k, strict=True))
                for i, v in enumerate(vector)]  # fmt: skip

    k = []
    for points, shares in zip(POINTS, RATES, strict=True):
        point = plus(x, points, k, 1)
        rows = [[(i == j) / (Fraction(GAMMA) * h) - SHAFT[i][j] for j in range(3)] for i in range(3)]
        rows = [[*row, b] for row, b in zip(rows, plus(rates(point), shares, k, 1 / h), strict=True)]
        for i in range(3):
            rows[i] = [v / rows[i][i] for v in rows[i]]
            rows = [row if j == i else [a - row[i] * b for a, b in zip(row, rows[i], strict=True)]
                    for j, row in enumerate(rows)]  # fmt: skip
        k.append([row[-1] for row in rows])
    return [float(a + b) for a, b in zip(point, k[-1], strict=True)]


def test_a_small_state_beside_large_ones_keeps_its_digits_with_rodas4():
    def rates(x, u, p):
        return cs.vertsplit(cs.DM(SHAFT) @ x)

    start, h = [5e-4, -13.0, 37.0], 1e-4
    found, exact = np.array(compiled(rates, 3, Rodas4)(start, 0.0, 0.0, h)[0]).ravel(), exact_step(start, h)
    assert_allclose(found[0], exact[0], rtol=1e-13)
    assert_allclose(found, exact, rtol=1e-11)  # the speeds fall to a part of their stages


@given(st.floats(-3.0, 3.0), st.floats(-10.0, 10.0), st.floats(1e-4, 0.5))
def test_a_state_that_is_not_felt_changes_no_bit_with_rodas4(q, v, h):
    def alone(x, u, p):
        return x[1], -1e5 * cs.sin(x[0]) - 300 * x[1]

    def watched(x, u, p):  # a lag that a force could feel by p
        return x[1], -1e5 * cs.sin(x[0]) - 300 * x[1] + p * x[2], (x[1] - x[2]) / 0.02

    bare = np.array(compiled(alone, 2, Rodas4)([q, v], 0.0, 0.0, h)[0]).ravel()
    with_lag = np.array(compiled(watched, 3, Rodas4)([q, v, 0.7], 0.0, 0.0, h)[0]).ravel()
    assert with_lag[:2].tolist() == bare.tolist()


def test_short_steps_follow_stiff_van_der_pol():
    mu = 1e3

    def rates(x, u, p):
        return x[1], p * ((1 - x[0] ** 2) * x[1]) - x[0]

    def by_scipy(_, x):
        return [x[1], mu * ((1 - x[0] ** 2) * x[1]) - x[0]]

    x, u, p = (memoryview(array("d", v)) for v in ([2.0, 0.0], [0.0], [mu]))
    stepper = Stepper(partial(on_memory, compiled(rates, 2, tolerated=1e-6)), x, u, p, 10.0)
    assert all(stepper.advance(1.0) for _ in range(900))  # past the first jump, at 807 s
    exact = solve_ivp(by_scipy, (0, 900), [2.0, 0.0], method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
    assert_allclose(x.tolist(), exact, rtol=1e-4)


def test_no_step_is_longer_than_asked_and_equal_ones_are_equal():
    seen = []

    def spied(arguments, results):
        evaluate = on_memory(compiled(pendulum, 2, Rk4), arguments, results)

        def watched():
            seen.append(arguments[3][0])
            evaluate()

        return watched

    x, u, p = (memoryview(array("d", v)) for v in ([1.0, 0.5], [0.2], [0.3]))
    stepper = Stepper(spied, x, u, p, 0.01)
    assert stepper.advance(0.03)
    assert_allclose(seen, [0.01] * 3, rtol=1e-12)
    seen.clear()
    assert stepper.advance(0.025)
    assert len(seen) == 3
    assert_allclose(seen, 0.025 / 3, rtol=1e-12)


@every_integrator
def test_a_step_that_never_succeeds_leaves_the_state(method):
    x, u, p = (memoryview(array("d", v)) for v in ([1.0, 1.0], [0.0], [1.0]))
    step = compiled(lambda x, u, p: (cs.sqrt(-1 - x[0] ** 2), x[1]), 2, method)
    stepper = Stepper(partial(on_memory, step), x, u, p, 0.1)
    assert not stepper.advance(0.1)
    assert x.tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("method", "words"),
    [("rk5", "did you mean 'rk4'"), ("euler", "known are .*rk4, .*rodas3"), (Rk4, "is not known")],
)
def test_a_model_with_an_unknown_method_is_refused(method, words, monkeypatch):
    monkeypatch.setattr(MODELS["drive"], "method", method)
    with pytest.raises(BadInput, match=f"^model 'Drive': method .*{words}"):
        equations(MODELS["drive"]())


@pytest.mark.parametrize("name", INTEGRATORS)
def test_any_model_can_name_any_integrator(name, monkeypatch):
    base = MODELS["drive"]()
    x, u, p = near_start(base, np.random.default_rng(9))
    monkeypatch.setattr(MODELS["drive"], "method", name)
    made, dt = equations(base), 1e-5
    # 1e-3: the drive's rates change within some tenths of a second
    assert_allclose((values(made.step, x, u, p, dt) - x) / dt, values(made.f, x, u, p), rtol=1e-3)
