"""Steps over several samples of the inputs: exact to fifth order, for each row as if it were alone."""

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fmus.export.builders.native.working import build_working
from fmus.host.fmu import Fmu
from fmus.integrators import INTEGRATORS
from fmus.model import Model
from fmus.variables import Input, Output, Parameter, State, rate
from tests.helpers.native import native

OMEGA = 40.0  # rad/s of the input
SAMPLE = 1e-3
POINTS = 4  # samples that a step goes over
BETWEEN = (OMEGA * POINTS * SAMPLE) ** 4 / 384  # error of a cubic between the ends of a step


class Driven(Model):
    """A first order lag whose answer to a wave is known, and a swing beside it."""

    name = "Driven"
    step_size = SAMPLE
    method = "rk4_within_stability"

    x = State("1", doc="lagging state", nominal=1.0)
    q = State("1", doc="swing", nominal=1.0)
    q_dot = State("1/s", doc="its rate", nominal=10.0)
    u = Input("1", doc="what drives both")
    decay = Parameter("1/s", 100.0, min=0.0, doc="rate of decay of the lag")
    x_rate = rate(x, "1/s", "rate of the lagging state")
    both = Output("1", doc="product of state and input")

    def derivatives(m):
        return {
            "x": m.decay * (m.u - m.x),
            "q": m.q_dot,
            "q_dot": -900.0 * (m.q - cs.sin(m.u)) - 6.0 * m.q_dot,
        }

    def outputs(m):
        return {"both": m.x * m.u}


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    with Fmu(build_working(Driven(), tmp_path_factory.mktemp("driven") / "Driven.fmu")) as fmu:
        yield fmu


def exact(t, decay):
    """Steady answer of the lag to sin(OMEGA t)."""
    return decay / (decay**2 + OMEGA**2) * (decay * np.sin(OMEGA * t) - OMEGA * np.cos(OMEGA * t))


def steady(decay):
    """Start values of that answer."""
    return {"decay": decay, "x": float(exact(0.0, decay))}


def run(fmu, n, starts, joined, outputs=("x",), sample=SAMPLE):
    t = sample * np.arange(n)
    return t, fmu.simulate_rows(t, {"u": np.sin(OMEGA * t)}, outputs, starts, joined)


@settings(deadline=None)
@given(decay=st.floats(1.0, 2e5), n=st.integers(5, 400))
def test_the_known_answer_is_met_far_closer_than_with_held_inputs(driven, decay, n):
    """Also where a step would be unstable and is divided; a lag that is fast in a sample gains nothing."""
    t, y = run(driven, n, [steady(decay)], True)
    _, held = run(driven, n, [steady(decay)], False)
    error, usual = (np.abs(found[0, :, 0] - exact(t, decay)).max() for found in (y, held))
    whole = (n - 1) % POINTS == 0  # else some samples are left, over which inputs are held
    assert error < (0.1 if whole and decay * SAMPLE < 1.0 else 1.01) * usual + BETWEEN


@pytest.mark.parametrize("decay", [5.0, 60.0])
def test_the_order_of_convergence(driven, decay):
    errors = []
    for sample in (2e-3, 1e-3, 5e-4):
        t, y = run(driven, round(0.4 / sample) + 1, [steady(decay)], True, sample=sample)
        errors.append(np.abs(y[0, :, 0] - exact(t, decay)).max())
    assert min(errors[0] / errors[1], errors[1] / errors[2]) > 2**3.5


def test_rates_and_outputs_belong_to_their_samples(driven):
    t, y = run(driven, 201, [{"decay": 50.0}], True, ("x", "x_rate", "both"))
    u = np.sin(OMEGA * t)
    assert_allclose(y[0, :, 1], 50.0 * (u - y[0, :, 0]), rtol=1e-12, atol=1e-12)
    assert_allclose(y[0, :, 2], y[0, :, 0] * u, rtol=1e-12, atol=1e-12)


@settings(deadline=None)
@given(seed=st.integers(0, 2**32 - 1), k=st.integers(2, 9), n=st.integers(2, 60))
def test_a_row_does_not_depend_on_its_neighbours(driven, seed, k, n):
    """Also where some of them would be unstable in such steps, and others not."""
    rng = np.random.default_rng(seed)
    starts = [
        {"decay": float(10 ** rng.uniform(0, 4)), "q": rng.normal(), "x": rng.normal()} for _ in range(k)
    ]
    _, together = run(driven, n, starts, True, ("x", "q", "x_rate"))
    for start, y in zip(starts, together, strict=True):
        assert_array_equal(run(driven, n, [start], True, ("x", "q", "x_rate"))[1][0], y)


@settings(deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 20), every=st.integers(1, 9))
def test_of_every_so_many_samples_one_is_read_with_the_same_bits(driven, seed, n, every):
    decays = 10 ** np.random.default_rng(seed).uniform(0, 4, 3)
    t, outputs = SAMPLE * np.arange(n * every + 1), ("x", "q", "x_rate")
    asked = t, {"u": np.sin(OMEGA * t)}, outputs, [{"decay": float(d)} for d in decays], True
    assert_array_equal(driven.simulate_rows(*asked, every=every), driven.simulate_rows(*asked)[:, ::every])


def test_an_fmu_to_be_handed_over_makes_the_steps_that_it_is_asked_for():
    with Fmu(native("vehicle7dof")) as fmu:
        assert not fmu.joins
        assert fmu.simulate_rows(SAMPLE * np.arange(9), {}, list(fmu.description.states), [{}], True) is None


def test_methods_for_stiff_models_join_nothing():
    assert {name for name, method in INTEGRATORS.items() if method.joins} == {"rk4", "rk4_within_stability"}
