"""Sensors: each fault does what it says and nothing else, in any company."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fmus.errors import BadInput
from scenarios.track.sensors import Sensor, measure, read_sensors

T = np.linspace(0.0, 10.0, 10001)
OMEGA = 2 * np.pi * 1.5
SINE = np.sin(OMEGA * T)
numbers = st.floats(-1e3, 1e3)


def reading(sensor: Sensor, signal=SINE, seed: int = 1, time=T) -> np.ndarray:
    return measure(time, {"x": signal}, {"x": sensor}, seed)["x"].to_numpy()


def test_a_perfect_sensor_changes_nothing():
    frame = measure(T, {"x": SINE}, {"x": Sensor()}, 1)
    assert list(frame.columns) == ["time", "x"]
    assert_array_equal(frame["time"], T)
    assert_array_equal(frame["x"], SINE)


def test_sampling_takes_the_signal_at_the_multiples_of_the_period():
    frame = measure(T, {"x": SINE}, {"x": Sensor(rate=40.0)}, 1)
    assert_allclose(frame["time"], np.arange(401) / 40, atol=1e-12)
    assert_allclose(frame["x"], np.sin(OMEGA * frame["time"]), atol=1e-12)  # every sample is one of the grid


@given(numbers, numbers)
def test_gain_comes_before_bias(gain, bias):
    # the bias is in units of the reading: both together are gain x + bias, not gain (x + bias)
    assert_allclose(reading(Sensor(gain=gain, bias=bias)), gain * SINE + bias, rtol=1e-12, atol=1e-12)


def test_drift_grows_from_the_first_sample_whatever_the_clock_says():
    late = T + 100
    assert_allclose(reading(Sensor(drift=0.3), np.zeros_like(T), time=late), 0.3 * T, atol=1e-12)


@given(st.floats(0.0, 0.5))
@settings(max_examples=20)
def test_a_delay_turns_a_sine_back_by_its_phase(delay):
    seen = reading(Sensor(delay=delay))
    settled = delay < T
    # 1e-4: cubics through 667 points a period, which PCHIP flattens at the crests
    assert_allclose(seen[settled], np.sin(OMEGA * T - OMEGA * delay)[settled], atol=1e-4)
    assert_array_equal(seen[~settled], SINE[0])  # before it the signal rests at its first value


@given(st.floats(-0.4, 0.4))
@settings(max_examples=20)
def test_a_clock_ahead_shows_the_signal_later(offset):
    seen = reading(Sensor(clock_offset=offset))
    inside = (offset < T) & (offset + T[-1] > T)
    assert_allclose(seen[inside], np.sin(OMEGA * (T - offset))[inside], atol=1e-4)


def test_a_delay_is_a_clock_offset_that_drift_does_not_follow():
    assert_allclose(reading(Sensor(delay=0.2)), reading(Sensor(clock_offset=0.2)), atol=1e-12)
    a, b = reading(Sensor(delay=0.2, drift=1.0)), reading(Sensor(clock_offset=0.2, drift=1.0))
    assert_allclose(a - b, 0.2, atol=1e-12)


def test_a_fast_clock_stretches_time():
    seen = reading(Sensor(clock_skew=0.01))
    assert_allclose(seen, np.sin(OMEGA * T / 1.01), atol=1e-4)


@given(st.floats(1e-3, 0.7))
@settings(max_examples=30)
def test_quantisation_errs_by_half_a_step_at_most(quantum):
    seen = reading(Sensor(quantum=quantum))
    assert np.abs(seen - SINE).max() <= quantum / 2 * (1 + 1e-9)
    assert_allclose(seen / quantum, np.round(seen / quantum), atol=1e-9)


def test_quantisation_of_a_busy_signal_has_the_variance_of_a_uniform_error():
    error = reading(Sensor(quantum=0.01)) - SINE
    # q²/12; the errors of neighbours hang together, so some 1 / sqrt(2 * 400 crossings) of scatter
    assert error.std() == pytest.approx(0.01 / 12**0.5, rel=0.05)


@given(st.floats(-0.9, 0.0), st.floats(0.05, 0.9), st.one_of(st.none(), st.floats(1e-3, 0.05)))
def test_saturation_holds_whatever_else_is_wrong(low, high, quantum):
    seen = reading(Sensor(saturation=(low, high), quantum=quantum, gain=3.0, bias=0.2, noise=0.5))
    assert seen.min() >= low
    assert seen.max() <= high


def test_limits_that_are_steps_of_the_converter_are_reached():
    # 0.3/0.1 is a little below 3 in floating point
    seen = reading(Sensor(saturation=(-0.3, 0.3), quantum=0.1))
    assert (seen.min(), seen.max()) == (-0.3, 0.3)


def test_noise_comes_before_saturation_and_saturation_before_nothing_else_it_could_undo():
    seen = reading(Sensor(noise=0.1, saturation=(-10.0, 0.0)), np.zeros_like(T))
    assert (seen == 0).mean() == pytest.approx(0.5, abs=4 * 0.5 / T.size**0.5)  # half of the noise is cut


def test_noise_is_white_with_its_standard_deviation():
    noise = reading(Sensor(noise=0.2), np.zeros_like(T))
    four_sigma = 4 / T.size**0.5
    assert noise.std() == pytest.approx(0.2, rel=four_sigma)
    assert abs(noise.mean()) < 0.2 * four_sigma
    for lag in (1, 2, 7):
        assert abs(np.corrcoef(noise[lag:], noise[:-lag])[0, 1]) < four_sigma


def test_lost_samples_have_their_share_and_leave_the_others_as_they_are():
    sound, lossy = reading(Sensor(noise=0.1)), reading(Sensor(noise=0.1, dropout=0.2))
    lost = np.isnan(lossy)
    assert lost.mean() == pytest.approx(0.2, abs=4 * 0.4 / T.size**0.5)
    assert_array_equal(lossy[~lost], sound[~lost])


def test_gaps_are_lost_whole():
    lost = np.isnan(reading(Sensor(gaps=((2.0, 3.0), (5.5, 5.6)))))
    assert_array_equal(lost, ((T >= 2) & (T <= 3)) | ((T >= 5.5) & (T <= 5.6)))


NOISY = {"x": Sensor(noise=0.1, dropout=0.1), "y": Sensor(noise=0.1), "z": Sensor(noise=0.1, of="y")}
SIGNALS = {"x": SINE, "y": np.cos(T)}


@given(st.permutations(list(NOISY)), st.integers(0, 2**40))
@settings(max_examples=20)
def test_a_channel_depends_on_the_seed_and_its_name_alone(order, seed):
    frame = measure(T, SIGNALS, NOISY, seed)
    other = measure(T, SIGNALS, {name: NOISY[name] for name in order}, seed)
    alone = measure(T, SIGNALS, {"y": NOISY["y"]}, seed)
    for name in NOISY:
        assert_array_equal(frame[name], other[name])
    assert_array_equal(frame["y"], alone["y"])


def test_seeds_and_names_draw_differently():
    frame = measure(T, SIGNALS, NOISY, 1)
    again = measure(T, SIGNALS, NOISY, 2)
    assert np.corrcoef(frame["y"] - np.cos(T), frame["z"] - np.cos(T))[0, 1] == pytest.approx(0, abs=0.05)
    assert np.corrcoef(frame["y"] - np.cos(T), again["y"] - np.cos(T))[0, 1] == pytest.approx(0, abs=0.05)


def test_sensors_of_different_rates_meet_in_the_rows_they_share():
    frame = measure(T, SIGNALS, {"x": Sensor(rate=30.0), "y": Sensor(rate=10.0), "w": Sensor(of="x")}, 1)
    assert frame["time"].is_monotonic_increasing
    assert frame["x"].notna().sum() == 301
    assert frame["y"].notna().sum() == 101
    assert (frame["x"].notna() & frame["y"].notna()).sum() == 101
    assert frame["w"].notna().sum() == T.size
    assert len(frame) == T.size + 200  # two of three samples at 30 Hz lie between the milliseconds


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"a": {"raet": 10.0}}, "key 'sensors.a.raet' is not known; did you mean 'rate'?"),
        ({"a": {"rate": 0.0}}, "key 'sensors.a.rate' must be greater than 0, not '0.0'"),
        ({"a": {"noise": -1.0}}, "key 'sensors.a.noise' must be greater than or equal to 0"),
        ({"a": {"noise": "big"}}, "key 'sensors.a.noise' must be a number, not 'big'"),
        ({"a": {"dropout": 1.0}}, "key 'sensors.a.dropout' must be less than 1"),
        ({"a": {"saturation": [1.0, -1.0]}}, "key 'sensors.a.saturation' must increase"),
        ({"a": {"gaps": [[1.0]]}}, "key 'sensors.a.gaps[0]' must be two numbers"),
        ({"a": {"saturation": [0.2, 0.8], "quantum": 1.0}}, "[sensors.a] no multiple of the quantum 1 lies"),
        ({"a": 3}, "key 'sensors.a' must be a table, not '3'"),
        (3, "key 'sensors' must be a table of tables"),
    ],
)
def test_bad_declarations_in_one_line(table, words):
    with pytest.raises(BadInput) as refused:
        read_sensors(table)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_declared_is_what_measures():
    sensors = read_sensors({"a": {"of": "x", "rate": 100, "gain": 2, "gaps": [[1, 2]]}})
    assert sensors == {"a": Sensor(of="x", rate=100.0, gain=2.0, gaps=((1.0, 2.0),))}


@pytest.mark.parametrize(
    ("time", "signals", "sensors", "seed", "words"),
    [
        (T, {"x": SINE}, {"y": Sensor()}, 1, "sensor 'y': signal 'y' is not there; known are x"),
        (T, {"x": SINE[1:]}, {"x": Sensor()}, 1, "one finite number for each of the 10001 times"),
        (T, {"x": SINE * np.nan}, {"x": Sensor()}, 1, "one finite number"),
        (T[::-1], {"x": SINE}, {"x": Sensor()}, 1, "time: needs at least two finite numbers that increase"),
        (T, {"x": SINE}, {"x": Sensor()}, -1, "seed must be a whole number from 0, not -1"),
        (T, {"x": SINE}, {"x": Sensor()}, 0.5, "seed must be a whole number from 0, not 0.5"),
        (T[1:9], {"x": SINE[1:9]}, {"x": Sensor(rate=1.0)}, 1, "a rate of 1 Hz takes no sample"),
    ],
)
def test_bad_data_in_one_line(time, signals, sensors, seed, words):
    with pytest.raises(BadInput, match=r"^[^\n]*$") as refused:
        measure(time, signals, sensors, seed)
    assert words in str(refused.value)
