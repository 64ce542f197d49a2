"""Effects with a memory: lag, delay, hysteresis and flexible mode against closed solutions and energy."""

import casadi as cs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import cumulative_trapezoid, solve_ivp

from fmus.effects import EFFECTS
from fmus.effects.input_effect import HOLD, InputEffect
from fmus.model import equations
from fmus.models import MODELS
from fmus.variables import Parameter, State
from tests.fmus.test_effects import all_of
from tests.helpers.bench import Bench
from tests.helpers.everything import EVERY_MODEL, EVERY_PLACE, WITH_MEMORY

T = np.linspace(0, 4, 8001)
HYSTERESIS, MODE = EFFECTS["hysteresis"], EFFECTS["flexible_mode"]
amplitudes, rates = st.floats(0.01, 1.0), st.floats(0.5, 12.0)


def moving(a, b, w, z):
    """Displacement and velocity of two sines, from rest."""
    q = a * (1 - np.cos(w * T)) + b * (1 - np.cos(z * T))
    return q, a * w * np.sin(w * T) + b * z * np.sin(z * T)


def arrives(kind, values, t, u):
    """What an input u(t) becomes, by scipy from the effect's own equations."""
    effect = EFFECTS[kind]
    names = [s.name for s in effect.states("N")]
    x, now = cs.SX.sym("x", len(names)), cs.SX.sym("u")
    law = effect({**values, **{n: x[i] for i, n in enumerate(names)}})
    f = cs.Function("f", [x, now], [cs.vertcat(*(law.rates(now)[n] for n in names)), law.passed(now)])
    run = solve_ivp(
        lambda s, x: f(x, u(s))[0].full().ravel(),
        (0, t[-1]), np.zeros(len(names)), t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.05,
    )  # fmt: skip
    return np.array([float(f(x, u(s))[1]) for s, x in zip(t, run.y.T, strict=True)])


@given(share=st.floats(0, 1), lag=st.floats(0.02, 1), u_0=st.floats(-2, 2))
@settings(max_examples=10)
def test_a_lag_follows_a_step_by_its_exponential(share, lag, u_0):
    t = np.linspace(0, 3, 31)
    found = arrives("actuator_lag", {"share": share, "T": lag, "u_0": u_0}, t, lambda s: 1.5)
    assert_allclose(found, 1.5 - share * (1.5 - u_0) * np.exp(-t / lag), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "error"), [(1.0, 1e-5), (5.2, 1e-3), (6.5, 0.01), (8.3, 0.1)])
def test_a_delay_delays_within_its_band(phase, error):
    delay = 0.1
    omega, t = phase / delay, np.linspace(1.5, 2.5, 101)  # after what the start has stirred up
    found = arrives(
        "input_delay", {"share": 1.0, "T": delay, "u_0": 0.0}, np.r_[0, t], lambda s: np.sin(omega * s)
    )
    assert np.abs(found[1:] - np.sin(omega * (t - delay))).max() < error


def test_a_delay_holds_the_value_before_the_start_and_then_gives_the_input_itself():
    t = np.array([0.0, 1e-6, 5.0])
    found = arrives("input_delay", {"share": 1.0, "T": 0.1, "u_0": 2.0}, t, lambda s: 7.0)
    assert_allclose(found, [2.0, 2.0, 7.0], atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k for k in sorted(WITH_MEMORY) if issubclass(EFFECTS[k], InputEffect)])
def test_an_input_and_its_rate_stay_together(kind):
    """What arrives as rate is the derivative of what arrives as value."""
    model = Bench([(EFFECTS[kind], "u")])
    arriving = cs.vertcat(model.symbols["u"], model.symbols["u_dot"])
    states = [v.name for v in model.of(State)]
    x, p = (cs.vertcat(*(model.free_symbols[v.name] for v in model.of(k))) for k in (State, Parameter))
    u = cs.vertcat(model.free_symbols["u"], model.free_symbols["u_dot"])
    slope = cs.jtimes(arriving[0], x, cs.vertcat(*(model.rates.get(n, 0.0) for n in states)))
    slope += cs.jtimes(arriving[0], u, cs.vertcat(u[1], 0.0))
    gap = cs.Function("gap", [x, u, p], [slope - arriving[1]])
    # where the rate's memory is the derivative of the value's, as it is from rest on
    values = {v.name: v.start for v in model.of(Parameter)}
    chosen = dict.fromkeys(EFFECTS[kind].amplitudes, 0.7) | {HOLD: 0.3}
    values |= {n: v for n, v in ((f"{kind}_u_{n}", v) for n, v in chosen.items()) if n in values}
    t, u_of = np.linspace(0, 1, 201), lambda s: 0.3 + 0.5 * np.sin(5 * s) ** 2
    u_dot = lambda s: 2.5 * np.sin(10 * s)  # noqa: E731
    own = [n for n in states if n.startswith(kind)]
    f = cs.Function("f", [x, u, p], [cs.vertcat(*(model.rates.get(n, 0.0) for n in states))])
    given = [*values.values()]
    run = solve_ivp(
        lambda s, x: f(x, [u_of(s), u_dot(s)], given).full().ravel(),
        (0, 1), np.zeros(len(states)), t_eval=t, rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    gaps = [abs(float(gap(x, [u_of(s), u_dot(s)], given))) for s, x in zip(t, run.y.T, strict=True)]
    assert len(own) == 2 * len(EFFECTS[kind].states("N"))  # the value's memory and the rate's
    assert np.abs(run.y[[states.index(n) for n in own]]).max() > 0.1
    assert max(gaps) < 1e-6


@given(a=amplitudes, b=amplitudes, w=rates, z=rates, beta=st.floats(0.5, 1), n=st.floats(1, 5))
@settings(max_examples=12)
def test_hysteresis_never_gives_more_than_it_took(a, b, w, z, beta, n):
    q, v = moving(a, b, w, z)
    F = HYSTERESIS.along({"F_h": 3.0, "q_y": 0.2, "beta": beta, "n": n}, T, q, v)
    work = cumulative_trapezoid(F * v, T, initial=0)
    assert np.abs(F).max() <= 3.0
    assert work.max() <= 1e-4 * 3.0 * np.ptp(q)  # of the trapezoidal rule


@given(beta=st.floats(0.5, 1), n=st.floats(1, 5), a=st.floats(0.05, 1))
@settings(max_examples=8)
def test_hysteresis_dissipates_over_each_closed_cycle(beta, n, a):
    t = np.linspace(0, 6 * np.pi, 6001)
    F = HYSTERESIS.along({"F_h": 2.0, "q_y": 0.1, "beta": beta, "n": n}, t, a * np.sin(t), a * np.cos(t))
    work = cumulative_trapezoid(F * a * np.cos(t), t, initial=0)
    assert work[-1] < work[4000] < work[2000] < 0


def test_hysteresis_loads_by_an_exponential_and_unloads_in_a_straight_line():
    q = np.concatenate([np.linspace(0, 0.3, 3001), np.linspace(0.3, 0.2, 1001)[1:]])
    t = np.linspace(0, 1, len(q))
    v = np.where(np.arange(len(q)) < 3000, 0.3, -0.1) / np.where(np.arange(len(q)) < 3000, 0.75, 0.25)
    F = HYSTERESIS.along({"F_h": 5.0, "q_y": 0.1}, t, q, v)
    assert_allclose(F[:3000], -5.0 * (1 - np.exp(-q[:3000] / 0.1)), atol=2e-3)
    assert_allclose(np.diff(F[3100:3900]) / np.diff(q[3100:3900]), -5.0 / 0.1, rtol=1e-6)


def test_hysteresis_with_beta_1_is_dahls_friction():
    q, v = moving(0.3, 0.1, 3.0, 7.0)
    F = HYSTERESIS.along({"F_h": 5.0, "q_y": 0.05, "beta": 1.0}, T, q, v)
    run = solve_ivp(
        lambda t, F: (5 / 0.05) * (1 - F / 5 * np.sign(np.interp(t, T, v))) * np.interp(t, T, v),
        (0, 4), [0.0], t_eval=T, rtol=1e-8, atol=1e-8, max_step=0.01,
    )  # fmt: skip
    assert_allclose(F, -run.y[0], atol=1e-3)


@pytest.mark.parametrize("over", [0.2, 0.9, 1.5])
def test_a_flexible_mode_answers_as_a_mass_on_a_moving_base(over):
    m, f, D = 3.0, 5.0, 0.3
    omega_0, omega = 2 * np.pi * f, 2 * np.pi * f * over
    t = np.linspace(0, 4, 40001)
    v = np.cos(omega * t)
    F = MODE.along({"m": m, "f": f, "D": D, "v_0": 1.0}, t, np.sin(omega * t) / omega, v)
    s = 1j * omega  # force on the base = -m a (omega_0^2 + 2 D omega_0 s) / (s^2 + 2 D omega_0 s + omega_0^2)
    ratio = (omega_0**2 + 2 * D * omega_0 * s) / (s**2 + 2 * D * omega_0 * s + omega_0**2)
    expected = np.real(-m * s * ratio * np.exp(s * t))
    late = t > 2  # what the start has stirred up has died away
    assert_allclose(F[late], expected[late], atol=1e-3 * np.abs(expected).max())


def test_a_flexible_mode_that_turns_with_its_base_is_not_felt():
    v = np.full_like(T, 12.0)
    assert np.array_equal(MODE.along({"m": 3.0, "f": 5.0, "v_0": 12.0}, T, 12.0 * T, v), np.zeros_like(T))


@given(a=amplitudes, b=amplitudes, w=rates, z=rates, f=st.floats(0.5, 20), D=st.floats(0, 1))
@settings(max_examples=10)
def test_a_flexible_mode_never_gives_more_than_it_took(a, b, w, z, f, D):
    q, v = moving(a, b, w, z)
    F = MODE.along({"m": 2.0, "f": f, "D": D}, T, q, v)
    work = cumulative_trapezoid(F * v, T, initial=0)
    assert work.max() <= 1e-3 * (np.ptp(work) + 1e-9)


@pytest.mark.parametrize("name", [m for m in EVERY_MODEL if MODELS[m].method == "rk4"])
def test_no_memory_is_too_fast_for_the_steps_of_a_model(name):
    """The eigenvalues of each memory at the limits of its parameters, within Runge-Kutta's region."""
    for kind in WITH_MEMORY & {k for m, k, _ in EVERY_PLACE if m == name} - {"hysteresis"}:
        model = MODELS[name](all_of(name, kind)[:1])
        f, states = equations(model).f, [v.name for v in model.of(State)]
        own = [i for i, n in enumerate(states) if n.startswith(kind)]
        extreme = {"T": lambda p: p.min, "f": lambda p: p.max, "D": lambda p: p.max}
        p = [
            extreme[n](v)
            if (n := v.name.rpartition("_")[2]) in extreme and v.name in model.brought
            else v.start
            for v in model.of(Parameter)
        ]
        x, u = [v.start for v in model.of(State)], [model.variables[n].start for n in names_of_inputs(model)]
        z = np.linalg.eigvals(f.jacobian()(x, u, p, 0)[0].full()[np.ix_(own, own)]) * model.step_size
        assert np.all(np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24) <= 1.0), (kind, z)


def names_of_inputs(model):
    return [n for n, v in model.variables.items() if v.causality == "input"]


def test_a_step_too_long_for_a_stiff_hysteresis_stays_bounded():
    t = np.linspace(0, 10, 101)
    F = HYSTERESIS.along({"F_h": 3.0, "q_y": 1e-5}, t, np.sin(t), np.cos(t))
    assert np.all(np.abs(F) <= 3.0)


def test_laws_with_a_memory_are_those_that_say_so():
    assert {"hysteresis", "flexible_mode", "actuator_lag", "input_delay"} <= WITH_MEMORY
    assert not {"viscous_damping", "coulomb_friction", "actuator_gain", "parameter_step"} & WITH_MEMORY
