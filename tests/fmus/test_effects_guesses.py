"""Start values of shape parameters: the true ones are among them, for simulated missing forces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from fmus.effects import EFFECTS
from fmus.effects.force_law import HANDFUL, ForceLaw
from fmus.effects.spectrum import frequencies, orders, splits
from tests.helpers.everything import EVERY_EFFECT, FORCE_LAWS

T = np.linspace(0, 30, 3001)
SEEDS = st.integers(0, 99)


def wandering(rng):
    """A motion about rest: displacement of some centimetres, and its velocity."""
    omega, phase = rng.uniform(1, 12, 6), rng.uniform(0, 2 * np.pi, 6)
    size = 0.02 * rng.uniform(0.3, 1, 6) / omega**0.5
    q = np.sum(size * np.sin(np.outer(T, omega) + phase), axis=1)
    return q, np.sum(size * omega * np.cos(np.outer(T, omega) + phase), axis=1)


def turning(rng):
    """A motion that goes on, at a speed that changes."""
    v = 5 + np.sin(T / 3 + rng.uniform(0, 6))
    return np.concatenate([[0], np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(T))]), v


def seen(kind, values, motion, rng):
    """The force of a law along a motion, with an offset and noise of a fifth of it."""
    force = EFFECTS[kind].along(values, T, *motion)
    size = np.std(force)
    return force + 0.5 * size + 0.2 * size * rng.standard_normal(len(T))


def nearest(kind, name, true, values, motion, rng):
    """Ratio of the nearest guess to the true value, at least 1."""
    found = EFFECTS[kind].guesses(T, *motion, seen(kind, values, motion, rng))
    assert 0 < len(found) <= HANDFUL
    return min(max(g[name] / true, true / g[name]) for g in found)


@pytest.mark.parametrize(
    ("kind", "name", "amplitude", "low", "high", "factor"),
    [
        ("bump_stop", "gap", "k", 0.5, 0.95, 1.5),
        ("free_play", "gap", "k", 0.2, 0.8, 2.0),
        ("hysteresis", "q_y", "F_h", 0.1, 0.9, 2.0),
        ("stribeck_friction", "v_b", "F_b", 0.1, 0.7, 2.5),
        ("coulomb_friction", "v_s", "F_c", 0.02, 0.4, 2.5),
    ],
)
@given(seed=SEEDS, where=st.floats(0, 1))
@settings(max_examples=6)
def test_what_shows_in_the_motion_is_guessed(kind, name, amplitude, low, high, factor, seed, where):
    """The true value between two quantiles of the magnitude of displacement or velocity."""
    rng = np.random.default_rng(seed)
    motion = wandering(rng)
    magnitude = np.abs(motion[1] if kind.endswith("_friction") else motion[0])
    true = float(np.quantile(magnitude, low + where * (high - low)))
    values = {amplitude: 100.0, name: true}
    assert nearest(kind, name, true, values, motion, rng) < factor


@given(seed=SEEDS, t0=st.floats(3, 27))
@settings(max_examples=10)
def test_the_time_of_a_step_is_guessed(seed, t0):
    rng = np.random.default_rng(seed)
    motion = wandering(rng)
    found = EFFECTS["step_force"].guesses(T, *motion, seen("step_force", {"F_0": 3.0, "t0": t0}, motion, rng))
    assert min(abs(g["t0"] - t0) for g in found) < 0.1


@given(seed=SEEDS, f=st.floats(0.5, 20))
@settings(max_examples=10)
def test_the_frequency_of_a_force_locked_to_time_is_guessed(seed, f):
    rng = np.random.default_rng(seed)
    motion = turning(rng)
    force = seen("harmonic_excitation", {"F_sin": 1.0, "F_cos": 2.0, "f": f}, motion, rng)
    found = EFFECTS["harmonic_excitation"].guesses(T, *motion, force)
    assert min(abs(g["f"] - f) for g in found) < 0.5 / np.ptp(T)


@given(seed=SEEDS, order=st.floats(0.5, 12))
@settings(max_examples=10)
def test_the_order_of_a_force_locked_to_an_angle_is_guessed(seed, order):
    rng = np.random.default_rng(seed)
    motion = turning(rng)
    force = seen("periodic_force", {"F_sin": 2.0, "order": order}, motion, rng)
    found = EFFECTS["periodic_force"].guesses(T, *motion, force)
    assert min(abs(g["order"] - order) for g in found) < np.pi / np.ptp(motion[0])


@given(seed=SEEDS, f=st.floats(1.5, 8))
@settings(max_examples=4)
def test_a_flexible_mode_that_rings_is_guessed_by_its_frequency(seed, f):
    rng = np.random.default_rng(seed)
    q, v = wandering(rng)
    knocked = v + 0.05 * np.cumsum(rng.standard_normal(len(T)) * (rng.random(len(T)) < 0.02))
    values = {"m": 50.0, "f": f, "D": 0.02, "v_0": float(knocked[0])}
    force = seen("flexible_mode", values, (q, knocked), rng)
    found = EFFECTS["flexible_mode"].guesses(T, q, knocked, force)
    assert min(max(g["f"] / f, f / g["f"]) for g in found) < 1.2
    assert all(g["v_0"] == knocked[0] for g in found)


@given(seed=SEEDS, share=st.floats(0.45, 0.97))
@settings(max_examples=10)
def test_the_limit_of_an_actuator_is_guessed(seed, share):
    u = np.cumsum(np.random.default_rng(seed).standard_normal(len(T)))
    limit = np.quantile(np.abs(u), share)
    found = [g["limit"] for g in EFFECTS["actuator_saturation"].guesses(T, u)]
    assert all(0 < g < np.abs(u).max() for g in found)
    assert min(max(g / limit, limit / g) for g in found) < 2


def test_a_limit_is_guessed_where_an_input_stays_at_its_largest():
    u = np.interp(T, [0.0, 0.3 * T[-1], 0.5 * T[-1]], [7.5, 7.5, 15.0])
    assert any(14.2 < g["limit"] < 15.0 for g in EFFECTS["actuator_saturation"].guesses(T, u))


@given(time=st.floats(0.02, 0.5))
def test_lags_and_delays_are_guessed_within_their_decade_from_rest(time):
    for kind in ("actuator_lag", "input_delay"):
        found = EFFECTS[kind].guesses(T, 3.0 + np.sin(T))
        assert min(max(g["T"] / time, time / g["T"]) for g in found) < 2.5
        assert all(g["u_0"] == 3.0 for g in found)


def test_a_constant_input_has_no_limit_to_find():
    assert EFFECTS["actuator_saturation"].guesses(T, np.full_like(T, 40.0)) == []
    assert EFFECTS["actuator_saturation"].guesses(T, np.zeros_like(T)) == []


@pytest.mark.parametrize("kind", ["parameter_step", "stiffness_change"])
@given(t0=st.floats(2, 28))
def test_times_of_changes_are_a_grid_over_the_record(kind, t0):
    found = [g["t0"] for g in EFFECTS[kind].guesses(T) if g]
    assert min(abs(g - t0) for g in found) < 2.0
    assert 0 < min(found) < max(found) < 30
    assert ({} in EFFECTS[kind].guesses(T)) == (kind == "stiffness_change")  # it may have been so always


@pytest.mark.parametrize("kind", EVERY_EFFECT)
def test_guesses_name_parameters_and_stay_within_their_limits(kind):
    effect, rng = EFFECTS[kind], np.random.default_rng(3)
    if issubclass(effect, ForceLaw):
        q, v = wandering(rng)
        found, parameters = effect.guesses(T, q, v, np.sin(9 * T) + v), effect.parameters("translation")
    else:
        seen_there = (T,) if effect.acts_on in ("parameter", "component") else (T, np.sin(T))
        found, parameters = effect.guesses(*seen_there), effect.parameters("N")
    known = {p.name: p for p in parameters}
    assert found
    for guess in found:
        for name, value in guess.items():
            assert not effect.is_amplitude(name)
            assert known[name].min is None or known[name].min <= value
            assert known[name].max is None or value <= known[name].max


@pytest.mark.parametrize("kind", FORCE_LAWS)
def test_where_nothing_moves_nothing_is_made_up(kind):
    still = np.zeros_like(T)
    for guess in EFFECTS[kind].guesses(T, still, still, still):
        assert all(np.isfinite(value) for value in guess.values())
    assert orders(still, still, np.sin(T)) == []
    assert frequencies(T, still, still) == []


@given(st.integers(4, 60))
def test_splits_of_short_records_are_within_them(n):
    t = np.linspace(0, 1, n)
    assert all(0 < s < 1 for s in splits(t, np.sin(40 * t)))


def test_sizes_are_realistic():
    assert EFFECTS["parameter_offset"].size(-40.0, 60.0) == pytest.approx(2.0)
    assert EFFECTS["parameter_drift"].size(-40.0, 60.0) == pytest.approx(2.0 / 60)
    assert EFFECTS["parameter_step"].size(0.0, 60.0) > 0
    assert -1 < EFFECTS["stiffness_change"].size(60.0) < 0
    assert 0 < EFFECTS["actuator_lag"].size(60.0) < 1


@given(st.floats(2.0, 15.0), st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_a_line_is_found_beside_slow_noise_of_more_power(f, seed):
    """Slow noise fills a band; a line stands above the spectrum about it."""
    rng, t = np.random.default_rng(seed), np.arange(6000) * 0.01
    slow = lfilter([1.0], [1.0, -0.998], rng.standard_normal(len(t)))
    force = 5.0 * slow / slow.std() + np.sin(2 * np.pi * f * t)
    found = frequencies(t, rng.standard_normal(len(t)), force)
    assert min(abs(x - f) for x in found) < 0.01


@pytest.mark.parametrize("kind", sorted(EFFECTS))
@pytest.mark.parametrize("dt", [1e-5, 1e-3, 0.1, 4.0, 3600.0])
def test_what_is_tried_is_allowed_however_far_apart_the_samples_are(kind, dt):
    effect, t = EFFECTS[kind], np.arange(600) * dt
    w = 2 * np.pi / (100 * dt)
    q, v = np.sin(w * t), w * np.cos(w * t)
    asked = {"port": (q, v, -v - q**3), "input": (q,)}
    shapes = effect.guesses(t, *asked.get(effect.acts_on, ()))
    assert shapes or kind == "flexible_mode"  # which samples of a second do not show
    for name, value in (item for shape in shapes for item in shape.items()):
        p = getattr(effect, name)
        assert np.isfinite(value)
        assert p.min is None or value >= p.min
        assert p.max is None or value <= p.max
