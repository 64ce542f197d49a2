"""Measured data: what arrives at the estimators, what is refused, what is noted."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.record import Record
from fmus.errors import BadInput
from fmus.host.description import FmuDescription
from scenarios.experiment.advice import check_colons
from scenarios.experiment.checks import clipped
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.record import load_record
from tests.helpers.experiment_files import (
    GOOD,
    RIG,
    assert_one_clear_line,
    csv_lines,
    table,
    variable,
    write,
)
from tests.helpers.paths import SHARED

DATA = SHARED / "data" / "experiments"


def read(file: Path, fmu: FmuDescription = RIG) -> Record:
    return load_record(load_experiment(file), fmu)


def kinds(record: Record) -> list[str]:
    return [note.kind for note in record.notes]


def test_data_may_lie_elsewhere(tmp_path):
    file = write(tmp_path / "here")
    (tmp_path / "there").mkdir()
    (tmp_path / "here" / "data.csv").rename(tmp_path / "there" / "data.csv")
    e = load_experiment(file, data_dir=tmp_path / "there")
    assert load_record(e, RIG).runs[0].t.size == 1001


def test_one_file_is_one_run_in_the_units_of_the_fmu(tmp_path):
    record = read(write(tmp_path))
    (run,) = record.runs
    columns = table()
    assert record.inputs == ("T_P", "f_sync")
    assert record.outputs == ("omega_w", "omega_w_dot")
    assert_allclose(run.y[:, 0], columns["omega"], rtol=1e-8)  # nine digits in the file
    assert_allclose(run.u[:, 0], columns["torque"], atol=1e-6)
    assert_array_equal(run.u[:, 1], 7.5)
    assert_allclose(record.noise_std, [0.3 * np.pi / 30, np.nan])
    assert kinds(record) == ["unit"]


def test_a_shared_border_identifies_only(tmp_path):
    (run,) = read(write(tmp_path)).runs
    assert run.t[run.fit | run.choose][-1] == run.t[600] == 6.0
    assert run.t[run.test][0] == run.t[601]
    assert np.all(run.fit.astype(int) + run.choose + run.test == 1)


def test_the_run_starts_with_the_record_and_ends_with_the_split(tmp_path):
    toml = GOOD.replace("[0.0, 6.0]", "[2.0, 6.0]").replace("[6.0, 10.0]", "[6.5, 9.0]")
    (run,) = read(write(tmp_path, toml)).runs
    assert (run.t[0], run.t[-1]) == (0.0, 9.0)
    assert (run.fit.sum() + run.choose.sum(), run.test.sum()) == (401, 251)


def test_two_files_are_two_runs(tmp_path):
    split = 'identify_data = "data.csv"\ntest_data = "data.csv"'
    toml = GOOD.replace("identify = [0.0, 6.0]\ntest = [6.0, 10.0]", split).replace(
        'data = "data.csv"\ntime', "time"
    )
    first, second = read(write(tmp_path, toml)).runs
    assert np.all(first.fit ^ first.choose)
    assert not first.test.any()
    assert second.test.all()
    assert not np.any(second.fit | second.choose)


def test_what_chooses_is_a_fifth_spread_over_what_identifies(tmp_path):
    (run,) = read(write(tmp_path)).runs
    assert run.choose.sum() == pytest.approx(0.2 * 601, abs=15)
    starts = np.flatnonzero(np.diff(run.choose.astype(int)) == 1) + 1
    assert len(starts) == 5
    assert np.diff(run.t[starts]) == pytest.approx(1.2, abs=0.15)


def test_a_window_to_choose_is_taken_as_it_is_given(tmp_path):
    toml = GOOD.replace("identify = [0.0, 6.0]", "identify = [0.0, 5.0]\nchoose = [5.0, 6.0]")
    (run,) = read(write(tmp_path, toml)).runs
    assert run.t[run.fit][-1] == 5.0
    assert (run.t[run.choose][0], run.t[run.choose][-1]) == (run.t[501], 6.0)


def test_a_file_to_choose_is_a_run_of_its_own(tmp_path):
    split = 'identify_data = "data.csv"\nchoose_data = "data.csv"\ntest_data = "data.csv"'
    toml = GOOD.replace("identify = [0.0, 6.0]\ntest = [6.0, 10.0]", split).replace(
        'data = "data.csv"\ntime', "time"
    )
    parts = [[run.fit.all(), run.choose.all(), run.test.all()] for run in read(write(tmp_path, toml)).runs]
    assert parts == np.eye(3, dtype=bool).tolist()


def test_without_a_split_nothing_is_held_out(tmp_path):
    toml = GOOD.replace("[split]\nidentify = [0.0, 6.0]\ntest = [6.0, 10.0]\n", "")
    (run,) = read(write(tmp_path, toml)).runs
    assert run.fit.all()
    assert not np.any(run.choose | run.test)


def test_a_derived_column_is_the_derivative(tmp_path):
    columns = table() | {"omega": np.sin(table()["time"])}
    (run,) = read(write(tmp_path, columns=columns)).runs
    # central differences err by step^2 / 6, those at the ends by step / 2
    assert_allclose(run.y[1:-1, 1], np.cos(run.t[1:-1]), atol=2e-5)


def test_no_inputs_at_all(tmp_path):
    (run,) = read(write(tmp_path, GOOD.replace('T_P = "torque"\nf_sync = 7.5\n', ""))).runs
    assert run.u.shape == (1001, 0)


@pytest.mark.skipif(not DATA.is_dir(), reason="the shared experiments are not beside the repository")
@pytest.mark.parametrize("file", sorted(DATA.glob("*/experiment.toml")), ids=lambda file: file.parent.name)
def test_shared_experiments_load(file):
    from fmus.models import MODELS

    declared = file.read_text()
    if not any(f'model = "{name}"' in declared for name in MODELS):
        pytest.skip("its model is not built here yet")
    e = load_experiment(file)
    known = [variable(name, "output", o.unit) for name, o in e.outputs.items()]
    known += [variable(name, "input", None) for name in e.inputs]
    known += [variable(name, "parameter", None) for name in {**e.parameters, **e.calibrate}]
    described = {v.name: v for v in known} | {
        name: variable(name, "output", "rad/s", initial="exact") for name in e.initial
    }
    record = load_record(e, FmuDescription(e.id, "2.0", e.id, "{0}", described))
    (run,) = record.runs
    assert record.notes == ()
    assert np.all(run.fit.astype(int) + run.choose + run.test == 1)
    assert np.isfinite(record.noise_std).all()


# the wrong edit of the experiment file or of the data, and words the message must hold
BAD_USE = [
    ('unit = "rpm"', 'unit = "Hz"', "[outputs.omega_w]: unit 'Hz' does not fit 'rad/s'"),
    ('unit = "rpm"', 'unit = "rad/ss"', "did you mean 'rad/s'?"),
    (
        "[6.0, 10.0]",
        "[6.0, 11.0]",
        "test = [6.0, 11.0] leaves the record data.csv, which runs from 0 to 10 s",
    ),
    ("[6.0, 10.0]", "[6.0, 6.2]", "test = [6.0, 6.2] holds 20 samples; at least 50"),
    ('"torque"', '"torqe"', "[inputs] T_P: column 'torqe' is not in"),
    ('time = "time"', 'time = "t"', "key 'time': column 't' is not in"),
    ("[derived.accel]", "[derived.torque]", "[derived.torque] has the name of a column"),
    ('"data.csv"', '"."', ": is a folder; give the path of the data file in it"),
    ('"data.csv"', '"nodata.csv"', "cannot be read (No such file or directory)"),
    ('"data.csv"', '"data.mf4"', "cannot be read (No such file or directory)"),
    (
        '"data.csv"',
        '"data.xyz"',
        "has no known format; convert it to one of .csv, .csv.gz, .h5, .hdf5, .mat,",
    ),
]


@pytest.mark.parametrize(("good", "bad", "words"), BAD_USE)
def test_units_split_and_columns_against_the_data(tmp_path, good, bad, words):
    assert good in GOOD
    file = write(tmp_path, GOOD.replace(good, bad, 1))
    with pytest.raises(BadInput) as refused:
        read(file)
    assert_one_clear_line(refused, file, words)


def replace_row(line: int, text: str):
    """A wrong edit of the data: other text in one line, counted from 1."""
    return lambda lines: [*lines[: line - 1], text, *lines[line:]]


BAD_DATA = [
    (lambda lines: [], "is empty or has no column names in line 1"),
    (lambda lines: lines[:1], "has no data below line 1"),
    (lambda lines: [lines[0].replace("torque", "omega"), *lines[1:]], "column 'omega' occurs twice"),
    (
        replace_row(7, "0.05,1.5,12,9,9"),
        "line 7: has 5 cells, and the lines above it have 4; mend it; if other lines stand above the "
        "names, write how many as skiprows in [data]",
    ),
    (
        lambda lines: ["Logger 7", "Serial,1234", "", *lines],
        "line 4: has 4 cells, and the lines above it have 2; mend it; if other lines stand above",
    ),
    (lambda lines: ["Logger 7", *lines], "line 2 has more cells than line 1 has names; name each column; if"),
    (
        lambda lines: ["a,b,c,d", *lines],
        "; line 2 holds it: if the names stand there, write skiprows = 1 in [data]",
    ),
    (replace_row(7, '0.05,"1.5,12,9'), "line 7: a quotation mark is opened there and never closed; close it"),
    (
        lambda lines: [lines[0], *(f"12:{i / 100:05.2f},0,12,110" for i in range(1001))],
        "line 2: time column 'time' holds '12:00.00'; write seconds, hours:minutes:seconds",
    ),
    (lambda lines: [lines[0], *(line + ",1" for line in lines[1:])], "line 2 has more cells than line 1"),
    (replace_row(7, "0.05,off,12,110"), "line 7: column 'torque' holds 'off', not a number"),
    (replace_row(7, "0.05,,12,110"), "column 'torque' has no number in 1 of 1001 rows, first at 0.05 s"),
    (replace_row(7, "0.05,inf,12,110"), "column 'torque' has no number in 1 of 1001 rows"),
    (replace_row(7, ",0,12,110"), "line 7: time column 'time' holds no number"),
    (replace_row(7, ""), "line 7: time column 'time' holds no number"),
    (replace_row(7, "0.04,0,12,110"), "line 7: time column 'time' goes from 0.04 to 0.04 s"),
    (replace_row(7, "0.03,0,12,110"), "line 7: time column 'time' goes from 0.04 to 0.03 s"),
    (lambda lines: lines[:200] + lines[260:], "no data from 1.98 to 2.59 s; end the split before it"),
    (lambda lines: lines[:1] + lines[1::20], "holds 31 samples; at least 50 are needed"),
]


@pytest.mark.parametrize(("edit", "words"), BAD_DATA)
def test_bad_data_files(tmp_path, edit, words):
    file = write(tmp_path)
    (tmp_path / "data.csv").write_text("\n".join(edit(csv_lines(table()))))
    with pytest.raises(BadInput) as refused:
        read(file)
    assert_one_clear_line(refused, file, words)


@pytest.mark.parametrize("above", [["a,b,c,d"], ["1,2,3,4", "", "rig;7"]])
def test_a_file_is_read_as_its_refusal_says(tmp_path, above):
    write(tmp_path)
    data = tmp_path / "data.csv"
    data.write_text("\n".join([*above, *csv_lines(table())]))
    with pytest.raises(BadInput) as refused:
        read(tmp_path / "experiment.toml")
    option = re.search(r"write (skiprows = \d+) in \[data\]", str(refused.value))[1]
    told = write(
        tmp_path, GOOD.replace('data = "data.csv"\n', "") + f'\n[data]\nfile = "data.csv"\n{option}\n'
    )
    data.write_text("\n".join([*above, *csv_lines(table())]))
    assert read(told).runs[0].t[-1] == 10.0


@pytest.mark.parametrize("cell", ["12:00", "0:01.5", "1:02:03 PM"])
def test_times_with_colons_that_may_mean_two_things_are_refused(cell):
    sheet = Sheet(Path("log.csv"), pd.DataFrame({"t": [cell, cell]}), ("t",), row="line", first=2)
    with pytest.raises(
        BadInput, match=f"line 2: time column 't' holds '{cell}'; write seconds, hours:minutes"
    ):
        check_colons(sheet, "t")


@pytest.mark.parametrize(
    "cell",
    [
        1.5, "1,5", "2026-11-26T12:00:01.5", pd.Timedelta("12:00:01"), np.nan,
        "12:00:01", "12:00:01,5", "100:00:00",
    ],
)  # fmt: skip
def test_other_times_are_left_to_the_reader(cell):
    check_colons(Sheet(Path("log.csv"), pd.DataFrame({"t": [cell]}), ("t",)), "t")
    check_colons(Sheet(Path("log.csv"), pd.DataFrame({"t": []}), ("t",)), "t")


def test_blank_rows_at_the_end_and_beyond_the_split_do_no_harm(tmp_path):
    file = write(tmp_path, GOOD.replace("[6.0, 10.0]", "[6.0, 9.0]"))
    lines = csv_lines(table())
    lines[960] = lines[960].split(",")[0] + ",,,"
    (tmp_path / "data.csv").write_text("\n".join(lines) + "\n\n\n")
    assert read(file).runs[0].t[-1] == 9.0


def test_jitter_and_lost_samples_are_noted(tmp_path):
    columns = table()
    columns["time"] = columns["time"] + np.random.default_rng(0).uniform(-0.002, 0.002, 1001)
    columns["time"][[0, -1]] = 0.0, 10.0
    assert kinds(read(write(tmp_path / "a", columns=columns))) == ["unit", "jitter"]
    columns = {name: np.delete(values, [300, 301]) for name, values in table().items()}
    assert kinds(read(write(tmp_path / "b", columns=columns))) == ["unit", "jitter", "gap"]


def test_a_few_printed_digits_are_no_jitter(tmp_path):
    columns = table()
    columns["time"] = np.round(columns["time"] * 1.00037, 4)  # steps of 0.0100 and 0.0101
    assert kinds(read(write(tmp_path, columns=columns))) == ["unit"]


WHOLE = GOOD.replace("[split]\nidentify = [0.0, 6.0]\ntest = [6.0, 10.0]\n", "")


def write_exactly(folder, times):
    """The table with other times, in all their digits, and an experiment without a split."""
    file = write(folder, WHOLE)
    pd.DataFrame(table() | {"time": times}).to_csv(folder / "data.csv", index=False)
    return file


@pytest.mark.filterwarnings("error")
def test_a_record_of_one_row_is_refused_as_that(tmp_path):
    file = write(tmp_path, WHOLE)
    lines = (tmp_path / "data.csv").read_text().splitlines()[:2]
    (tmp_path / "data.csv").write_text("\n".join(lines))
    with pytest.raises(BadInput) as refused:
        read(file)
    assert_one_clear_line(refused, tmp_path / "data.csv", "has 1 line of numbers; at least 2 are needed")


EPOCHS = {
    "ms": lambda t: 1.7e12 + 1e3 * t,
    "us": lambda t: 1.7e15 + 1e6 * t,
    "d": lambda t: 45000.5 + t / 86400,
    "d, MATLAB": lambda t: 739000.5 + t / 86400,
}


@pytest.mark.parametrize("unit", EPOCHS)
def test_times_that_look_like_dates_in_another_unit_are_noted(tmp_path, unit):
    file, word = write_exactly(tmp_path, EPOCHS[unit](table()["time"])), unit.partition(",")[0]
    said = [n.sentence for n in read(file).notes if n.column == "time"]
    assert len(said) == 1
    assert f'if these are dates in {word}, write time_unit = "{word}"' in said[0]
    file.write_text(f'time_unit = "{word}"\n' + WHOLE)
    assert not [n for n in read(file).notes if n.column == "time"]


@pytest.mark.parametrize("begin", [0.0, 45000.0, 1.7e9])
def test_times_in_seconds_are_not_noted(tmp_path, begin):
    file = write_exactly(tmp_path, begin + table()["time"])
    assert not [n for n in read(file).notes if n.column == "time"]


@pytest.mark.parametrize(
    ("name", "told"), [("torque [kNx]", True), ("torque[0]", False), ("torque (front)", False)]
)
def test_a_word_in_square_brackets_that_is_no_known_unit_is_noted(tmp_path, name, told):
    columns = {name if c == "torque" else c: x for c, x in table().items()}
    file = write(tmp_path, GOOD.replace('"torque"', f'"{name}"'), columns)
    said = [n.sentence for n in read(file).notes if "is no unit" in n.sentence]
    assert [f"'{name}': [kNx] is no unit that is known here" in s for s in said] == [True] * told


def test_a_constant_output_is_noted_a_constant_input_is_not(tmp_path):
    columns = table() | {"n_wheel": np.full(1001, 5.0), "torque": np.zeros(1001)}
    record = read(write(tmp_path, columns=columns))
    assert [(n.kind, n.column) for n in record.notes] == [("unit", "n_wheel"), ("constant", "n_wheel")]


def test_a_clipped_source_of_a_derived_output_is_noted(tmp_path):
    columns = table() | {"omega": np.minimum(table()["omega"], 15.0)}
    record = read(write(tmp_path, columns=columns))
    assert [(n.kind, n.column) for n in record.notes] == [("unit", "n_wheel"), ("clipped", "omega")]


# --- units of an FMU that states none

BARE = replace(RIG, variables={n: replace(v, unit=None) for n, v in RIG.variables.items()})
IN_RAD = 'unit = "rad/s2"\nmodel_unit = "rad/s2"'


def with_units(omega_w: str, torque: str = '"torque"') -> str:
    """The experiment with other lines on the wheel's speed and its torque."""
    toml = GOOD.replace('unit = "rpm"', omega_w).replace('unit = "rad/s2"', IN_RAD)
    return toml.replace('T_P = "torque"', f"T_P = {torque}")


def test_a_column_is_converted_to_the_model_unit(tmp_path):
    torque = '{column = "torque", unit = "kN.m", model_unit = "N.m"}'
    record = read(write(tmp_path, with_units('unit = "rpm"\nmodel_unit = "rad/s"', torque)), BARE)
    (run,) = record.runs
    assert_allclose(run.y[:, 0], table()["omega"], rtol=1e-8)
    assert_allclose(record.noise_std[0], 0.3 * np.pi / 30)
    assert_allclose(run.u[:, 0], 1e3 * table()["torque"], atol=1e-3)
    assert_array_equal(run.u[:, 1], 7.5)
    assert [n.sentence for n in record.notes] == [
        "column 'n_wheel' is converted from rpm to rad/s",
        "column 'torque' is converted from kN.m to N.m",
    ]


def test_an_input_in_a_declared_unit_is_converted_to_that_of_the_fmu(tmp_path):
    torque = 'T_P = {column = "torque", unit = "kN.m", noise_std = 0.02}'
    record = read(write(tmp_path, GOOD.replace('T_P = "torque"', torque)))
    assert_allclose(record.runs[0].u[:, 0], 1e3 * table()["torque"], atol=1e-3)
    assert record.input_std == {"T_P": pytest.approx(20.0)}


@pytest.mark.parametrize("scale", [-25.0, 0.1])
def test_the_noise_of_an_input_is_that_of_the_scaled_value(tmp_path, scale):
    torque = f'T_P = {{column = "torque", scale = {scale}, unit = "kN.m", noise_std = 0.02}}'
    record = read(write(tmp_path, GOOD.replace('T_P = "torque"', torque)))
    assert record.input_std == {"T_P": pytest.approx(20.0)}


@pytest.mark.parametrize(("scale", "offset"), [(-1.0, 0.0), (-25.0, 0.3), (1.0, -4.0)])
def test_what_is_measured_is_the_scaled_column(tmp_path, scale, offset):
    """A sensor that looks the other way, raw voltages, and a zero that is not one."""
    as_logged = {
        name: (x - offset) / scale if name in ("n_wheel", "torque") else x for name, x in table().items()
    }
    how = f"scale = {scale}, offset = {offset}"
    toml = GOOD.replace('unit = "rpm"', f'unit = "rpm"\n{how.replace(", ", chr(10))}')
    toml = toml.replace('T_P = "torque"', f'T_P = {{column = "torque", {how}}}')
    record, usual = read(write(tmp_path, toml, as_logged)), read(write(tmp_path / "usual"))
    (run,), (same,) = record.runs, usual.runs
    assert_allclose(run.y[:, 0], same.y[:, 0], rtol=1e-7, atol=1e-7)
    assert_allclose(run.u, same.u, atol=1e-5)
    assert_allclose(record.noise_std, usual.noise_std)
    stated_units(tmp_path, "V")  # of the column, which says nothing of what is measured
    assert_array_equal(read(tmp_path / "experiment.toml").runs[0].u, run.u)


def test_a_column_that_is_scaled_to_nothing_is_refused(tmp_path):
    toml = GOOD.replace('unit = "rpm"', 'unit = "rpm"\nscale = 0.0')
    with pytest.raises(BadInput, match=r"key 'outputs.omega_w.scale' must not be 0"):
        read(write(tmp_path, toml))


def test_what_nobody_says_a_unit_of_is_taken_as_it_is(tmp_path):
    (run,) = read(write(tmp_path, with_units('unit = "rad/s"\nmodel_unit = "rad/s"')), BARE).runs
    assert_allclose(run.u[:, 0], table()["torque"], atol=1e-6)


def stated_units(folder: Path, torque: str) -> None:
    (folder / "data.csv.units.json").write_text(f'{{"torque": "{torque}"}}')


def test_a_derived_input_is_converted_from_the_unit_that_the_file_states(tmp_path):
    toml = GOOD.replace('T_P = "torque"', 'T_P = "rate"').replace('= "N.m"', '= "N.m/s"')
    file = write(tmp_path, toml + '[derived.rate]\nderivative = "torque"\n')
    stated_units(tmp_path, "kN.m")
    fmu = replace(RIG, variables=RIG.variables | {"T_P": variable("T_P", "input", "N.m/s")})
    rate = 1e3 * np.gradient(table()["torque"], table()["time"])
    assert_allclose(read(file, fmu).runs[0].u[:, 0], rate, rtol=1e-5, atol=1)


def test_a_unit_that_the_file_states_of_an_input_needs_the_model_unit_too(tmp_path):
    speed = 'unit = "rpm"\nmodel_unit = "rad/s"'
    file = write(tmp_path, with_units(speed))
    stated_units(tmp_path, "kN.m")
    with pytest.raises(BadInput) as refused:
        read(file, BARE)
    assert_one_clear_line(refused, file, "[inputs] T_P: column 'torque' of")
    assert 'write model_unit = "..."' in str(refused.value)
    write(tmp_path, with_units(speed, '{column = "torque", model_unit = "N.m"}'))
    assert_allclose(read(file, BARE).runs[0].u[:, 0], 1e3 * table()["torque"], atol=1e-3)


# the FMU, the lines on the speed and the torque, and words the message must hold
BAD_UNITS = [
    (
        BARE,
        'unit = "rpm"',
        '"torque"',
        "[outputs.omega_w]: the column is in 'rpm', but the FMU states no unit",
    ),
    (
        BARE,
        'unit = "rpm"',
        '"torque"',
        "for 'omega_w' of Testrig to convert it to; write model_unit = \"...\"",
    ),
    (BARE, 'unit = "U/min"', '"torque"', "[outputs.omega_w]: unit 'U/min' is not known"),
    (
        BARE,
        'unit = "U/min"\nmodel_unit = "U/min"',
        '"torque"',
        "[outputs.omega_w] model_unit = \"U/min\": unit 'U/min' is not known",
    ),
    (
        BARE,
        'unit = "U/min"\nmodel_unit = "rad/s"',
        '"torque"',
        "[outputs.omega_w]: unit 'U/min' is not known",
    ),
    (BARE, 'unit = "rpm"\nmodel_unit = "m"', '"torque"', "[outputs.omega_w]: unit 'rpm' does not fit 'm'"),
    (
        RIG,
        'unit = "rpm"\nmodel_unit = "rpm"',
        '"torque"',
        "[outputs.omega_w] model_unit = \"rpm\", but 'omega_w' of Testrig is in 'rad/s', as the FMU states; "
        "leave model_unit out",
    ),
    (
        RIG,
        'unit = "rpm"\nmodel_unit = "m"',
        '"torque"',
        "[outputs.omega_w] model_unit = \"m\": unit 'm' does not fit 'rad/s'",
    ),
    (
        RIG,
        'unit = "rpm"',
        '{column = "torque", model_unit = "kN.m"}',
        "[inputs] T_P model_unit = \"kN.m\", but 'T_P' of Testrig is in 'N.m'",
    ),
    (RIG, 'unit = "rpm"', '{column = "torque", unit = "kg"}', "[inputs] T_P: unit 'kg' does not fit 'N.m'"),
    (
        BARE,
        'unit = "rpm"\nmodel_unit = "rad/s"',
        '{column = "torque", unit = "N.m"}',
        "[inputs] T_P: the column is in 'N.m', but the FMU states no unit for 'T_P' of Testrig",
    ),
    (
        BARE,
        'unit = "rpm"\nmodel_unit = "rad/s"',
        '{column = "torque", units = "N.m"}',
        "key 'inputs.T_P.units' is not known; did you mean 'unit'?",
    ),
    (BARE, 'unit = "rpm"', '{unit = "N.m"}', "key 'inputs.T_P.column' is missing"),
]


@pytest.mark.parametrize(("fmu", "omega_w", "torque", "words"), BAD_UNITS)
def test_units_that_cannot_be_converted_are_refused(tmp_path, fmu, omega_w, torque, words):
    file = write(tmp_path, with_units(omega_w, torque))
    with pytest.raises(BadInput) as refused:
        read(file, fmu)
    assert_one_clear_line(refused, file, words)


def test_a_model_unit_may_repeat_what_the_fmu_states(tmp_path):
    record = read(write(tmp_path, with_units('unit = "rpm"\nmodel_unit = "rad/s"')))
    assert_allclose(record.runs[0].y[:, 0], table()["omega"], rtol=1e-8)


def test_a_file_that_contradicts_the_declared_unit_of_an_input_is_refused(tmp_path):
    toml = GOOD.replace('T_P = "torque"', 'T_P = {column = "torque", unit = "kN.m"}')
    file = write(tmp_path, toml)
    stated_units(tmp_path, "N.m")
    with pytest.raises(BadInput) as refused:
        read(file)
    assert_one_clear_line(refused, file, '[inputs] T_P unit = "kN.m", but')


# --- clipping


def stroke(quantum: float, acceleration: float = 2.0, step: float = 1e-3) -> np.ndarray:
    """Position (n,) of an axis that rests, runs a stroke at 0.25 m/s, rests, runs back; quantised [m]."""
    ramp = 0.25 / acceleration
    times = [0, 0.5, 0.5 + ramp, 1.5, 1.5 + ramp, 2.5]
    speed = np.interp(np.arange(0, 2.5, step), times, [0, 0, 0.25, 0.25, 0, 0])
    there = np.cumsum(speed) * step
    return np.round((0.1234 + np.concatenate([there, there[-1] - there])) / quantum) * quantum


@pytest.mark.parametrize("quantum", [1e-9, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
def test_an_encoder_at_rest_is_not_clipped(quantum):
    assert clipped(stroke(quantum)) == []


def test_a_speed_at_rest_is_not_clipped():
    speed = np.abs(np.diff(stroke(1e-9)))
    assert clipped(np.round(speed / 1e-6) * 1e-6) == []


@given(st.floats(1e-5, 0.1), st.integers(0, 1000))
def test_noise_and_quanta_alone_are_not_clipping(quantum, seed):
    noise = 0.01 * np.random.default_rng(seed).standard_normal(1001)
    assert clipped(np.round((table()["omega"] + noise) / quantum) * quantum) == []


@pytest.mark.parametrize("quantum", [1e-6, 1e-4])
def test_an_encoder_cut_off_is_clipped(quantum):
    assert clipped(np.minimum(stroke(quantum), 0.3)) == [(0.3, 1)]
    assert clipped(np.maximum(stroke(quantum), 0.2)) == [(0.2, 1)]


@pytest.mark.parametrize("limit", [8.0, 10.0, 12.0, 14.0, 15.0, 16.0, 17.0])
def test_a_noisy_channel_cut_off_is_clipped(limit):
    assert clipped(np.minimum(table()["omega"], limit)) == [(limit, 1)]
