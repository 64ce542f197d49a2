"""Formats of data files: each gives the record that CSV gives; rasters, units, names, what is refused."""

import inspect
import json
import sys
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from estimator.record import Record
from fmus.errors import BadInput
from fmus.host.master.recording import Recording
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.readers import READERS, read_sheet
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.record import load_record
from tests.helpers.experiment_files import (
    GOOD,
    RIG,
    assert_one_clear_line,
    table,
)
from tests.helpers.paths import ROOT

UNITS = {"time": "s", "torque": "N.m", "omega": "rad/s", "n_wheel": "rpm"}


def write_csv(file, columns, units):
    pd.DataFrame(columns).to_csv(file, index=False)
    if units:
        file.with_name(file.name + ".units.json").write_text(json.dumps(dict(units)))


def write_parquet(file, columns, units):
    fields = [
        pa.field(name, pa.array(x).type, metadata={"unit": units[name]} if name in units else None)
        for name, x in columns.items()
    ]
    pq.write_table(
        pa.Table.from_arrays([pa.array(x) for x in columns.values()], schema=pa.schema(fields)), file
    )


def write_mat(file, columns, units):
    from scipy.io import savemat

    savemat(file, {name: x[:, None] for name, x in columns.items()})


def hdf5(file, arrays):
    """A MAT file of version 7.3 as MATLAB lays it out: text in the first 512 bytes, arrays transposed."""
    import h5py

    with h5py.File(file, "w", userblock_size=512) as f:
        for name, (x, kind) in arrays.items():
            f[name] = x
            node = f
            for part in name.split("/")[:-1]:
                node = node[part]
                node.attrs["MATLAB_class"] = np.bytes_("struct")
            f[name].attrs["MATLAB_class"] = np.bytes_(kind)
    with file.open("r+b") as stream:
        stream.write(
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024".ljust(116)
        )


def write_mat73(file, columns, units):
    hdf5(file, {name: (x[None, :], "double") for name, x in columns.items()})


def write_tdms(file, columns, units):
    tdms(file, {"log": columns}, units)


def tdms(file, groups, units=(), waveform=None):
    """Groups of channels; waveform: step and offset of their times, s."""
    from nptdms import ChannelObject, TdmsWriter

    wave = {} if waveform is None else dict(zip(("wf_increment", "wf_start_offset"), waveform, strict=True))
    with TdmsWriter(str(file)) as writer:
        writer.write_segment(
            [
                ChannelObject(group, name, x, wave | ({"unit_string": units[name]} if name in units else {}))
                for group, columns in groups.items()
                for name, x in columns.items()
            ]
        )


def write_waveforms(file, columns, units):
    """Without a time channel; 0.01 s is the step of the table."""
    tdms(file, {"log": {n: x for n, x in columns.items() if n != "time"}}, units, (0.01, 0.0))


def mdf(file, groups, units=MappingProxyType({}), version="4.10"):
    """Groups of channels, each over its column 'time'."""
    from asammdf import MDF, Signal

    with MDF(version=version) as m:
        for group, columns in groups.items():
            t = columns["time"]
            signals = [Signal(x, t, name=n, unit=units.get(n, "")) for n, x in columns.items() if n != "time"]
            m.append(signals, acq_name=group)
        m.save(file, overwrite=True)


def write_mdf(file, columns, units):
    mdf(file, {"log": columns}, units)


def write_mdf3(file, columns, units):
    mdf(file, {"log": columns}, units, "3.30")


WRITERS = {
    "csv": (write_csv, "data.csv"),
    "parquet": (write_parquet, "data.parquet"),
    "mat": (write_mat, "data.mat"),
    "mat 7.3": (write_mat73, "data.mat"),
    "tdms": (write_tdms, "data.tdms"),
    "tdms waveforms": (write_waveforms, "data.tdms"),
    "mdf 4": (write_mdf, "data.mf4"),
    "mdf 3": (write_mdf3, "data.mdf"),
}
WITH_UNITS = [kind for kind in WRITERS if not kind.startswith("mat")]
every_kind = pytest.mark.parametrize("kind", WRITERS)


def experiment(folder: Path, kind: str, columns=None, units=MappingProxyType({}), toml: str = GOOD) -> Path:
    """The good experiment, its data in another format."""
    writer, name = WRITERS[kind]
    writer(folder / name, table() if columns is None else columns, units)
    file = folder / "experiment.toml"
    file.write_text(toml.replace("data.csv", name))
    return file


def load(file: Path, **options) -> Record:
    return load_record(load_experiment(file), RIG, **options)


def assert_same(one: Record, other: Record) -> None:
    (a,), (b,) = one.runs, other.runs
    # the times of a waveform are multiples of its step, those of the table are not to the last bit
    assert_allclose(a.t, b.t, rtol=1e-14)
    assert_array_equal(a.u, b.u)
    assert_array_equal(a.y[:, 0], b.y[:, 0])
    assert_allclose(a.y[:, 1], b.y[:, 1], rtol=1e-9)  # a derivative over these times
    assert_array_equal(a.fit, b.fit)
    assert_array_equal(a.test, b.test)


def test_every_format_is_tested():
    own = {s for s, reader in READERS.items() if ROOT in Path(inspect.getfile(type(reader))).parents}
    assert {Path(name).suffix for _, name in WRITERS.values()} == own


@every_kind
def test_the_record_is_that_of_csv(tmp_path, kind):
    (tmp_path / "reference").mkdir()
    reference = load(experiment(tmp_path / "reference", "csv"))
    record = load(experiment(tmp_path, kind))
    assert_same(record, reference)
    assert [n.kind for n in record.notes] == [n.kind for n in reference.notes] == ["unit"]


@pytest.mark.parametrize("kind", WITH_UNITS)
def test_units_that_agree_are_no_matter(tmp_path, kind):
    (tmp_path / "reference").mkdir()
    assert_same(
        load(experiment(tmp_path, kind, units=UNITS)), load(experiment(tmp_path / "reference", "csv"))
    )


@pytest.mark.parametrize("kind", WITH_UNITS)
def test_an_input_in_another_unit_is_converted(tmp_path, kind):
    columns = table()
    record = load(
        experiment(tmp_path, kind, columns | {"torque": columns["torque"] / 1e3}, {"torque": "kNm"})
    )
    assert_allclose(record.runs[0].u[:, 0], columns["torque"], rtol=1e-12)
    assert any(
        "'torque' is converted from kN.m, as the file states, to N.m" in n.sentence for n in record.notes
    )


@pytest.mark.parametrize("kind", [k for k in WITH_UNITS if k != "tdms waveforms" and not k.startswith("mdf")])
def test_a_time_in_milliseconds_is_converted(tmp_path, kind):
    columns = table()
    record = load(experiment(tmp_path, kind, columns | {"time": columns["time"] * 1e3}, {"time": "ms"}))
    assert_allclose(record.runs[0].t, columns["time"], rtol=1e-12)


@pytest.mark.parametrize("kind", WITH_UNITS)
@pytest.mark.parametrize(
    ("column", "unit", "words"),
    [
        ("n_wheel", "rad/s", '[outputs.omega_w] unit = "rpm", but'),
        ("n_wheel", "m", "write unit = \"m\", or correct the file"),
        ("omega", "deg/s", "states '(deg/s)/s' for it"),
        ("torque", "m", "unit 'm' does not fit 'N.m'"),
    ],
)  # fmt: skip
def test_units_that_contradict_are_refused(tmp_path, kind, column, unit, words):
    file = experiment(tmp_path, kind, units={column: unit})
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, words)


@pytest.mark.parametrize("kind", WITH_UNITS)
def test_a_unit_nobody_knows_is_noted(tmp_path, kind):
    record = load(experiment(tmp_path, kind, units={"n_wheel": "Kästchen"}))
    assert any("'Kästchen', which is not known; it is taken as rpm" in n.sentence for n in record.notes)


@pytest.mark.parametrize("unit", ["rpm", "1/min", "U/min"])
def test_other_spellings_agree(tmp_path, unit):
    assert [n.kind for n in load(experiment(tmp_path, "mdf 4", units={"n_wheel": unit})).notes] == ["unit"]


def test_a_unit_of_nobody_s_may_be_declared_as_the_file_states_it(tmp_path):
    """What the FMU calls so too is not converted."""
    v = RIG.variables["omega_w"]
    fmu = replace(RIG, variables=dict(RIG.variables) | {"omega_w": replace(v, unit="ticks")})
    for name, unit in (("stated", "ticks"), ("other", "rpm")):
        (tmp_path / name).mkdir()
        toml = GOOD.replace('unit = "rpm"', 'unit = "ticks"')
        e = load_experiment(experiment(tmp_path / name, "csv", units={"n_wheel": unit}, toml=toml))
        if name == "stated":
            assert_array_equal(load_record(e, fmu).runs[0].y[:, 0], table()["n_wheel"])
            continue
        with pytest.raises(BadInput, match="states 'rpm' for it"):
            load_record(e, fmu)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_recorded_run_is_data(tmp_path, kind):
    columns = table()
    recording = Recording(pd.DataFrame(columns), UNITS | {"torque": None})
    getattr(recording, f"to_{kind}")(tmp_path / f"data.{kind}")
    (tmp_path / "experiment.toml").write_text(GOOD.replace("data.csv", f"data.{kind}"))
    (run,) = load(tmp_path / "experiment.toml").runs
    assert_allclose(run.u[:, 0], columns["torque"], rtol=1e-15)


# --- what is not sound


@every_kind
@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9])
def test_a_file_cut_short_is_refused_or_has_fewer_rows(tmp_path, kind, share):
    file = experiment(tmp_path, kind)
    data = tmp_path / WRITERS[kind][1]
    data.write_bytes(data.read_bytes()[: int(share * data.stat().st_size)])
    with pytest.raises(BadInput) as refused:
        load(file)  # fewer rows do not reach the end of the split
    assert_one_clear_line(refused, file, str(tmp_path))


@every_kind
def test_another_file_under_the_name_is_refused(tmp_path, kind):
    file = experiment(tmp_path, kind)
    (tmp_path / WRITERS[kind][1]).write_bytes(b"\x00\xff\xfe no data " * 200)
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, str(tmp_path))


@every_kind
def test_a_missing_column_names_its_neighbour(tmp_path, kind):
    file = experiment(tmp_path, kind, toml=GOOD.replace('"torque"', '"torqe"'))
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, "[inputs] T_P: column 'torqe' is not in")
    assert "did you mean 'torque'?" in str(refused.value)


@pytest.mark.parametrize(
    ("kind", "module"),
    [("parquet", "pyarrow"), ("mat 7.3", "h5py"), ("tdms", "nptdms"), ("mdf 4", "asammdf")],
)
def test_a_missing_package_is_one_clear_line(tmp_path, kind, module, monkeypatch):
    file = experiment(tmp_path, kind)
    for name in [n for n in sys.modules if n.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, f"run 'pip install {module}', or convert the file to CSV")


@every_kind
def test_a_lost_number_is_refused_in_all_formats(tmp_path, kind):
    columns = table()
    columns["torque"][5] = np.nan
    file = experiment(tmp_path, kind, columns)
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, "column 'torque' has no number in 1 of 1001 rows, first at 0.05 s")


# --- rasters


def sheet(file: Path, time: str, *columns: str) -> Sheet:
    return read_sheet(file, time, columns)


FAST, SLOW = np.arange(100) * 0.01, np.arange(20) * 0.05
RATES = {"fast": {"time": FAST, "x": FAST**2, "z": -FAST}, "slow": {"time": SLOW, "x": SLOW**3, "k": SLOW}}


@pytest.fixture(params=["tdms", "mf4"])
def rates(request, tmp_path):
    """A file of two groups with times of their own."""
    file = tmp_path / f"rates.{request.param}"
    {"tdms": tdms, "mf4": mdf}[request.param](file, RATES)
    return file


def test_the_time_named_chooses_the_rows(rates):
    found = sheet(rates, "slow/time", "x", "k", "slow/x").cells
    assert_array_equal(found["x"], SLOW**3)
    assert_array_equal(found["slow/x"], SLOW**3)
    assert_array_equal(found["k"], SLOW)
    found = sheet(rates, "fast/time", "fast/time", "x")
    assert_array_equal(found.cells["fast/time"], FAST)
    assert_array_equal(found.cells["x"], FAST**2)


def test_a_time_that_may_be_several_is_refused(rates):
    with pytest.raises(
        BadInput, match="time 'time' may be 'fast/time', 'slow/time'; give the full name"
    ) as refused:
        sheet(rates, "time", "x")
    assert str(rates) in str(refused.value)
    with pytest.raises(BadInput, match="its channels have several times; export the channels"):
        READERS[rates.suffix](rates)


def test_a_column_with_other_rows_says_so(rates):
    found = sheet(rates, "fast/time", "z", "k")
    assert list(found.cells) == ["z"]
    assert found.apart["k"].startswith(
        "is not sampled at the times named (20 rows of its own, 'fast/time' has 100)"
    )
    toml = GOOD.replace("data.csv", rates.name).replace('time = "time"', 'time = "fast/time"')
    for old, new in (("torque", "k"), ("n_wheel", "x"), ('omega"', 'z"')):
        toml = toml.replace(old, new)
    file = rates.parent / "experiment.toml"
    file.write_text(toml)
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, "[inputs] T_P: column 'k' of")


def test_groups_of_equal_times_are_one(tmp_path):
    mdf(tmp_path / "a.mf4", {"a": RATES["fast"], "b": {"time": FAST, "y": 2 * FAST}})
    tdms(tmp_path / "a.tdms", {"a": {"z": -FAST}, "b": {"y": 2 * FAST}}, waveform=(0.01, 0.5))
    for name, offset in (("a.mf4", 0.0), ("a.tdms", 0.5)):
        found = sheet(tmp_path / name, "time", "time", "z", "y").cells
        assert_allclose(found["time"], FAST + offset, atol=1e-15)
        assert_array_equal(found["z"], -FAST)
        assert_array_equal(found["y"], 2 * FAST)
        assert "y" in READERS[Path(name).suffix](tmp_path / name)


def test_a_name_in_two_groups_needs_its_group(tmp_path):
    mdf(tmp_path / "a.mf4", {"a": {"time": FAST, "y": FAST}, "b": {"time": FAST, "y": 2 * FAST}})
    with pytest.raises(BadInput, match="column 'y' may be 'a/y', 'b/y'; give the full name"):
        sheet(tmp_path / "a.mf4", "time", "y")
    assert_array_equal(sheet(tmp_path / "a.mf4", "time", "b/y").cells["b/y"], 2 * FAST)
    assert {"a/y", "b/y"} <= set(READERS[".mf4"](tmp_path / "a.mf4"))


def test_groups_without_names_have_numbers(tmp_path):
    mdf(tmp_path / "a.mdf", RATES, version="3.30")
    assert_array_equal(sheet(tmp_path / "a.mdf", "group 1/time", "x").cells["x"], SLOW**3)


# --- values


def test_dates_count_from_the_first(tmp_path):
    columns = table()
    stamps = np.datetime64("2024-05-01T12:00", "us") + np.round(columns["time"] * 1e6).astype("m8[us]")
    for kind in ("parquet", "tdms"):
        record = load(experiment(tmp_path, kind, columns | {"time": stamps}))
        assert_allclose(record.runs[0].t, columns["time"], atol=1e-12)
        assert any("0 s is 2024-05-01 12:00:00" in n.sentence for n in record.notes)
    with pytest.raises(BadInput, match=r"row 1: column 'torque' holds '2024-05-01.*', not a number"):
        load(experiment(tmp_path, "parquet", columns | {"torque": stamps}))


@pytest.mark.parametrize("kind", ["parquet", "tdms", "mdf 4"])
def test_switches_are_0_and_1(tmp_path, kind):
    columns = table() | {"torque": table()["torque"] > 0}
    assert_array_equal(load(experiment(tmp_path, kind, columns)).runs[0].u[:, 0], 1.0 * columns["torque"])


def test_words_are_refused_with_their_row(tmp_path):
    words = np.array(["on"] * 1001, dtype=object)
    with pytest.raises(BadInput, match="row 1: column 'torque' holds 'on', not a number"):
        load(experiment(tmp_path, "parquet", table() | {"torque": words}))


def test_invalid_samples_of_mdf_are_no_numbers(tmp_path):
    from asammdf import MDF, Signal

    invalid = np.arange(100) == 7
    with MDF(version="4.10") as m:
        m.append([Signal(FAST, FAST, name="x", invalidation_bits=invalid)])
        m.save(tmp_path / "a.mf4")
    found = sheet(tmp_path / "a.mf4", "time", "x").numbers("x")
    assert_array_equal(np.isnan(found), invalid)


def test_an_index_of_pandas_is_a_column(tmp_path):
    pd.DataFrame({"x": FAST}, index=pd.Index(SLOW.repeat(5), name="time")).to_parquet(tmp_path / "a.parquet")
    assert_array_equal(sheet(tmp_path / "a.parquet", "time", "time").cells["time"], SLOW.repeat(5))


# --- names of MATLAB


def test_names_are_those_of_matlab(tmp_path):
    from scipy.io import savemat

    structs = np.zeros((1, 2), dtype=[("Name", "O"), ("Data", "O")])
    structs[0] = [("a", FAST[None]), ("b", 2 * FAST[None])]
    cells = np.empty((1, 2), dtype=object)
    cells[0] = [FAST[None], "text"]
    variables = {
        "M": np.column_stack([FAST, FAST**2]), "rig": {"t": FAST, "sub": {"x": -FAST}}, "Y": structs,
        "c": cells, "gain": 3.0, "text": "words", "z": FAST + 1j, "on": FAST > 0.5,
    }  # fmt: skip
    savemat(tmp_path / "a.mat", variables)
    names = ("M(:,2)", "rig.sub.x", "Y(2).Data", "c{1}", "on")
    found = sheet(tmp_path / "a.mat", "rig.t", *names)
    for name, x in zip(names, (FAST**2, -FAST, 2 * FAST, FAST, FAST > 0.5), strict=True):
        assert_array_equal(found.cells[name], x)
    assert set(found.known) == {*names, "M(:,1)", "rig.t", "Y(1).Data"}


def test_names_are_the_same_in_version_73(tmp_path):
    import h5py

    file = tmp_path / "a.mat"
    arrays = {
        "M": (np.stack([FAST, FAST**2]), "double"), "rig/t": (FAST[None], "double"),
        "rig/sub/x": (-FAST[:, None], "single"), "gain": (np.ones((1, 1)), "double"),
        "text": (np.arange(5, dtype="u2")[:, None], "char"),
        "on": ((FAST > 0.5).astype("u1")[None], "logical"),
    }  # fmt: skip
    hdf5(file, arrays)
    with h5py.File(file, "r+") as f:
        kept = f.create_group("#refs#")
        for name, x in (("a", FAST[None]), ("b", 2 * FAST[None])):
            kept[name] = x
            kept[name].attrs["MATLAB_class"] = np.bytes_("double")
        links = np.array([[kept["a"].ref, kept["b"].ref]], dtype=h5py.ref_dtype)
        f["c"] = links
        f["c"].attrs["MATLAB_class"] = np.bytes_("cell")
        f["Y/Data"] = links
        f["Y"].attrs["MATLAB_class"] = np.bytes_("struct")
    names = ("M(:,2)", "rig.sub.x", "Y(2).Data", "c{1}", "on")
    found = sheet(file, "rig.t", *names)
    for name, x in zip(names, (FAST**2, -FAST, 2 * FAST, FAST, FAST > 0.5), strict=True):
        assert_array_equal(found.cells[name], x)
    assert set(found.known) == {*names, "M(:,1)", "rig.t", "Y(1).Data", "c{2}"}


def test_a_table_of_matlab_is_refused_with_the_way_out(tmp_path):
    hdf5(tmp_path / "a.mat", {"t": (FAST[None], "double"), "T": (np.arange(6, dtype="u4")[None], "table")})
    assert sheet(tmp_path / "a.mat", "t", "t").known == ("t",)
    with pytest.raises(BadInput, match=r"'T\.x' is not in it as numbers, but objects are.*table2struct"):
        sheet(tmp_path / "a.mat", "t", "T.x")
