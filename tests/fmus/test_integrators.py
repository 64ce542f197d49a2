"""Integrators: order, damping of what is stiff, and steps that shorten themselves."""

from array import array
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
from fmus.model import equations
from fmus.models import MODELS
from tests.helpers.everything import near_start, values

every_integrator = pytest.mark.parametrize("method", INTEGRATORS.values(), ids=INTEGRATORS)


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


def test_error_estimate_of_rodas3_has_order_three_and_is_no_less_than_the_error():
    step, fine = compiled(pendulum, 2, Rodas3, 1e-6), compiled(pendulum, 2, Rk4)
    estimates = []
    for h in (0.1, 0.05, 0.025):
        x1, error = step([1.0, 0.5], 0.2, 0.3, h)
        true = np.abs(np.array(x1).ravel() - march(fine, [1.0, 0.5], 0.2, 0.3, h, 20)).max()
        assert float(error) >= true / 1e-6
        estimates.append(float(error))
    assert_allclose(np.log2(np.divide(estimates[:-1], estimates[1:])), 3, atol=0.3)


def test_rk4_claims_no_error():
    assert float(compiled(pendulum, 2, Rk4)([1.0, 0.5], 0.2, 0.3, 0.5)[1]) == 0.0


@given(st.floats(-1e8, 0.0), st.floats(-1e8, 1e8))
def test_rodas3_is_a_stable(real, imaginary):
    step = compiled(lambda x, u, p: (u * x[0] - p * x[1], p * x[0] + u * x[1]), 2)
    x1 = np.array(step([1.0, 0.0], real, imaginary, 1.0)[0])
    assert np.hypot(*x1.ravel()) <= 1 + 1e-9


@pytest.mark.parametrize("rate", [1e4, 1e6, 1e8])
def test_rodas3_is_l_stable(rate):
    step = compiled(lambda x, u, p: (-p * (x[0] - u),), 1)
    # one step across 1e4 to 1e8 time constants: nothing of the start is left, R(z) = O(1/z)
    assert abs(float(step([5.0], 2.0, rate, 1.0)[0]) - 2.0) < 30 / rate


def test_prothero_robinson_follows_the_slow_solution():
    def rates(x, u, p):
        return -p * (x[0] - cs.cos(x[1])) - cs.sin(x[1]), 1.0

    step = compiled(rates, 2)
    for rate in (1e2, 1e4, 1e6):
        errors = [abs(march(step, [1.0, 0.0], 0.0, rate, 2.0, n)[0] - np.cos(2.0)) for n in (10, 20, 40)]
        assert errors[0] < 0.02 / rate  # a stiffly accurate method: the stiffer, the better
        assert errors[2] < errors[1] < errors[0]


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
