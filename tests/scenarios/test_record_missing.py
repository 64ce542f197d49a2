"""Measurements that are missing: what a filter may be given, and what it makes of it."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from estimator.filters import filters
from estimator.record import Record
from fmus.errors import BadInput
from scenarios.estimating.estimating import estimate
from scenarios.experiment.estimated import Alarm
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from tests.helpers.experiment_files import (
    GOOD,
    RIG,
    assert_one_clear_line,
    table,
    write,
)
from tests.scenarios.test_estimate_command import write_vdp


def load(file, missing=True) -> Record:
    return load_record(load_experiment(file), RIG, missing=missing)


def every(n: int, x: np.ndarray) -> np.ndarray:
    """A channel (N,) sampled at every n-th row, empty elsewhere."""
    return np.where(np.arange(x.size) % n == 0, x, np.nan)


def with_holes(folder, **columns):
    """The good experiment with other columns, empty cells where they are nan."""
    file = write(folder)
    pd.DataFrame(table() | columns).to_csv(folder / "data.csv", index=False)
    return file


def test_empty_cells_of_outputs_are_nan(tmp_path):
    slow = every(10, table()["n_wheel"])
    (run,) = load(with_holes(tmp_path, n_wheel=slow)).runs
    assert_array_equal(np.isnan(run.y[:, 0]), np.isnan(slow))
    assert_allclose(run.y[::10, 0], table()["omega"][::10], rtol=1e-12)
    assert np.isfinite(run.u).all()


def test_without_holes_nothing_changes(tmp_path):
    file = write(tmp_path)
    assert_array_equal(load(file).runs[0].y, load(file, missing=False).runs[0].y)


def test_a_derivative_is_taken_over_the_numbers_there_are(tmp_path):
    t = table()["time"]
    (run,) = load(with_holes(tmp_path, omega=every(4, np.sin(t)))).runs
    there = np.isfinite(run.y[:, 1])
    assert_array_equal(there, np.arange(t.size) % 4 == 0)
    # central differences err by step^2 / 6
    assert_allclose(run.y[there, 1][1:-1], np.cos(t[there][1:-1]), atol=3e-4)


def test_a_slow_channel_is_no_clipped_one(tmp_path):
    record = load(with_holes(tmp_path, n_wheel=every(3, table()["n_wheel"])))
    assert [n.kind for n in record.notes] == ["unit"]


def hole(name: str, value: float = np.nan):
    x = table()[name]
    x[5] = value
    return {name: x}


REFUSED = [
    (hole("torque"), True, "column 'torque' has no number in 1 of 1001 rows, first at 0.05 s"),
    (hole("n_wheel", np.inf), True, "column 'n_wheel' has no number in 1 of 1001 rows"),
    ({"n_wheel": every(30, table()["n_wheel"])}, False, "outputs have no number in 967 of 1001 rows"),
    ({"n_wheel": np.full(1001, np.nan)}, True, "column 'n_wheel' has almost no numbers"),
]


@pytest.mark.parametrize(("columns", "missing", "words"), REFUSED)
def test_what_may_not_be_missing(tmp_path, columns, missing, words):
    file = with_holes(tmp_path, **columns)
    with pytest.raises(BadInput) as refused:
        load(file, missing)
    assert_one_clear_line(refused, file, words)


def test_an_output_that_is_an_input_too_may_not_be_missing(tmp_path):
    file = with_holes(tmp_path, **hole("n_wheel"))
    file.write_text(GOOD.replace('"torque"', '"n_wheel"'))
    with pytest.raises(BadInput, match="column 'n_wheel' has no number in 1 of"):
        load(file)


# --- estimates


@pytest.fixture
def lenient(monkeypatch):
    """Let `estimate` take empty cells."""
    monkeypatch.setattr("scenarios.estimating.estimating.load_record", partial(load_record, missing=True))


def thinned(file, n: int):
    data = file.parent / "data.csv"
    cells = pd.read_csv(data)
    cells["x"] = every(n, cells["x"].to_numpy())
    cells.to_csv(data, index=False)
    return file


def well_known(file):
    """So near the truth that the filter is all but linear."""
    file.write_text(file.read_text().replace("start = 1.5, std = 0.5", "start = 0.82, std = 0.03"))
    return file


@pytest.mark.slow
@pytest.mark.usefixtures("lenient")
@pytest.mark.parametrize("smooth", ["", "smooth = true\n"])
def test_missing_measurements_are_a_lower_rate(vdp, tmp_path, smooth):
    """A filter that is given every fourth measurement finds what it does of every fourth sample."""
    known = f"initial_std.x1 = 0.05\nprocess_std = {{x0 = 1e-5, x1 = 1e-5}}\n{smooth}"
    rare = f"rate = 5.0\n[estimate.options]\ninput_parts = 4\n{known}"
    slow = estimate(well_known(write_vdp(tmp_path, vdp, text=rare)))
    often = f"[estimate.options]\ninput_parts = 1\n{known}"
    file = well_known(thinned(write_vdp(tmp_path, vdp, text=often), 4))
    result = estimate(file, tmp_path / "out")
    mu, expected = result.estimated["mu"], slow.estimated["mu"]
    # sigma points are drawn anew at each sample, which a nonlinear oscillator feels
    assert mu["value"] == pytest.approx(expected["value"], abs=0.1 * mu["std_error"])
    assert mu["std_error"] == pytest.approx(expected["std_error"], rel=0.02)
    assert (result.samples, slow.samples) == (400, 100)
    assert not result.diverged
    assert (tmp_path / "out" / "estimate.html").is_file()


@pytest.mark.usefixtures("lenient")
def test_measurements_too_few_for_their_noise_or_the_rate(vdp, tmp_path):
    file = thinned(write_vdp(tmp_path, vdp), 100)
    file.write_text(file.read_text().replace("noise_std = 0.05\n", ""))
    with pytest.raises(
        BadInput, match=r"\[outputs.x0\] has 4 measurements, too few to estimate its noise; add"
    ):
        estimate(file)
    data = tmp_path / "data.csv"
    cells = pd.read_csv(data)
    cells["x"] = cells["x"].shift(1)
    cells.to_csv(data, index=False)
    file.write_text(file.read_text() + "rate = 10.0\n")
    with pytest.raises(BadInput, match="rate leaves no measurement of output 'x0'; use a higher rate"):
        estimate(file)


def test_options_stand_in_the_experiment(vdp, tmp_path):
    text = """
[estimate.options]
filter = "ekf"
process_std = {x0 = 1e-3, x1 = 1e-3}
alarms.mu = {above = 0.5, probability = 0.9}
"""
    file = write_vdp(tmp_path, vdp, text=text)
    options = load_experiment(file).estimate.options
    assert options.alarms == {"mu": Alarm(above=0.5, probability=0.9)}
    result = estimate(file)
    assert result.filter == "ekf"
    assert result.process_noise == {"x0": 1e-3, "x1": 1e-3}
    assert [a.limit for a in result.alarms if a.end is None] == ["above 0.5"]


BAD_OPTIONS = [
    ("fliter = 'ekf'", "key 'estimate.options.fliter' is not known; did you mean 'filter'?"),
    ("filter = 'kf'", f"key 'estimate.options.filter' must be one of {', '.join(filters())}, not 'kf'"),
    ("filter = 'rbpf'\nsmooth = true", "[estimate.options] smooth does not work with filter = 'rbpf'"),
    ("alarms.mu = {abov = 1.0}", "key 'estimate.options.alarms.mu.abov' is not known; did you mean 'above'?"),
    ("alarms.mu = {}", "[estimate.options.alarms.mu] needs 'below' or 'above'"),
    ("alarms.mu0 = {below = 0.1}", "[estimate.options] alarms 'mu0' is not estimated; did you mean 'mu'?"),
    ("walk.mu = 0", "key 'estimate.options.walk.mu' must be greater than 0"),
    ("process_std.x0 = '1'", "key 'estimate.options.process_std.x0' must be a number"),
    ("gate = nan", "key 'estimate.options.gate' must be a finite number"),
]


@pytest.mark.parametrize(("line", "words"), BAD_OPTIONS)
def test_wrong_options_are_one_clear_line(vdp, tmp_path, line, words):
    file = write_vdp(tmp_path, vdp, n=60, text=f"[estimate.options]\n{line}\n")
    with pytest.raises(BadInput) as refused:
        estimate(file)
    assert_one_clear_line(refused, file, words)
