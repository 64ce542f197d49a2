"""Noise of the sensors in `railfmi estimate`: correlated in time, of a size that is not declared, delayed."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.filters.sensor_noise import SensorNoise
from estimator.record import Record, Run
from fmus.errors import BadInput
from scenarios.estimating.delays import undelayed
from scenarios.estimating.estimating import estimate
from scenarios.estimating.result import EstimateResult
from scenarios.experiment.estimated import Estimate, Options
from tests.estimator.test_sensor_noise import drawn
from tests.scenarios.test_estimate_command import NOISE, write_vdp
from tests.truth.rig import NOISE as RIG_NOISE
from tests.truth.rig import write_record

TIME = 0.25  # s, over which the noise is correlated
DECLARED = "noise_std = 0.05\n"
CORRELATED = "[estimate.noise.x0]\ntime = 0.25\n"
ALL = '[estimate.noise.x0]\nstd = "estimated"\ntime = "estimated"\nshare = "estimated"\n'
ASKED = """
[estimate]
parameters.mu0 = {start = 0.4, std = 0.1, bounds = [0.02, 0.8]}
parameters.r_w = {start = 0.348, std = 0.002}
"""
BOTH = """
[estimate.noise]
omega_w = {time = 0.25}
omega_r = {time = 0.25}
"""


def noisy(file: Path, columns: dict[str, SensorNoise], seed: int) -> Path:
    """The experiment with noise added to columns of its record."""
    data, rng = file.with_name("data.csv"), np.random.default_rng(seed)
    names = data.read_text().split("\n", 1)[0]
    rows = np.loadtxt(data, delimiter=",", skiprows=1)
    dt = float(np.median(np.diff(rows[:, 0])))
    for name, noise in columns.items():
        rows[:, names.split(",").index(name)] += drawn(noise, len(rows), rng, dt)
    np.savetxt(data, rows, delimiter=",", header=names, comments="", fmt="%.12g")
    return file


def oscillator(folder, vdp, text="", noise=None, n=400, seed=8) -> Path:
    """The oscillator of the tests of estimate with a fiftieth of its white noise, and other noise beside."""
    file = write_vdp(folder, vdp, text=text, n=n, noise=NOISE / 50)
    return noisy(file, {"x": noise or SensorNoise("x0", NOISE, 1.0, TIME)}, seed)


@pytest.mark.slow
def test_correlated_noise_is_a_state_of_the_filter(vdp, tmp_path):
    file = oscillator(tmp_path, vdp, CORRELATED)
    result = estimate(file, tmp_path / "out")
    assert result.consistent
    assert result.sensor_noise["x0"] == {"std": NOISE, "share": 1.0, "time": TIME, "band_95": {}}
    state = result.estimated["x0_noise"]
    assert (state["kind"], state["unit"]) == ("noise", "m")
    assert state["std_error"] < NOISE
    assert "informed_by_data" not in state
    assert set(result.identifiability["after"]["deviation_left"]) == {"mu"}
    mu = result.estimated["mu"]
    assert mu["value"] == pytest.approx(0.8, abs=3 * mu["std_error"])
    page = (tmp_path / "out" / "estimate.html").read_text(encoding="utf-8")
    assert "correlated over 0.25 s" in page
    white = estimate(oscillator(tmp_path, vdp))
    assert not white.consistent
    assert not {c.check: c.passed for c in white.checks}["whiteness of x0"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "near"), [("ekf", 1.0), ("square_root", 1.0), ("iterated", 1.0), ("imm", 3.0)]
)
def test_every_filter_of_whole_states_knows_it(name, near, vdp, tmp_path):
    """Several models in one filter weigh samples otherwise than one."""
    options = f'[estimate.options]\nfilter = "{name}"\nprocess_std = {{x0 = 1e-3, x1 = 1e-3}}\n'
    found = estimate(oscillator(tmp_path, vdp, CORRELATED + options))
    usual = estimate(tmp_path, options=Options(process_std={"x0": 1e-3, "x1": 1e-3}))
    mu, expected = found.estimated["mu"], usual.estimated["mu"]
    assert mu["value"] == pytest.approx(expected["value"], abs=near * expected["std_error"])
    assert mu["std_error"] == pytest.approx(expected["std_error"], rel=0.5)


@pytest.mark.slow
def test_the_smoother_knows_it(vdp, tmp_path):
    file = oscillator(tmp_path, vdp, CORRELATED)
    before, after = (
        estimate(file, options=Options(smooth=smooth, process_std={"x0": 1e-3, "x1": 1e-3}))
        for smooth in (False, True)
    )
    assert after.estimated["mu"] == before.estimated["mu"]  # the last sample knows the whole record


@pytest.mark.slow
def test_a_size_that_is_not_declared_is_the_likeliest(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp, n=800)
    file.write_text(file.read_text().replace(DECLARED, ""))
    result = estimate(file)
    low, high = result.sensor_noise["x0"]["band_95"]["std"]
    assert low < NOISE < high
    assert 0.85 < low / high < 0.95  # 800 samples say a standard deviation to within 2.5 %
    assert result.consistent
    (note,) = (n for n in result.notes if "noise of 'x0'" in n)
    assert note.startswith("the noise of 'x0' was not declared; the likelihood of the record is largest with")


@pytest.mark.slow
def test_a_declared_size_is_taken_for_uncertain_where_that_is_said(vdp, tmp_path):
    """The sensor is declared 2.5 times better than it is."""
    text = '[estimate.noise.x0]\nstd = "estimated"\n'
    file = write_vdp(tmp_path, vdp, n=800, text=text)
    file.write_text(file.read_text().replace(DECLARED, "noise_std = 0.02\n"))
    result = estimate(file)
    low, high = result.sensor_noise["x0"]["band_95"]["std"]
    assert low < NOISE < high
    assert result.consistent
    assert any(n.startswith("the noise of 'x0' was to be estimated;") for n in result.notes)


@pytest.mark.slow
def test_all_of_the_noise_can_be_found(vdp, tmp_path):
    noise = SensorNoise("x0", NOISE, 0.8, 0.5)
    file = oscillator(tmp_path, vdp, ALL, noise, n=1600)
    file.write_text(file.read_text().replace(DECLARED, ""))
    result = estimate(file)
    found = result.sensor_noise["x0"]
    assert set(found["band_95"]) == {"std", "share", "time"}
    for what, (low, high) in found["band_95"].items():
        assert low < found[what] < high
        assert 0.8 * low < getattr(noise, what) < 1.25 * high
    assert result.consistent
    mu = result.estimated["mu"]
    assert mu["value"] == pytest.approx(0.8, abs=3 * mu["std_error"])


@pytest.mark.slow
def test_where_samples_are_left_out_or_noise_adapts_roughness_says_the_size(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp)
    file.write_text(file.read_text().replace(DECLARED, ""))
    for options in (Options(gate=5.0), Options(adapt=("measurement",))):
        result = estimate(file, options=options)
        assert result.sensor_noise["x0"]["band_95"] == {}
        assert any("estimated from the roughness" in n for n in result.notes)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[estimate.noise.x9]\ntime = 0.25\n", "[estimate.noise.x9] is none of [outputs]"),
        ("[estimate.noise.x0]\nshare = 0.5\n", "has a share but no time of correlation"),
        ("[estimate.noise.x0]\ntime = 0.25\nshare = 1.5\n", "share 1.5 is above 1"),
        ("[estimate.noise.x0]\ntime = -1.0\n", 'must be a number above 0, or "estimated", not -1.0'),
        ('[estimate.noise.x0]\ntime = "long"\n', "must be a number above 0, or \"estimated\", not 'long'"),
        ("[estimate.noise.x0]\n", "says nothing; add time = ..."),
        (ALL + "[estimate.options]\ngate = 5.0\n", "'ukf', gate or adapt does not allow"),
        (
            ALL + '[estimate.options]\nfilter = "rbpf"\n',
            "'rbpf', gate or adapt does not allow",
        ),
        (CORRELATED + '[estimate.options]\nfilter = "dual"\n', "filter = 'dual' takes all but the states"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(text, said, vdp, tmp_path):
    with pytest.raises(BadInput) as refused:
        estimate(write_vdp(tmp_path, vdp, text=text))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_nothing_is_said_of_noise_by_default():
    assert Estimate().noise == {}


def rig(folder: Path, seed: int, more: str, share: float = 1.0, duration: float = 20.0) -> tuple[Path, float]:
    """A record of the rig's truth model with correlated noise on both speeds, and its friction."""
    rng = np.random.default_rng(seed)
    mu0 = float(rng.uniform(0.3, 0.5))
    file = write_record(
        folder, f"rig{seed}", rng, duration=duration, dt=0.01, parameters_true={"mu0": mu0},
        noise_std=1e-12, digits=12,
    )  # fmt: skip
    file.write_text(file.read_text().replace("1e-12", f"{RIG_NOISE}") + ASKED + more)
    of = {name: SensorNoise(name, RIG_NOISE, share, TIME) for name in ("omega_w", "omega_r")}
    return noisy(file, of, seed + 1000), mu0


def within(result: EstimateResult, true: dict[str, float]) -> list[bool]:
    """Whether the 95 % bands hold the truth."""
    bands = {name: result.estimated[name]["band_95"] for name in true}
    return [bands[name][0] <= value <= bands[name][1] for name, value in true.items()]


def test_records_of_another_model_form_pass_with_the_correlation_and_not_without(tmp_path):
    file, mu0 = rig(tmp_path, 1, BOTH)
    told, untold = estimate(file), estimate(rig(tmp_path, 1, "")[0])
    assert told.consistent
    assert not untold.consistent
    assert abs(told.estimated["mu0"]["value"] - mu0) < 3 * told.estimated["mu0"]["std_error"]


@pytest.mark.slow
def test_bands_hold_the_truth_under_correlated_noise(tmp_path):
    """Of 20 records with two parameters; 40 bands of 95 % hold 38 with a deviation of 1.4."""
    held, passed = [], 0
    for seed in range(20):
        file, mu0 = rig(tmp_path, seed, BOTH)
        result = estimate(file)
        held += within(result, {"mu0": mu0, "r_w": 0.3482})
        passed += result.consistent
    assert sum(held) >= 34
    assert passed >= 16  # 19 expected, with a deviation of 1


def late(y: np.ndarray, t: np.ndarray) -> Record:
    """A record (N, m) of two outputs."""
    whole = np.ones(len(t), np.bool_)
    run = Run(t, np.column_stack([t, t**2]), y, whole, ~whole, ~whole)
    return Record((run,), ("a", "b"), ("p", "q"), np.ones(2))


def delayed(rate: float | None = None, **delays: float) -> SimpleNamespace:
    return SimpleNamespace(file="e.toml", estimate=SimpleNamespace(delay=delays, rate=rate))


@given(st.floats(0.001, 0.5), st.floats(0.001, 0.5), st.floats(-1e3, 1e3))
def test_every_delayed_sample_is_at_the_time_that_it_shows(p, q, begin):
    t = begin + 0.1 * np.arange(30)
    shows = np.column_stack([t - p, t - q])  # each output shows the time itself
    run = undelayed(delayed(p=p, q=q), late(shows, t), True).runs[0]
    assert np.all(np.diff(run.t) > 0)
    for j, delay in enumerate((p, q)):
        seen = np.isfinite(run.y[:, j])
        assert_allclose(run.y[seen, j], run.t[seen], atol=2e-7)
        assert seen.sum() == np.sum(t - delay >= begin - 1e-7)
    assert_allclose(run.u[:, 0], run.t, atol=1e-9)
    assert np.isin(t, run.t).all()
    assert len(run.t) <= 3 * len(t)


def test_whole_samples_are_shifted_without_further_rows():
    t = 0.1 * np.arange(30)
    y = np.random.default_rng(1).normal(size=(30, 2))
    run = undelayed(delayed(q=0.3), late(y, t), False).runs[0]
    assert_array_equal(run.t, t)
    assert_array_equal(run.y[:, 0], y[:, 0])
    assert_array_equal(run.y[:-3, 1], y[3:, 1])
    assert np.isnan(run.y[-3:, 1]).all()


@pytest.mark.parametrize(
    ("e", "any_step", "said"),
    [
        (delayed(r=0.1), True, "[estimate.delay] 'r' is none of [outputs]"),
        (delayed(q=30.0), True, "[estimate.delay] q = 30 s is longer than the record of 2.9 s"),
        (delayed(q=0.12), False, "takes steps of one length alone needs delays of whole samples"),
        (delayed(rate=5.0, q=0.12), True, "rate needs delays of whole samples, which are 0.1 s apart"),
    ],
)
def test_delays_that_cannot_be_are_refused(e, any_step, said):
    t = 0.1 * np.arange(30)
    with pytest.raises(BadInput) as refused:
        undelayed(e, late(np.zeros((30, 2)), t), any_step)
    assert said in str(refused.value)


@pytest.mark.parametrize("delay", [0.1, 0.13])
def test_a_sensor_that_is_late_misleads_no_more(delay, vdp, tmp_path):
    """Two samples, and two and a half."""
    file = write_vdp(tmp_path, vdp, n=800, delay=delay)
    options = Options(process_std={"x0": 1e-3, "x1": 1e-3})
    assert not estimate(file, options=options).consistent
    file.write_text(file.read_text() + f"[estimate.delay]\nx0 = {delay}\n")
    result = estimate(file, options=options)
    assert result.consistent
    mu = result.estimated["mu"]
    assert mu["value"] == pytest.approx(0.8, abs=3 * mu["std_error"])
