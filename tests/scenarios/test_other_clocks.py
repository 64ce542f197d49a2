"""Channels with rates, start times and clocks of their own, and records that are thinned."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.noise import white_noise
from fmus.errors import BadInput
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from scenarios.experiment.sampling import at_nearest, at_times, between
from tests.helpers.experiment_files import GOOD, RIG, assert_one_clear_line, table, write
from tests.scenarios.test_readers import tdms

RNG = np.random.default_rng(5)
rates = st.sampled_from([100.0, 93.0, 80.0, 50.0, 33.3, 10.0])


def times(rate: float, begin: float = 0.0) -> np.ndarray:
    """Times within 40 s, Hz and s."""
    return begin + np.arange(int((40 - begin) * rate)) / rate


@settings(max_examples=30)
@given(rates, st.floats(0, 1), st.floats(0.02, 0.7), st.floats(0, 6))
def test_what_the_new_times_can_show_is_kept(rate, begin, share, phase):
    """A tone below the transition of the filter, at any new rate and with any start."""
    t, new = times(100.0), times(rate, begin)
    omega = np.pi * rate * share
    found = at_times(new, t, np.cos(omega * t + phase))
    inner = (new > 1 + 10 / rate) & (new < 38 - 10 / rate)
    assert_allclose(found[inner], np.cos(omega * new[inner] + phase), atol=0.006)


@settings(max_examples=30)
@given(st.sampled_from([80.0, 50.0, 33.3, 10.0]), st.floats(0, 1), st.floats(1.26, 4))
def test_what_the_new_times_cannot_show_does_not_come_back_as_something_else(rate, begin, share):
    t, new = times(100.0), times(rate, begin)
    omega = np.pi * rate * share
    if omega > 0.95 * np.pi * 100:
        return
    found = at_times(new, t, np.cos(omega * t))
    inner = (new > 1 + 10 / rate) & (new < 38 - 10 / rate)
    assert np.abs(found[inner]).max() < 0.012


@pytest.mark.parametrize(
    ("rate", "begin"), [(100, 0.005), (100, 0.002), (90, 0.001), (80, 0), (40, 0), (7, 0.1)]
)
def test_white_noise_stays_white_with_the_size_that_its_share_of_the_band_has(rate, begin):
    t = np.arange(60_000) / 100
    new = begin + np.arange(int(590 * rate)) / rate
    found = at_times(new, t, RNG.normal(0, 2.0, t.size))
    assert found.std() == pytest.approx(2 * np.sqrt(rate / 100), rel=0.06)
    assert white_noise([found]) == pytest.approx(found.std(), rel=0.14)
    for k in (1, 2, 3):
        assert abs(np.corrcoef(found[k:], found[:-k])[0, 1]) < 0.12


@given(st.integers(2, 9), st.integers(0, 50))
def test_samples_at_the_new_times_are_taken_as_they_are(n, first):
    t = times(100.0)
    x = RNG.normal(size=t.size)
    assert_array_equal(at_times(t[first : 100 + first], t, x), x[first : 100 + first])
    assert_array_equal(between(t[first:200:n], t, x), x[first:200:n])


def test_there_is_no_number_outside_a_channel_or_beside_a_lost_sample():
    t = times(10.0, 1.0)
    x = np.sin(t)
    x[100] = np.nan
    new = times(10.0, 0.05)
    for of in (at_times, between):
        nothing = new[np.isnan(of(new, t, x))]
        assert_allclose(nothing, [*np.arange(0.05, 1, 0.1), t[100] - 0.05, t[100] + 0.05], atol=1e-9)
    assert np.isnan(at_times(new, t, np.full(t.size, np.nan))).all()


def test_there_is_no_number_in_a_gap_and_one_beside_it():
    t = np.concatenate([times(10.0)[:100], times(10.0)[120:]])
    new = times(4.0)
    found = np.isnan(at_times(new, t, np.sin(t)))
    assert_array_equal(new[found], new[(new > t[99]) & (new < t[100])])
    assert np.abs(at_times(new, t, np.sin(t)) - np.sin(new))[~found][3:-3].max() < 0.05


def test_a_time_before_a_clock_was_set_costs_nothing():
    """A first row of 1970, as loggers write before they know the time."""
    t = np.concatenate([[0.0], 1.7e9 + times(100.0)])
    new = 1.7e9 + times(40.0)
    assert_allclose(at_times(new, t, np.sin(t - 1.7e9)), np.sin(new - 1.7e9), atol=0.03)


def test_many_short_gaps_let_no_alias_through():
    """A logger that loses a packet every half second: a tone above the new band stays out of it."""
    t = times(1000.0)
    kept = t[np.arange(t.size) % 500 > 7]
    new = times(100.0, 0.5)[:-100]
    found = at_times(new, kept, np.cos(2 * np.pi * 60 * kept))
    assert np.sqrt(np.nanmean(found**2)) < 0.07


def test_a_slow_channel_has_a_number_at_the_nearest_times_alone():
    t, new = times(3.0), times(100.0)
    found = at_nearest(new, t, np.sin(t))
    there = np.isfinite(found)
    assert there.sum() == np.count_nonzero(t <= new[-1])
    assert np.abs(new[there] - t[: there.sum()]).max() <= 0.005 + 1e-9
    assert_allclose(found[there][5:-5], np.sin(new[there])[5:-5], atol=1e-3)


def test_a_linear_relation_holds_behind_the_filter_and_not_without():
    """The same filter acts on input and output: the derivative of a channel stays that of the other."""
    t = times(1000.0)
    tone = 2 * np.pi * 440
    u, y = np.sin(t) + 0.5 * np.cos(tone * t), -np.cos(t) + 0.5 * np.sin(tone * t) / tone
    new = times(25.0, 2.0)[:-60]
    for filtered, least, most in ((True, 0.0, 0.01), (False, 0.3, 1.0)):
        v, x = ((at_times(new, t, z) if filtered else z[np.searchsorted(t, new)]) for z in (u, y))
        left = np.gradient(x, new) - v
        assert least <= np.abs(left[5:-5]).max() <= most


# records

CLOCK = '[files.tacho]\nfile = "tacho.csv"\ntime = "clock"\noffset = 3.0\n\n'
TACHO = GOOD.replace("[split]", CLOCK + "[split]").replace(
    'column = "n_wheel"\n', 'column = "n"\nfile = "tacho"\n'
)


def wheel(t: np.ndarray) -> np.ndarray:
    """Speed of the wheel of the table without noise, rpm."""
    return (12 + 6 * np.tanh((t - 4) / 2) + 0.3 * np.sin(3 * t)) * 30 / np.pi


def two_files(folder: Path, rate: float, offset: float = 3.0, toml: str = TACHO, begin: float = 0.0) -> Path:
    """The good experiment, with a tacho of its own clock that runs `offset` behind."""
    file = write(folder, toml)
    t = begin + np.arange(int((10 - begin) * rate) + 1) / rate
    pd.DataFrame({"clock": t - offset, "n": wheel(t)}).to_csv(folder / "tacho.csv", index=False)
    return file


def load(file: Path, **options):
    return load_record(load_experiment(file), RIG, **options)


@pytest.mark.parametrize("rate", [100, 101.3, 250, 2000])
def test_a_channel_of_another_clock_is_used_at_the_times_of_the_record(tmp_path, rate):
    [run] = (record := load(two_files(tmp_path, rate))).runs
    rpm = np.pi / 30
    assert_allclose(run.y[30:-30, 0], wheel(run.t[30:-30]) * rpm, atol=2e-3)
    assert_allclose(run.y[:, 0], wheel(run.t) * rpm, atol=0.05)  # the ends of the filter
    told = [n.sentence for n in record.notes if n.kind == "file"]
    assert len(told) == 1
    assert "tacho.csv: column 'tacho: n'" in told[0]
    assert ("low-pass filtered and used at 100 Hz" in told[0]) == (rate > 120)
    assert [c.column for c in record.conversions] == ["tacho: n", "accel", "torque"]


def test_the_record_is_cut_to_what_all_files_cover(tmp_path):
    toml = TACHO.replace("identify = [0.0,", "identify = [2.5,")
    [run] = (record := load(two_files(tmp_path, 250, toml=toml, begin=2.4))).runs
    assert run.t[0] == pytest.approx(2.4)
    assert any("cut to 2.4 to 10 s, in which all files have samples" in n.sentence for n in record.notes)
    assert np.isfinite(run.y).all()


def test_an_output_that_is_slower_than_the_record_is_refused_with_the_ways_out(tmp_path):
    file = two_files(tmp_path, 40)
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, "write rate = 33.3333, or make tacho.csv the data")
    file.write_text(f"rate = {100 / 3}\n" + TACHO)
    [run] = load(file).runs
    assert np.diff(run.t) == pytest.approx(0.03)
    assert_allclose(run.y[10:-10, 0], wheel(run.t[10:-10]) * np.pi / 30, atol=2e-3)


def test_a_filter_has_a_slow_output_at_the_nearest_rows(tmp_path):
    [run] = load(two_files(tmp_path, 4), missing=True).runs
    there = np.isfinite(run.y[:, 0])
    assert there.sum() == 41
    assert_allclose(run.t[there], np.arange(41) / 4, atol=0.0051)
    assert_allclose(run.y[there, 0][3:-3], wheel(run.t[there])[3:-3] * np.pi / 30, rtol=0.02)


def test_a_slow_input_is_straight_between_its_samples(tmp_path):
    toml = GOOD.replace('T_P = "torque"', 'T_P = {column = "T", file = "slow"}').replace(
        "[split]", '[files.slow]\nfile = "slow.csv"\ntime = "t"\n\n[split]'
    )
    file = write(tmp_path, toml)
    t = np.arange(0, 11, 2.0)
    pd.DataFrame({"t": t, "T": np.cos(t)}).to_csv(tmp_path / "slow.csv", index=False)
    [run] = (record := load(file)).runs
    assert_allclose(run.u[:, 0], np.interp(run.t, t, np.cos(t)), atol=1e-12)
    assert any("slower than the record; values between are straight" in n.sentence for n in record.notes)


def test_clocks_without_a_common_time_are_refused_with_both_spans(tmp_path):
    file = two_files(tmp_path, 100, offset=-5000.0)
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, "no time in common: data.csv 0 to 10 s, tacho.csv 5003 to 5013 s")


@pytest.mark.parametrize("zone", ["", "+01:00"])
def test_dates_set_the_clocks_and_an_offset_comes_on_top(tmp_path, zone):
    noon = datetime(2026, 3, 1, 12)
    columns = table()
    columns["time"] = [(noon + timedelta(seconds=float(t))).isoformat() for t in columns["time"]]
    file = write(tmp_path, TACHO.replace("offset = 3.0", "offset = 0.25"), table())
    pd.DataFrame(columns).to_csv(tmp_path / "data.csv", index=False)
    t = np.arange(2001) / 200
    dates = [(noon + timedelta(seconds=float(s) - 0.25)).isoformat() + zone for s in t]
    pd.DataFrame({"clock": dates, "n": wheel(t)}).to_csv(tmp_path / "tacho.csv", index=False)
    if zone:
        with pytest.raises(BadInput, match=r"have a time zone .*, those of another one have none"):
            load(file)
        return
    [run] = load(file).runs
    assert_allclose(run.y[30:-30, 0], wheel(run.t[30:-30]) * np.pi / 30, atol=2e-3)


def test_a_file_may_have_several_clocks(tmp_path):
    t, fast = table()["time"], np.arange(5001) / 500
    groups = {"log": table() | {"time": t}, "fast": {"time": fast, "n": wheel(fast)}}
    tdms(tmp_path / "data.tdms", groups)
    toml = TACHO.replace("data.csv", "data.tdms").replace('time = "time"', 'time = "log/time"')
    toml = toml.replace('file = "tacho.csv"\ntime = "clock"\noffset = 3.0', 'time = "fast/time"')
    (tmp_path / "experiment.toml").write_text(toml)
    [run] = load(tmp_path / "experiment.toml").runs
    assert_allclose(run.y[30:-30, 0], wheel(run.t[30:-30]) * np.pi / 30, atol=2e-3)
    apart = toml.replace('file = "tacho"\n', "")
    (tmp_path / "experiment.toml").write_text(apart)
    with pytest.raises(BadInput, match=r"rows of its own.*or declare \[files.NAME\]"):
        load(tmp_path / "experiment.toml")


def test_waveforms_of_one_file_are_put_together_by_their_start_times(tmp_path):
    from nptdms import ChannelObject, TdmsWriter

    noon, t, fast = datetime(2026, 3, 1, 12), table()["time"], np.arange(5001) / 500
    step, columns = float(t[1] - t[0]), table()

    def wave(begin, step, offset=0.0):
        return {"wf_increment": step, "wf_start_offset": offset, "wf_start_time": noon + timedelta(0, begin)}

    with TdmsWriter(str(tmp_path / "data.tdms")) as writer:
        log = [ChannelObject("log", n, x, wave(1.0, step)) for n, x in columns.items() if n != "time"]
        writer.write_segment([*log, ChannelObject("fast", "n", wheel(fast), wave(3.5, 0.002, -2.5))])
    toml = TACHO.replace("data.csv", "data.tdms").replace('time = "time"', 'time = "log/time"')
    toml = toml.replace('file = "tacho.csv"\ntime = "clock"\noffset = 3.0', 'time = "fast/time"')
    (tmp_path / "experiment.toml").write_text(toml)
    [run] = (record := load(tmp_path / "experiment.toml")).runs
    assert_allclose(run.y[30:-30, 0], wheel(run.t[30:-30]) * np.pi / 30, atol=2e-3)
    assert any("'fast/time' begins 2.5 s after 'log/time'" in n.sentence for n in record.notes)


def test_a_derivative_may_be_that_of_another_clock(tmp_path):
    toml = TACHO.replace('derivative = "omega"', 'derivative = "n"\nfile = "tacho"').replace(
        '"rad/s2"', '"rpm/s"'
    )
    [run] = load(two_files(tmp_path, 250, toml=toml)).runs
    slope = np.gradient(wheel(run.t), run.t) * np.pi / 30
    assert_allclose(run.y[50:-50, 1], slope[50:-50], atol=0.02)


def test_units_of_another_file_are_compared_and_converted(tmp_path):
    file = two_files(tmp_path, 250)
    (tmp_path / "tacho.csv.units.json").write_text('{"n": "rad/s", "clock": "s"}')
    with pytest.raises(BadInput, match=r"tacho\.csv states 'rad/s' for it"):
        load(file)
    other = tmp_path / "tacho.csv"
    ms = pd.read_csv(other)
    ms.assign(clock=ms["clock"] * 1e3).to_csv(other, index=False)
    (tmp_path / "tacho.csv.units.json").write_text('{"n": "rpm", "clock": "ms"}')
    [run] = load(file).runs
    assert_allclose(run.y[30:-30, 0], wheel(run.t[30:-30]) * np.pi / 30, atol=2e-3)


def test_a_record_is_thinned_behind_the_filter(tmp_path):
    columns = table(10_001)
    columns["n_wheel"] = columns["n_wheel"] + 5 * np.cos(2 * np.pi * 230 * columns["time"])
    file = write(tmp_path, "rate = 100\n" + GOOD, columns)
    [run] = (record := load(file)).runs
    assert np.diff(run.t) == pytest.approx(0.01)
    assert_allclose(run.y[20:-20, 0], wheel(run.t[20:-20]) * np.pi / 30, atol=0.01)
    assert any("1000 Hz, is low-pass filtered and used at 100 Hz" in n.sentence for n in record.notes)


def test_a_rate_that_changes_nothing_leaves_the_record_as_it_is(tmp_path):
    [one], [other] = load(write(tmp_path / "a", "rate = 100\n" + GOOD)).runs, load(write(tmp_path / "b")).runs
    assert_array_equal(one.t, other.t)
    assert_array_equal(one.y, other.y)
    assert_array_equal(one.u, other.u)


PARTS = TACHO.replace("identify = [0.0, 6.0]", 'identify_data = "data.csv"').replace(
    "test = [6.0, 10.0]", 'test_data = "data.csv"'
)
WRONG = {
    "rate = 70\n" + GOOD: "rate = 70 Hz is no whole part of the 100 Hz of data.csv; take 50 or 100",
    "rate = 300\n" + GOOD: "rate = 300 Hz is no whole part of the 100 Hz of data.csv; take 100 or less",
    TACHO.replace('file = "tacho"', 'file = "tach"'): "file = 'tach' is none of [files]; they are tacho",
    GOOD.replace('"torque"', '{column = "torque", file = "x"}'): "is none of [files]; add [files.NAME]",
    TACHO.replace('"clock"', '"clok"'): "[files.tacho] time: column 'clok' is not in",
    TACHO.replace('column = "n"', 'column = "m"'): "[outputs.omega_w]: column 'm' is not in",
    TACHO.replace("tacho.csv", "taco.csv"): "data file cannot be read",
    TACHO.replace("offset = 3.0", "skprows = 1"): "cannot be read with the options skprows",
    PARTS: "[files.tacho] file = 'tacho.csv' beside [split] with files of its own",
}


@pytest.mark.parametrize("toml", WRONG, ids=list(WRONG.values()))
def test_what_is_wrong_is_one_clear_line(tmp_path, toml):
    file = two_files(tmp_path, 250, toml=toml)
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, WRONG[toml])
