"""A stream through one filter: cuts and restarts change no bit, alarms come soon, bad windows are told."""

import gc
import resource
import shutil
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import psutil
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from estimator.monitoring.monitor import Settings
from fmus import codec
from fmus.errors import BadInput
from fmus.host.archive import Archive
from scenarios.estimating.estimating import fmu_of
from scenarios.estimating.findings import find
from scenarios.estimating.setup import set_up
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from scenarios.watching import checkpoint
from scenarios.watching.capturing import Capturing
from scenarios.watching.checkpoint import Checkpoint
from scenarios.watching.commission import Making, commissioned
from scenarios.watching.declaration import Trace
from scenarios.watching.following import LEARNING, OUTSIDE, PAST, TESTED, Following
from scenarios.watching.joining import Joining
from scenarios.watching.logging import FILE as LOG
from scenarios.watching.logging import Log, seconds
from scenarios.watching.watching import watch
from scenarios.watching.windows import Reading, follow_on
from tests.helpers.streams import (
    DT,
    record,
    write_experiment,
    write_watch,
    write_windows,
)
from tests.truth.rig import single

SECONDS = 16.0
QUICK = Settings(false_alarms_per_hour=0.1, block=0.25, learn=8.0, settle=1.0, quiet=60.0)
LAPS = 6  # of the same windows, while memory is watched
STEP = 40.0  # s
SOON = 3.0  # s of record, within which a friction step is to be found


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stream")
    with opened(folder, record(21, SECONDS)) as rig:
        yield rig


@contextmanager
def opened(folder: Path, data: pd.DataFrame) -> Iterator[SimpleNamespace]:
    """An experiment whose record is the stream as a whole, its FMU, and the filter that it sets up."""
    e = load_experiment(write_experiment(folder, data))
    with Archive(fmu_of(e, folder)) as archive:
        loaded = load_record(e, archive.description, missing=True)
        c = commissioned(e, archive, loaded, lambda _: None)
        making = Making(e, c, archive)
        yield SimpleNamespace(
            e=e, archive=archive, record=loaded, c=c, making=making, data=data, folder=folder
        )
        making.joint.close()


def windows(rig, folder, data, cuts, more=()):
    """The windows of a stream, read from their files."""
    reading = Reading(rig.e, rig.record.conversions, more)
    return [reading.read(f.name, f) for f in write_windows(folder, data, cuts)]


def following(rig, triggers=(), settings=QUICK):
    return Following(rig.c, rig.making, settings, triggers)


def state(f, c):
    """Everything that is carried, as bytes."""
    kept = Checkpoint(
        c, f.carried.kept(), f.monitor.state, f.until, f.begun, (), f.counts, 0, estimates=f.estimates
    )
    stream = BytesIO()
    codec.write(stream, kept, types=checkpoint.TYPES)
    return stream.getvalue()


def without_counts(f, c):
    """The same without the number of windows, in which cuts differ."""
    f.counts = type(f.counts)(**{
        **vars(f.counts), "windows": 0, "tested": 0, "learning": 0
    })  # fmt: skip
    return state(f, c)


@given(cuts=st.lists(st.integers(1, round(SECONDS / DT) - 1), max_size=8))
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_where_the_stream_is_cut_changes_no_bit(rig, tmp_path, cuts):
    whole, parts = following(rig), following(rig)
    shutil.rmtree(tmp_path / "w", ignore_errors=True)
    for f, at in ((whole, []), (parts, cuts)):
        for window in windows(rig, tmp_path / "w", rig.data, at):
            assert f.take(window).state in (TESTED, LEARNING)
        shutil.rmtree(tmp_path / "w")
    assert without_counts(parts, rig.c) == without_counts(whole, rig.c)


def test_the_stream_ends_where_estimate_ends_to_the_bit(rig, tmp_path):
    setup = set_up(rig.e, rig.e.estimate.options, rig.record, rig.archive)
    found = find(setup, rig.archive, lambda _: None)
    f = following(rig)
    for window in windows(rig, tmp_path, rig.data, range(100, 1600, 130)):
        f.take(window)
    last, now = found.history.last, f.carried.now
    found.joint.close()
    for name in ("x", "P", "S", "innovation", "u", "x_prior", "P_prior"):
        assert_array_equal(getattr(now, name), getattr(last, name))
    assert f.counts.samples == len(found.history.t)
    assert f.counts.log_likelihood == pytest.approx(found.history.log_likelihood, rel=1e-12)
    assert f.estimates["r_w"] == found.value[-1, list(found.history.names).index("r_w")]


@pytest.mark.parametrize("kind", ["ekf", "dual"])
def test_every_filter_goes_on_from_a_checkpoint_to_the_bit(rig, tmp_path, kind):
    options = rig.e.estimate.options.model_copy(update={"filter": kind})
    e = rig.e.model_copy(update={"estimate": rig.e.estimate.model_copy(update={"options": options})})
    making = Making(e, rig.c, rig.archive)
    first, *rest = windows(rig, tmp_path, rig.data, [300, 700])
    one, two = (Following(rig.c, making, QUICK, ()) for _ in range(2))
    one.take(first)
    kept = codec.read(BytesIO(state(one, rig.c)), types=checkpoint.TYPES)
    two.go_on(kept)
    for window in rest:
        one.take(window), two.take(window)
    making.joint.close()
    assert state(one, rig.c) == state(two, rig.c)


def test_noise_that_is_correlated_goes_on_from_a_checkpoint_to_the_bit(rig, tmp_path):
    sensors = tuple(replace(n, share=0.5, time=0.1) for n in rig.c.sensors)
    c = replace(rig.c, sensors=sensors)
    making = Making(rig.e, c, rig.archive)
    assert making.joint.names[-2:] == ("omega_w_noise", "omega_r_noise")
    first, *rest = windows(rig, tmp_path, rig.data, [300, 700])
    one, two = (Following(c, making, QUICK, ()) for _ in range(2))
    one.take(first)
    kept = codec.read(BytesIO(state(one, c)), types=checkpoint.TYPES)
    assert kept.commissioned.sensors == sensors
    two.go_on(kept)
    for window in rest:
        one.take(window), two.take(window)
    making.joint.close()
    assert state(one, c) == state(two, c)


def test_a_stream_has_no_delayed_outputs(rig):
    asked = rig.e.estimate.model_copy(update={"delay": {"omega_w": 0.02}})
    e = rig.e.model_copy(update={"estimate": asked})
    with pytest.raises(BadInput, match=r"\[estimate.delay\] needs a whole record"):
        commissioned(e, rig.archive, rig.record, lambda _: None)


@pytest.mark.parametrize("kind", ["imm", "rbpf"])
def test_a_filter_that_a_gap_would_break_is_refused(rig, kind):
    options = rig.e.estimate.options.model_copy(update={"filter": kind})
    e = rig.e.model_copy(update={"estimate": rig.e.estimate.model_copy(update={"options": options})})
    making = Making(e, rig.c, rig.archive)
    with pytest.raises(BadInput, match=f"filter = '{kind}' knows more than mean and covariance"):
        making.carried()
    making.joint.close()


def lines(folder: Path) -> pd.DataFrame:
    """The log without the time that each window took."""
    return pd.read_csv(folder / LOG).drop(columns="milliseconds")


def test_a_command_that_is_stopped_between_windows_ends_as_one_that_is_not(tmp_path):
    """Also its log and its checkpoint, to the bit; windows that lie there already come in one go."""
    data = record(22, 14.0)
    for name in ("whole", "parts"):
        write_experiment(tmp_path / name, record(23, 10.0))
        write_watch(tmp_path / name, "most = 0", learn=4.0)
    write_windows(tmp_path / "whole" / "windows", data, range(0, 1400, 200))
    watch(tmp_path / "whole", tmp_path / "whole" / "out", once=True)
    files = sorted((tmp_path / "whole" / "windows").iterdir())
    (tmp_path / "parts" / "windows").mkdir()
    for some in (files[:3], files[3:]):
        for file in some:
            shutil.copy(file, tmp_path / "parts" / "windows")
        watch(tmp_path / "parts", tmp_path / "parts" / "out", once=True)
    whole, parts = (tmp_path / name / "out" for name in ("whole", "parts"))
    pd.testing.assert_frame_equal(lines(whole), lines(parts))
    assert (whole / "watch.json").read_bytes() == (parts / "watch.json").read_bytes()
    read = [checkpoint.read(f, _key(f)) for f in (whole, parts)]
    assert_array_equal(read[0].filter.estimate[1], read[1].filter.estimate[1])
    assert read[0].monitor.blocks == read[1].monitor.blocks


def _key(out: Path) -> str:
    from scenarios.watching.declaration import load_watching

    declared = load_watching(out.parent)
    return checkpoint.key_of(declared, load_experiment(out.parent / "experiment.toml"), None)


def test_a_checkpoint_belongs_to_the_record_and_the_units_beside_it(tmp_path):
    """By them windows are converted: with others, the filter would go on in other units."""
    data = record(3, 1.0)
    file = write_experiment(tmp_path, data)
    file.write_text(file.read_text().replace("data.parquet", "data.csv"))
    write_watch(tmp_path)
    found = []
    for name, text in (
        ("data.csv", data.to_csv(index=False)), ("data.csv.units.json", '{"T_P": "kN.m"}'),
        ("data.csv.units.json", '{"T_P": "N.m"}'), ("data.csv", data.iloc[1:].to_csv(index=False)),
    ):  # fmt: skip
        (tmp_path / name).write_text(text)
        found.append(_key(tmp_path / "out"))
    assert len({*found}) == 4


@pytest.mark.parametrize(("seed", "correlated"), [(31, False), (32, True)])
def test_a_friction_step_is_found_within_three_seconds(tmp_path, seed, correlated):
    """The friction falls from 0.4 to 0.28; noise is white, or correlated over ten samples."""
    effects = single("parameter_step", "mu0", mu0_step=-0.12, mu0_step_time=STEP)
    data = record(seed, STEP + 6.0, effects, correlated)
    write_experiment(tmp_path, record(seed + 100, 10.0, correlated=correlated))
    write_windows(tmp_path / "windows", data, range(0, len(data), 100))
    write_watch(tmp_path, "after = 4.0\nbefore = 15.0")
    found = watch(tmp_path, tmp_path / "out", once=True)
    assert found.counts.alarms == 1
    log = lines(tmp_path / "out")
    [alarm] = log[log["notes"].str.contains("ALARM", na=False)].itertuples()
    assert STEP < alarm.end <= STEP + SOON + 1.0  # the window that holds the alarm
    t = float(alarm.notes.partition("t = ")[2].partition(" s")[0])
    assert STEP < t <= STEP + SOON
    event = load_experiment(tmp_path / "out" / "events" / "000001" / "experiment.toml")
    kept = pd.read_parquet(event.data_files[0])
    assert kept["time"].iloc[0] < STEP - 5
    assert event.split.identify[0] < STEP < event.split.identify[1] < event.split.test[1]
    pd.testing.assert_frame_equal(
        kept.reset_index(drop=True)[list(data.columns)],
        data[data["time"].between(kept["time"].iloc[0], kept["time"].iloc[-1])].reset_index(drop=True),
    )


def test_late_repeated_and_overlapping_windows(rig, tmp_path):
    first, second, third = windows(rig, tmp_path / "a", rig.data, [400, 800])
    overlapping = windows(rig, tmp_path / "b", rig.data.iloc[300:800], [])[0]
    f, clean = following(rig), following(rig)
    assert f.take(first).state == LEARNING
    told = f.take(overlapping)
    assert "100 rows overlap" in told.notes[0]
    assert f.take(second).state == PAST  # sent before, as a part of another window
    assert f.take(first).state == PAST
    f.take(third)
    for window in (first, second, third):
        clean.take(window)
    assert f.counts.past == 2
    assert without_counts(clean, rig.c) == without_counts(
        SimpleNamespace(**{**_fields(f), "counts": _unpast(f.counts)}), rig.c
    )


def _fields(f):
    return {name: getattr(f, name) for name in ("carried", "monitor", "until", "begun", "estimates")}


def _unpast(counts):
    return type(counts)(**{**vars(counts), "past": 0})


def test_after_a_gap_the_filter_begins_anew_with_its_parameters(rig, tmp_path):
    gone = rig.data.drop(range(500, 620))
    f = following(rig)
    before, after = windows(rig, tmp_path, gone, [500])
    f.take(before)
    r_w, error = f.estimates["r_w"], f.estimates["r_w_std"]
    told = f.take(after)
    assert f.counts.gaps == 1
    assert "no data from 4.99 to 6.2 s: the filter begins anew" in told.notes[0]
    assert abs(f.estimates["r_w"] - r_w) < 4 * error
    assert f.estimates["r_w_std"] <= error
    inside = following(rig)
    inside.take(windows(rig, tmp_path / "one", gone, [])[0])  # the same gap within one window
    assert without_counts(inside, rig.c) == without_counts(f, rig.c)


def test_a_short_gap_is_bridged(rig, tmp_path):
    f = following(rig)
    f.take(windows(rig, tmp_path, rig.data.drop(range(500, 503)), [])[0])
    assert f.counts.gaps == 0
    assert f.counts.samples == len(rig.data) - 3


def spoiled(rig, tmp_path, change):
    """What is read from one window with a change."""
    file = tmp_path / "w.parquet"
    change(rig.data.iloc[:200].copy()).to_parquet(file)
    return Reading(rig.e, rig.record.conversions, ()).read("w", file)


def test_rows_out_of_order_and_twice_are_mended(rig, tmp_path):
    sound = spoiled(rig, tmp_path, lambda d: d)
    rng = np.random.default_rng(3)
    mixed = spoiled(rig, tmp_path, lambda d: pd.concat([d, d.iloc[50:60]]).iloc[rng.permutation(210)])
    assert_array_equal(mixed.rows.t, sound.rows.t)
    assert_array_equal(mixed.rows.y, sound.rows.y)
    assert mixed.notes == ("rows were sorted by time", "10 rows repeat a time and are left out")


def test_a_missing_output_is_not_measured_and_other_columns_are_told(rig, tmp_path):
    window = spoiled(rig, tmp_path, lambda d: d.drop(columns="omega_r").assign(more=1.0))
    assert np.isnan(window.rows.y[:, 1]).all()
    assert window.notes == ("column 'omega_r' is missing: its output is not measured",)
    f = following(rig)
    assert f.take(window).state == LEARNING
    assert f.counts.freedom == 200  # one channel at each sample
    with pytest.raises(ValueError, match="has no column 'T_P' of an input"):
        spoiled(rig, tmp_path, lambda d: d.drop(columns="T_P"))
    with pytest.raises(ValueError, match="has no time column 'time'"):
        spoiled(rig, tmp_path, lambda d: d.drop(columns="time"))
    with pytest.raises(ValueError, match="no row with a time"):
        spoiled(rig, tmp_path, lambda d: d.assign(T_P=np.nan))


def test_a_window_in_another_unit_is_refused(rig, tmp_path):
    file = tmp_path / "w.csv"
    rig.data.iloc[:50].to_csv(file, index=False)
    (tmp_path / "w.csv.units.json").write_text('{"omega_w": "rpm"}')
    with pytest.raises(ValueError, match="changed its unit from 'rad/s' to 'rpm'"):
        Reading(rig.e, rig.record.conversions, ()).read("w", file)


def test_a_window_in_g_is_one_in_standard_gravity_if_that_is_declared(rig, tmp_path):
    """As in the record with which the filter was set up."""
    file = tmp_path / "w.csv"
    rig.data.iloc[:50].to_csv(file, index=False)
    (tmp_path / "w.csv.units.json").write_text('{"omega_w": "g"}')
    declared = [replace(c, unit="g_0") if c.variable == "omega_w" else c for c in rig.record.conversions]
    found = Reading(rig.e, declared, ()).read("w", file)
    assert len(found.rows.t) == 50


def test_a_word_of_the_files_of_a_stream_does_not_outdo_the_declared_unit(rig, tmp_path):
    file = tmp_path / "w.csv"
    rig.data.iloc[:50].to_csv(file, index=False)
    plain = Reading(rig.e, rig.record.conversions, ()).read("w", file)
    (tmp_path / "w.csv.units.json").write_text('{"omega_w": "Kästchen"}')
    assert_array_equal(Reading(rig.e, rig.record.conversions, ()).read("w", file).rows.y, plain.rows.y)


@pytest.mark.parametrize("sign", [".", ","])
def test_dates_count_from_1970_so_that_windows_follow_one_another(rig, tmp_path, sign):
    dates = pd.to_datetime("2026-01-02T03:04:05") + pd.to_timedelta(rig.data["time"], unit="s")
    dates = dates.dt.strftime("%Y-%m-%dT%H:%M:%S.%f").str.replace(".", sign)
    found = [
        Reading(rig.e, rig.record.conversions, ()).read(f.name, f)
        for f in write_windows(tmp_path, rig.data.assign(time=dates), [800])
    ]
    assert found[0].begin == pd.Timestamp("2026-01-02T03:04:05").timestamp()
    assert found[1].begin - found[0].end == pytest.approx(DT, abs=1e-6)


def test_windows_with_a_clock_of_their_own_follow_on(rig, tmp_path):
    window = spoiled(rig, tmp_path, lambda d: d)
    moved = follow_on(window, "time", 100.0, DT)
    assert moved.begin == 100.0 + DT
    assert moved.columns["time"][-1] == moved.end == pytest.approx(100.0 + 200 * DT)


@given(order=st.permutations(range(8)), hold=st.integers(0, 8))
def test_windows_come_in_order_if_enough_are_held_back(order, hold):
    joining, until, taken = Joining(hold, 0.05), -np.inf, []
    made = [SimpleNamespace(begin=float(i), end=i + 0.99) for i in range(8)]

    def take(ready):
        nonlocal until
        for window in ready:
            taken.append(int(window.begin))
            until = max(until, window.end)

    for i in order:
        take(joining.ready(until, made[i]))
    take(joining.ready(until, flush=True))
    assert sorted(taken) == list(range(8))
    first = order.index(0)
    if first == 0 and hold == 8:
        assert taken == sorted(taken)


def test_a_window_outside_a_trigger_is_not_filtered(rig, tmp_path):
    from scenarios.watching.triggers import TRIGGERS

    band = TRIGGERS["band"](column="omega_w", low=1.0, high=100.0)
    stopped = rig.data.copy()
    stopped.loc[500:799, "omega_w"] = 0.0
    f = following(rig, (band,))
    states = [f.take(w).state for w in windows(rig, tmp_path, stopped, [500, 800], ("omega_w",))]
    assert states == [LEARNING, OUTSIDE, LEARNING]
    assert f.counts.samples == len(rig.data) - 300
    assert f.counts.outside == 1


def test_directions_of_likeness_are_responses_of_the_fmu(rig):
    """A torque on the wheel speeds both bodies up, which the contact couples; a gain acts with its input."""
    tried = rig.making.directions()
    forces = ("a force at 'T_w_ext'", "a force at 'T_r_ext'")
    gains = ("another gain of 'T_P'", "another gain of 'f_sync'")
    assert tried.names == (*forces, "another value of 'mu0'", *gains)
    y = rig.data[["omega_w", "omega_r"]].to_numpy()[:1]
    x = rig.making.start(0.0, np.zeros((1, 2)), y, None).x
    rolling, braking = (tried.at(x, np.array([T_P, 7.5]), 0.0) for T_P in (0.0, 500.0))
    assert np.all(rolling[0] > 0)
    assert np.all(rolling[3] == 0)  # a gain of no torque changes nothing
    assert np.all(braking[3] < 0)
    for found in (rolling, braking):
        length = np.linalg.norm(found, axis=1)
        assert np.all((np.abs(length - 1) < 1e-12) | (length == 0))


def memory(folder: Path) -> list[int]:
    """Resident memory in bytes of this process after each lap of the same 80 windows, (laps,)."""
    with opened(folder, record(21, SECONDS)) as rig:
        short = windows(rig, folder, rig.data.iloc[:800], range(0, 800, 10))
        f = following(rig)
        process, sizes = psutil.Process(), []
        for lap in range(LAPS):
            for w in short:
                f.take(follow_on(w, "time", f.until, DT))
            gc.collect()
            sizes.append(process.memory_info().rss)
            assert f.counts.windows == 80 * (lap + 1)
        return sizes


def test_memory_is_constant(tmp_path):
    """Between the window 160 and 480; one window's rows are 5 kB.

    That of a process of its own: other tests would have left memory to give back or to fill, and
    tracemalloc also counts what numba has given back.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as processes:
        sizes = processes.submit(memory, tmp_path).result()
    assert sizes[-1] - sizes[1] < 800_000


def test_windows_are_kept_as_long_as_an_alarm_may_date_a_change_back(tmp_path):
    """Two minutes back, of which the half minute before the change is part."""
    capturing = Capturing(tmp_path, SimpleNamespace(), Trace(before=30.0, after=20.0))
    for begin in np.arange(0.0, 1000.0, 5.0).tolist():
        table = pd.DataFrame({"t": [begin, begin + 4.9]})
        capturing.add(SimpleNamespace(table=lambda t=table: t, units={}, begin=begin, end=begin + 4.9))
        capturing.tidy()
    first, last = capturing.pieces[0].begin, capturing.pieces[-1].end
    assert 195.0 < last - first < 206.0
    assert len(list((tmp_path / "recent").iterdir())) == len(capturing.pieces)


@pytest.mark.parametrize(
    ("t", "text"), [(61.5, "61.5"), (0.1 + 0.2, "0.3"), (1767323045.37, "1767323045.37"), (1e-9, "0")]
)
def test_a_time_is_read_to_the_millisecond_also_in_seconds_since_1970(t, text):
    assert seconds(t) == text


def test_a_line_that_the_disk_takes_in_part_is_not_in_the_log(tmp_path):
    log = Log(tmp_path, ["x"], None)
    log.line({"window": "a"}, {"x": 1.0})
    file = tmp_path / "windows.csv"
    before = file.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 10, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            log.line({"window": "b" * 100}, {"x": 2.0})
        assert file.read_bytes() == before
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    log.line({"window": "c"}, {"x": 3.0})
    assert file.read_bytes() == before + b"c,,,,,,,,,,3.0\n"
