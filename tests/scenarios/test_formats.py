"""Inputs of scenarios and tracks come from every format of data, with the units that a file states."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose
from scipy.io import savemat

from fmus.errors import BadInput
from fmus.host.description import FmuDescription, FmuVariable
from scenarios.simulating.declaration import Declaration
from scenarios.simulating.given import sources
from scenarios.track.reading import read_track

T = np.linspace(0.0, 2.0, 5)
F = np.array([0.0, 1.0, -2.0, 3.0, 0.5])  # kN
V = FmuVariable("F", 0, "input", "continuous", None, "N", 0.0, None, None, None, "force")
FMUS = {"drive": FmuDescription("Drive", "2.0", "Drive", "", {"F": V})}


def parquet(file, columns, units):
    fields = [
        pa.field(n, pa.array(x).type, metadata={"unit": units[n]} if n in units else None)
        for n, x in columns.items()
    ]
    pq.write_table(
        pa.Table.from_arrays([pa.array(x) for x in columns.values()], schema=pa.schema(fields)), file
    )


def given(folder, **column):
    table = {"data": "f.parquet", "time": "t", "column": "F", **column}
    d = Declaration(
        id="x",
        question="?",
        duration=1.0,
        step=0.1,
        fmus={"drive": {"model": "drive"}},
        inputs={"drive.F": table},
        expect=({"that": "1 < 2", "because": "so"},),
    )
    return sources(d, FMUS, folder)["drive.F"]


@pytest.mark.parametrize(
    ("units", "more", "factor"),
    [
        ({"F": "kN", "t": "s"}, {}, 1e3),  # as the file states
        ({"F": "kN"}, {"unit": "kN", "factor": 2.0}, 2e3),
        ({}, {"unit": "kN"}, 1e3),
        ({}, {}, 1.0),  # that of the input
    ],
)
def test_a_column_is_in_the_unit_that_the_file_states(tmp_path, units, more, factor):
    parquet(tmp_path / "f.parquet", {"t": T, "F": F}, units)
    t, values = given(tmp_path, **more)
    assert_allclose(t, T)
    assert_allclose(values, factor * F)


def test_times_are_converted_and_dates_count_from_the_first(tmp_path):
    parquet(tmp_path / "f.parquet", {"t": 1e3 * T, "F": F}, {"t": "ms"})
    assert_allclose(given(tmp_path)[0], T)
    dates = pd.Timestamp("2024-05-01T10:00") + pd.to_timedelta(T, "s")
    parquet(tmp_path / "f.parquet", {"t": dates, "F": F}, {})
    assert_allclose(given(tmp_path)[0], T)


def test_a_mat_file_drives_a_scenario(tmp_path):
    savemat(tmp_path / "f.mat", {"t": T, "F": F})
    t, values = given(tmp_path, data="f.mat", unit="kN")
    assert_allclose(t, T)
    assert_allclose(values, 1e3 * F)


@pytest.mark.parametrize(
    ("columns", "units", "more", "words"),
    [
        ({"t": T, "F": F}, {"F": "kN"}, {"unit": "N"}, "states 'kN'"),
        ({"t": T, "F": F}, {"F": "m"}, {}, "unit 'm' does not fit 'N'"),
        ({"t": T, "F": F}, {}, {"column": "G"}, "column 'G' is not in"),
        ({"t": T[::-1].copy(), "F": F}, {}, {}, "row 2: time column 't' goes from 2 to 1.5"),
        ({"t": T, "F": ["a", *map(str, F[1:])]}, {}, {}, "row 1: column 'F' holds 'a', not a number"),
    ],
)
def test_a_column_that_cannot_be_is_refused_in_one_line(tmp_path, columns, units, more, words):
    parquet(tmp_path / "f.parquet", columns, units)
    with pytest.raises(BadInput) as refused:
        given(tmp_path, **more)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


X = np.linspace(0.0, 50.0, 101)
LEVEL = 1e-3 * np.sin(X)
TRACK = {
    "kind": "file",
    "data": "track.parquet",
    "distance": {"column": "km", "unit": "km"},
    "columns": {"level": {"column": "level", "unit": "mm"}},
}


def test_a_track_comes_from_a_parquet_file(tmp_path):
    parquet(tmp_path / "track.parquet", {"km": 1e-3 * X, "level": 1e3 * LEVEL}, {"km": "km", "level": "mm"})
    track = read_track(TRACK, tmp_path)
    assert_allclose(track.distance, X, atol=1e-12)
    assert_allclose(track.rails.level, LEVEL, atol=1e-15)


def test_a_track_over_dates(tmp_path):
    dates = pd.Timestamp("2024-05-01") + pd.to_timedelta(X / 20, "s")
    parquet(tmp_path / "track.parquet", {"when": dates, "level": 1e3 * LEVEL}, {})
    table = {k: v for k, v in TRACK.items() if k != "distance"}
    track = read_track(table | {"time": {"column": "when", "unit": "s"}, "V": 20.0}, tmp_path)
    assert_allclose(track.distance, X, atol=1e-6)  # dates count nanoseconds


def test_a_track_whose_file_states_another_unit_is_refused(tmp_path):
    parquet(tmp_path / "track.parquet", {"km": 1e-3 * X, "level": LEVEL}, {"level": "m"})
    with pytest.raises(BadInput, match="states 'm'"):
        read_track(TRACK, tmp_path)
