"""Experiments drafted from the files of several loggers: which is the record, how far clocks are apart."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.drive.model import Drive
from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.host.archive import describe
from fmus.host.fmu import Fmu
from scenarios.cli.app import run_safely
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from scenarios.preparing.clocks import lag_of, overlapping
from scenarios.preparing.initialising import init
from tests.scenarios.test_readers import tdms

DRIVE = Drive()
LATER = 4.37  # s, from the start of the first logger to that of the second


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return build_python(DRIVE, tmp_path_factory.mktemp("drive") / "Drive.fmu")


@pytest.fixture(scope="module")
def truth(drive):
    """Force and motion of a carriage over 40 s at 1 kHz, a force that never repeats."""
    t = np.arange(40_000) / 1000
    force = np.interp(t, np.arange(0, 41, 0.8), np.random.default_rng(4).uniform(-200, 200, 52))
    with Fmu(drive) as fmu:
        q, q_dot = fmu.simulate(t, {"F": force}, ["q", "q_dot"], {}).T
    return t, force, q, q_dot


def logged(folder, truth, slow=80.0, fast=200.0, shared=False, dates=False):
    """The force of one logger with a clock of its own, the motion of another one that starts later."""
    t, force, q, q_dot = truth
    rng = np.random.default_rng(1)
    one, two = np.arange(0, 39.9, 1 / fast), np.arange(LATER, 36, 1 / slow)
    first = {"time": one + 5000, "F": np.interp(one, t, force)}
    second = {"clock": two - LATER, "q_dot": np.interp(two, t, q_dot) + rng.normal(0, 1e-3, two.size)}
    second["q"] = np.interp(two, t, q) + rng.normal(0, 1e-4, two.size)
    if shared:
        first["speed"] = 2 + 1.7 * np.interp(one, t, q_dot) + rng.normal(0, 0.01, one.size)
    tables = pd.DataFrame(first), pd.DataFrame(second)
    if dates:
        noon = pd.Timestamp("2026-03-01 12:00")
        tables[0]["time"] = noon + pd.to_timedelta(one, unit="s")
        tables[1]["clock"] = noon + pd.to_timedelta(two, unit="s")
    files = folder / "force.csv", folder / "motion.csv"
    for file, table in zip(files, tables, strict=True):
        table.to_csv(file, index=False)
    units = {"q_dot": "m/s", "q": "m"}
    (folder / "motion.csv.units.json").write_text(str(units).replace("'", '"'))
    if shared:
        (folder / "force.csv.units.json").write_text('{"speed": "m/s"}')
    return list(files)


@pytest.mark.parametrize("shared", [False, True])
def test_two_loggers_become_one_record(drive, truth, tmp_path, shared):
    made = init(drive, logged(tmp_path, truth, shared=shared), tmp_path)
    e = load_experiment(made.file)
    assert (e.data_file, e.time) == ("motion.csv", "clock")  # the slower one, so that the other is thinned
    assert (e.files["force"].file, e.files["force"].time) == ("force.csv", "time")
    assert e.files["force"].offset == pytest.approx(-5000 - LATER, abs=2e-3)
    assert e.input_columns["F"].file == "force"
    text = made.file.read_text()
    assert ("'q_dot' follows 'speed'" in text) == shared
    assert ("outputs follow a simulation" in text) == (not shared)
    assert any(
        line.startswith("clock of force (200 Hz; record 80 Hz): offset = -5004.37") for line in made.lines()
    )
    [run] = load_record(e, describe(drive)).runs
    t, force, q, _ = truth
    assert np.abs(run.u[30:-30, 0] - np.interp(run.t[30:-30] + LATER, t, force)).max() < 3
    assert np.abs(run.y[:, 0] - np.interp(run.t + LATER, t, q)).max() < 1e-2


def test_dates_need_no_search(drive, truth, tmp_path):
    made = init(drive, logged(tmp_path, truth, dates=True), tmp_path)
    e = load_experiment(made.file)
    assert e.files["force"].offset == 0.0
    assert "offset = 0.0  # s, by the dates of both files" in made.file.read_text()
    [run] = load_record(e, describe(drive)).runs
    assert np.abs(run.u[30:-30, 0] - np.interp(run.t[30:-30] + LATER, truth[0], truth[1])).max() < 3


def test_dates_count_where_inputs_lie_in_several_files(drive, truth, tmp_path):
    files = logged(tmp_path, truth, dates=True)
    noon, t = pd.Timestamp("2026-03-01 12:00"), np.arange(1.0, 39, 1 / 150)
    other = tmp_path / "other.csv"
    pd.DataFrame({"time": noon + pd.to_timedelta(t, unit="s"), "F_ext": np.cos(t)}).to_csv(other, index=False)
    made = init(drive, [*files, other], tmp_path)
    e = load_experiment(made.file)
    assert {c.file for c in e.input_columns.values()} == {"force", "other"}
    assert made.file.read_text().count("offset = 0.0  # s, by the dates of both files") == 2
    [run] = load_record(e, describe(drive)).runs
    assert np.abs(run.u[30:-30, 0] - np.interp(run.t[30:-30] + LATER, truth[0], truth[1])).max() < 3
    assert np.abs(run.u[30:-30, 1] - np.cos(run.t[30:-30] + LATER)).max() < 1e-3


def test_a_shift_that_the_fmu_may_cause_is_no_other_clock(drive, truth, tmp_path):
    files = logged(tmp_path, truth)
    table = pd.read_csv(files[1])
    table["clock"] += LATER + 5000 + 0.02  # with the FMU's errors, nobody can tell such clocks from one
    table.to_csv(files[1], index=False)
    e = load_experiment(init(drive, files, tmp_path).file)
    assert e.files["force"].offset == 0.0
    assert "so that the clocks are taken as one" in (tmp_path / "experiment.toml").read_text()


def test_channels_of_one_file_have_one_clock(drive, truth, tmp_path):
    t, force, q, q_dot = truth
    late = {"time": t[::20], "q": np.interp(t[::20] - 0.4, t, q), "q_dot": np.interp(t[::20] - 0.4, t, q_dot)}
    tdms(tmp_path / "log.tdms", {"fast": {"time": t[::5], "F": force[::5]}, "slow": late})
    e = load_experiment(init(drive, tmp_path / "log.tdms", tmp_path).file)
    assert (e.time, e.files["fast"].time, e.files["fast"].offset) == ("slow/time", "fast/time", 0.0)
    assert e.files["fast"].file is None


def test_a_clock_that_is_not_found_is_left_to_the_user(drive, truth, tmp_path):
    files = logged(tmp_path, truth)
    table = pd.read_csv(files[1])
    table[["q", "q_dot"]] = np.random.default_rng(2).normal(size=(len(table), 2))
    table.to_csv(files[1], index=False)
    with pytest.raises(BadInput, match=r"has to be completed by hand: .* no time in common") as refused:
        init(drive, files, tmp_path)
    assert "\n" not in str(refused.value)
    assert (
        "offset = 0.0  # s, not found; write here what has to be added"
        in (tmp_path / "experiment.toml").read_text()
    )


def test_a_record_that_repeats_itself_is_no_clock(truth):
    t = truth[0][::10]
    lag = lag_of(t, [np.sin(3 * t)], t[:2000], [np.sin(3 * t[:2000] + 1)])
    assert lag.likeness > 0.99
    assert not lag.sure


@given(st.floats(-300, 300), st.sampled_from([31.0, 80.0, 250.0]), st.floats(-5, 5), st.floats(0.1, 9))
def test_a_lag_is_found_to_a_part_of_a_sample_in_any_unit(truth, later, rate, bias, gain):
    t, _, _, x = truth
    u = np.arange(3.0, 30.0, 1 / rate)
    lag = lag_of(t[::10], [x[::10]], u + later, [bias + gain * np.interp(u, t, x)])
    assert lag.sure
    assert lag.seconds == pytest.approx(-later, abs=0.1 / min(rate, 100))


def test_correlations_of_what_overlaps_are_those_of_the_samples_there():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=60), rng.normal(size=25)
    one[7], other[3] = np.nan, np.nan
    found = overlapping(one, other)
    assert found.size == 84
    for shift in range(-17, 53):
        i = np.arange(max(0, shift), min(60, 25 + shift))
        a, b = one[i], other[i - shift]
        there = np.isfinite(a) & np.isfinite(b)
        expected = np.corrcoef(a[there], b[there])[0, 1] if there.sum() >= 0.3 * 24 else -1.0
        assert found[shift + 24] == pytest.approx(expected, abs=1e-9)


def test_one_logger_that_has_all_is_enough(drive, truth, tmp_path):
    files = logged(tmp_path, truth)
    t, force, q, q_dot = (x[::10] for x in truth)
    pd.DataFrame({"time": t, "F": force, "q": q, "q_dot": q_dot}).to_csv(tmp_path / "all.csv", index=False)
    made = init(drive, [files[1], tmp_path / "all.csv"], tmp_path)
    e = load_experiment(made.file)
    assert (e.data_file, e.files) == ("all.csv", {})
    assert any("motion.csv is not used" in line for line in made.lines())


def test_the_command_takes_several_files(drive, truth, tmp_path, capsys):
    files = logged(tmp_path, truth)
    assert run_safely(["init", str(drive), *map(str, files), "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "force: F" in said
    assert "clock of force" in said
