"""Formats of data files: each gives the record that CSV gives; rasters, units, names, what is refused."""

import gzip
import inspect
import json
import re
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.record import Record
from fmus.errors import BadInput
from fmus.host.master.recording import Recording
from fmus.units import base_exponents
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.readers import READERS, read_sheet
from scenarios.experiment.readers.header import units_in_names
from scenarios.experiment.readers.layout import layout_of
from scenarios.experiment.readers.mat import Mat
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import StatedUnits
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


def write_lines(file, columns, units, separator=";", decimal=",", encoding="utf-8"):
    """As loggers write it: a line of units below the names, in a file that states any."""
    text = pd.DataFrame(columns).to_csv(None, index=False, sep=separator, decimal=decimal)
    names, rows = text.split("\n", 1)
    stated = separator.join(f"[{units[n]}]" if n in units else "" for n in columns)
    lines = [names, stated, rows] if units else [names, rows]
    content = "\r\n".join("\n".join(lines).split("\n")).encode(encoding)
    file.write_bytes(gzip.compress(content) if file.suffix == ".gz" else content)


def write_excel(file, columns, units):
    rows = pd.DataFrame(columns)
    if units:
        rows = pd.concat([pd.DataFrame([{n: f"[{units[n]}]" if n in units else "" for n in columns}]), rows])
    rows.to_excel(file, index=False)


def write_hdf5(file, columns, units):
    import h5py

    with h5py.File(file, "w") as f:
        for name, x in columns.items():
            f[name] = x
            if name in units:
                f[name].attrs["unit"] = units[name]


WRITERS = {
    "csv": (write_csv, "data.csv"),
    "csv, lines": (write_lines, "data.csv"),
    "csv, zipped": (write_lines, "data.csv.gz"),
    "csv, UTF-16": (partial(write_lines, encoding="utf-16"), "data.csv"),
    "txt, mark": (partial(write_lines, separator=" ", decimal=".", encoding="utf-8-sig"), "data.txt"),
    "txt, zipped": (write_lines, "data.txt.gz"),
    "tsv": (partial(write_lines, separator="\t"), "data.tsv"),
    "tsv, zipped": (partial(write_lines, separator="\t"), "data.tsv.gz"),
    "excel": (write_excel, "data.xlsx"),
    "excel, macros": (write_excel, "data.xlsm"),
    "hdf5": (write_hdf5, "data.h5"),
    "hdf5, long": (write_hdf5, "data.hdf5"),
    "parquet": (write_parquet, "data.parquet"),
    "mat": (write_mat, "data.mat"),
    "mat 7.3": (write_mat73, "data.mat"),
    "tdms": (write_tdms, "data.tdms"),
    "tdms waveforms": (write_waveforms, "data.tdms"),
    "mdf 4": (write_mdf, "data.mf4"),
    "mdf 3": (write_mdf3, "data.mdf"),
}
BEHIND = (  # a name in brackets, as people write it
    "Grad Gs Mm MA Ms Gm Max Min max min Soll Ist soll ist links rechts L R l r ges abs rel raw roh cal MW "
    "mean Mittel std Std St kn KN Mg mg Masse Mol Gas Tag Tage Jahr day h t T in out ft Mess Dach Pass Mast"
)
BLANKS = "txt, mark"  # blanks between the columns, so that each needs a unit in the line of units
WITH_UNITS = [kind for kind in WRITERS if not kind.startswith("mat") and kind != BLANKS]
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
    assert_allclose(a.u, b.u, rtol=1e-15)  # Excel keeps 16 digits
    assert_allclose(a.y[:, 0], b.y[:, 0], rtol=1e-15)
    assert_allclose(a.y[:, 1], b.y[:, 1], rtol=1e-9)  # a derivative over these times
    assert_array_equal(a.fit, b.fit)
    assert_array_equal(a.test, b.test)


def test_every_format_is_tested():
    own = {s for s, reader in READERS.items() if ROOT in Path(inspect.getfile(type(reader))).parents}
    assert {"".join(Path(name).suffixes) for _, name in WRITERS.values()} == own


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
        ("n_wheel", "Hz", "write unit = \"Hz\", or correct the file"),
        ("omega", "deg/s", "states '(deg/s)/s' for it"),
        ("torque", "m", "unit 'm' does not fit 'N.m'"),
    ],
)  # fmt: skip
def test_units_that_contradict_are_refused(tmp_path, kind, column, unit, words):
    file = experiment(tmp_path, kind, units={column: unit})
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, words)


@pytest.mark.parametrize(
    ("column", "word", "declared", "said"),
    [
        ("n (min)", "min", "rpm", ["'min', which is of another kind; it is taken as rpm, as declared"]),
        ("n", "Kästchen", "rpm", ["'Kästchen', which is not known; it is taken as rpm, as declared"]),
        ("acc", "g", "g_0", []),
        ("time", "S", "s", []),
    ],
)
def test_a_word_that_need_not_be_the_unit_does_not_outdo_the_declared_one(column, word, declared, said):
    """A minimum, an acceleration in g, seconds: who declares the unit knows what the word means."""
    stated = StatedUnits(Sheet(Path("a.csv"), pd.DataFrame({column: [0.0]}), (column,), {column: word}))
    stated.check(column, 0, declared, "[outputs.y]")
    assert [n.sentence.partition("unit ")[2] for n in stated.notes] == said


@pytest.mark.parametrize(
    ("word", "declared", "way"),
    [
        ("m", "rpm", "states 'm' for it; name another column than 'x'"),
        ("kN", "N", 'write unit = "kN"'),
        ("g", "m/s2", 'write unit = "g_0"'),
    ],
)
def test_a_unit_of_the_file_that_contradicts_is_refused_with_a_way_out_that_works(word, declared, way):
    stated = StatedUnits(Sheet(Path("a.csv"), pd.DataFrame({"x": [0.0]}), ("x",), {"x": word}))
    with pytest.raises(BadInput, match=re.escape(way)):
        stated.check("x", 0, declared, "[outputs.y]")


def test_the_time_may_be_declared_in_seconds_that_the_file_writes_as_siemens(tmp_path):
    file = experiment(tmp_path, "csv", units={"time": "S"})
    with pytest.raises(BadInput, match=r"unit 'S' does not fit 's'; .*declare it: .*time_unit"):
        load(file)
    file.write_text('time_unit = "s"\n' + file.read_text())
    assert load(file)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("q[1]", None), ("q(12)", None), ("q [1]", "1"), ("phi [Grad]", "deg"), ("w (Grad/s)", "deg/s"),
        ("x [μm]", "μm"), ("Q [l/min]", "l/min"), ("n (mean)", None), ("v [Gs]", None), ("a[m/s2]", "m/s2"),
        ("F [kN](:,1)", "kN"), ("set(:,1)", None),
    ],
)  # fmt: skip
def test_what_stands_in_brackets(name, unit):
    assert units_in_names([name]) == ({name: unit} if unit else {})


@pytest.mark.parametrize("kind", [kind for kind in WRITERS if not kind.startswith("mat")])
def test_a_unit_in_brackets_behind_a_name_counts_in_every_format(tmp_path, kind):
    """A channel of a recorder and a frame of pandas keep the names of the CSV; MATLAB allows none such."""
    writer, name = WRITERS[kind]
    columns = {c if c in ("time", "omega") else f"{c}[{UNITS[c]}]": x for c, x in table().items()}
    writer(tmp_path / name, columns, {})
    units = read_sheet(tmp_path / name, "time").units
    assert {c: u for c, u in units.items() if c != "time"} == {"torque[N.m]": "N.m", "n_wheel[rpm]": "rpm"}


def test_a_unit_that_the_format_states_counts_before_the_one_in_a_name(tmp_path):
    for stated, counts in (("kN.m", "kN.m"), ("", "N.m"), (" ", "N.m")):
        write_parquet(tmp_path / "data.parquet", {"M [Nm]": np.arange(3.0)}, {"M [Nm]": stated})
        assert read_sheet(tmp_path / "data.parquet").units == {"M [Nm]": counts}


@given(st.sampled_from(BEHIND.split()), st.sampled_from(["x [{}]", "x ({})", "x({})"]))
def test_no_word_in_brackets_is_a_huge_unit(word, name):
    for unit in units_in_names([name.format(word)]).values():
        assert base_exponents(unit).factor <= 1e6  # MW, which is a German mean, too


@pytest.mark.parametrize("kind", ["csv", "parquet", "mdf 4"])
def test_an_unknown_unit_of_an_input_is_an_error(tmp_path, kind):
    """Nobody has said what its numbers are, so they must not be compared with anything."""
    file = experiment(tmp_path, kind, units={"torque": "Kästchen"})
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, "has the unit 'Kästchen', which is not known; declare one that is")


def test_an_unknown_unit_of_the_time_is_an_error_unless_one_is_declared(tmp_path):
    file = experiment(tmp_path, "csv", units={"time": "Takte"})
    with pytest.raises(BadInput, match=r"'Takte', which is not known; .*time_unit"):
        load(file)
    file.write_text('time_unit = "ms"\n' + file.read_text().replace("[0.0, 6.0]", "[0.0, 0.006]"))
    with pytest.raises(BadInput, match="test"):  # its windows are in seconds, the record is 10 ms long
        load(file)


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
    monkeypatch.setattr(Mat, "fragile", False)  # to be read in this process, which lacks the package
    with pytest.raises(BadInput) as refused:
        load(file)
    assert_one_clear_line(refused, file, f"run 'pip install {module}', or convert the file to CSV")


def test_between_blanks_no_cell_can_be_empty(tmp_path):
    with pytest.raises(BadInput, match="line 3: has fewer cells than there are names"):
        read_sheet(lines(tmp_path, "t n m\n0 1 2\n1 2\n", "log.txt"))


def test_a_mat_file_that_crashes_its_library_is_refused(tmp_path):
    """SciPy 1.17 ends the process with a segmentation fault at this byte, of the flags of an array."""
    file = tmp_path / "data.mat"
    write_mat(file, {"t": np.arange(9.0), "x": np.arange(9.0)}, {})
    data = bytearray(file.read_bytes())
    data[145] = 255
    file.write_bytes(data)
    with pytest.raises(BadInput, match=r"not a sound MAT file \(it brings down the process that reads it"):
        read_sheet(file)


@pytest.mark.parametrize("kind", [kind for kind in WRITERS if kind != BLANKS])
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


@pytest.mark.parametrize("version", ["4.10", "3.30"])
@pytest.mark.parametrize(
    ("formula", "right"),
    [("2*X1+1", True), ("X1**2", True), ("X1^2.5", False), ("open('ran', 'w') and X1", False)],
)
def test_a_formula_of_mdf_is_evaluated_or_refused_and_never_run(
    version, formula, right, tmp_path, monkeypatch
):
    from asammdf import MDF, Signal

    ran = tmp_path / "ran"
    formula = formula.replace("ran", str(ran))
    written = formula if version > "4" else formula.replace("X1", "X")  # as the library writes each version
    with MDF(version=version) as m:
        m.append([Signal(np.arange(100.0), FAST, name="x", conversion={"formula": written})])
        m.save(tmp_path / "a.mf4" if version > "4" else tmp_path / "a.mdf")
    (file,) = tmp_path.glob("a.*")
    if right:
        X1 = np.arange(100.0)  # noqa: F841 - of the formula
        assert_array_equal(sheet(file, "time", "x").numbers("x"), eval(formula))
    else:
        with pytest.raises(BadInput, match=r"its formula .* is no arithmetic of X"):
            sheet(file, "time", "x").numbers("x")
    assert not ran.exists()


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


# --- text files as they are


def lines(folder: Path, text: str, name: str = "log.csv", encoding: str = "utf-8") -> Path:
    file = folder / name
    file.write_bytes(text.encode(encoding))
    return file


@pytest.mark.parametrize(
    ("text", "units"),
    [
        ("t,n\ns,U/min\n0,1.5\n1,2\n", {"t": "s", "n": "rpm"}),
        ("t;n\n[s];[rpm]\n0;1,5\n1;2\n", {"t": "s", "n": "rpm"}),
        ("t;n, filtered\n0;1,5\n1;2\n", {}),
        ("t [ms];n (rpm)\n0;1,5\n1;2,0\n", {"t [ms]": "ms", "n (rpm)": "rpm"}),
        ("t\tn\n0\t1.5\n1\t2\n", {}),
        ("t  n\n0  1.5\n1  2\n", {}),
    ],
)
def test_layouts(tmp_path, text, units):
    sheet = read_sheet(lines(tmp_path, text))
    assert_array_equal(sheet.numbers(sheet.known[1]), [1.5, 2.0])
    assert dict(sheet.units) == units


@given(
    st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", ".")]),
    st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=2, max_size=20),
    st.booleans(),
)
def test_numbers_survive_any_layout(tmp_path_factory, how, rows, stated):
    separator, decimal = how
    cells = pd.DataFrame(rows, columns=["a", "b", "c"]) + 0.5
    text = cells.to_csv(None, index=False, sep=separator, decimal=decimal)
    if stated:
        names, below = text.split("\n", 1)
        text = f"{names}\n{separator.join(['s', 'rpm', '%'])}\n{below}"
    sheet = read_sheet(lines(tmp_path_factory.mktemp("layout"), text))
    assert_allclose(sheet.cells.to_numpy(dtype=float), cells.to_numpy(), rtol=1e-15)
    assert sheet.first == 2 + stated


def test_a_wrong_cell_is_found_below_a_line_of_units(tmp_path):
    sheet = read_sheet(lines(tmp_path, "t,n\ns,rpm\n0,1\n1,2\n2,off\n"))
    with pytest.raises(BadInput, match="line 5: column 'n' holds 'off', not a number"):
        sheet.numbers("n")


def test_words_in_the_first_row_are_no_units(tmp_path):
    sheet = read_sheet(lines(tmp_path, "t,n\nstart,idle\n0,1\n"))
    assert sheet.first == 2
    with pytest.raises(BadInput, match="line 2: column 'n' holds 'idle'"):
        sheet.numbers("n")


def test_dates_are_times(tmp_path):
    file = experiment(tmp_path, "csv")
    data = pd.read_csv(tmp_path / "data.csv")
    begin = pd.Timestamp("2024-05-01 23:59:58")
    data["time"] = [str(begin + pd.Timedelta(seconds=t)) for t in data["time"]]
    data.to_csv(tmp_path / "data.csv", index=False)
    assert_allclose(load(file).runs[0].t, table()["time"], atol=1e-9)


def options(folder: Path, said: str) -> Path:
    """The good experiment with [data] in place of the key."""
    file = experiment(folder, "csv")
    file.write_text(GOOD.replace('data = "data.csv"', "") + f'\n[data]\nfile = "data.csv"\n{said}\n')
    return file


def test_options_of_the_library_are_passed_on(tmp_path):
    file = options(tmp_path, "skiprows = 2\nna_values = [-999]")
    text = (tmp_path / "data.csv").read_text()
    (tmp_path / "data.csv").write_text("Logger 7\nserial; 4, of 5\n" + text)
    (tmp_path / "plain").mkdir()
    assert_same(load(file), load(experiment(tmp_path / "plain", "csv")))
    data = pd.read_csv(tmp_path / "plain" / "data.csv")
    data.loc[5, "torque"] = -999
    (tmp_path / "data.csv").write_text("Logger 7\nserial; 4, of 5\n" + data.to_csv(index=False))
    with pytest.raises(BadInput, match="column 'torque' has no number in 1 of 1001 rows"):
        load(file)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("skprows = 2", "cannot be read with the options skprows of [data]"),
        ('skiprows = "two"', "[data] skiprows = 'two' must be the number of lines"),
        ('encoding = "utf-9"', "is not text in the encoding utf-9"),
    ],
)
def test_wrong_options_are_one_clear_line(tmp_path, said, words):
    with pytest.raises(BadInput) as refused:
        load(options(tmp_path, said))
    assert "\n" not in str(refused.value)
    assert words in str(refused.value)


@pytest.mark.parametrize("zipped", [False, True])
def test_the_encoding_of_windows_is_recognised_and_told(tmp_path, zipped):
    text = "t;Weg in °\n" + "0;1\n1;2\n"
    file = lines(tmp_path, text, encoding="cp1252")
    if zipped:
        file = file.rename(tmp_path / "log.csv")
        (tmp_path / "log.csv.gz").write_bytes(gzip.compress(file.read_bytes()))
        file = tmp_path / "log.csv.gz"
    sheet = read_sheet(file)
    assert "Weg in °" in sheet.known
    assert "not UTF-8; its names and units are read as cp1252" in sheet.remarks[0]
    assert read_sheet(file, options={"encoding": "cp1252"}).remarks == ()


def test_utf_8_is_recognised_where_the_part_looked_at_ends_within_a_letter(tmp_path):
    content = b"t;x\n" + b"".join(b"%d;%d\n" % (i, i) for i in range(20_000))
    cut = 65_536 - 1  # the two bytes of this letter lie on both sides of the end of that part
    file = tmp_path / "log.csv"
    file.write_bytes(content[:cut] + "µ".encode() + content[cut + 2 :])
    assert layout_of(file, {}).encoding == "utf-8"


def test_what_is_no_text_of_windows_either_has_to_be_said(tmp_path):
    file = lines(tmp_path, "t;Weg in\x81\n0;1\n1;2\n", encoding="latin-1")
    with pytest.raises(BadInput, match=r'such as \[data\] encoding = "latin-1"'):
        read_sheet(file)


def test_a_table_and_a_matrix_of_hdf5(tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as f:
        f["rig/log"] = np.array([(0.0, 5.0), (1.0, 6.0)], dtype=[("t", "f8"), ("F", "f4")])
        f["rig/Y"] = np.array([[1.0, 2.0], [3.0, 4.0]])
        f["rig/name"] = "bench"
    sheet = read_sheet(tmp_path / "a.h5")
    assert set(sheet.known) == {"rig/log/t", "rig/log/F", "rig/Y(:,1)", "rig/Y(:,2)"}
    assert_array_equal(sheet.numbers("rig/Y(:,2)"), [2.0, 4.0])
    assert_array_equal(sheet.numbers("rig/log/F"), [5.0, 6.0])


def test_samples_without_an_output_belong_to_no_part(tmp_path):
    columns = table()
    columns["n_wheel"][[100, 101, 700]] = np.nan
    record = load(experiment(tmp_path, "csv", columns))
    run = record.runs[0]
    assert not (run.fit | run.choose | run.test)[[100, 101, 700]].any()
    assert np.isfinite(run.y).all()
    assert any("no number in 3 of 1001 rows, which are left out" in n.sentence for n in record.notes)


def test_a_record_tells_how_its_columns_are_converted(tmp_path):
    found = {c.variable: c for c in load(experiment(tmp_path, "csv", units={"torque": "N.m"})).conversions}
    assert (found["omega_w"].unit, found["omega_w"].model_unit) == ("rpm", "rad/s")
    assert found["omega_w"].factor == pytest.approx(np.pi / 30)
    assert (found["T_P"].unit, found["T_P"].factor) == ("N.m", 1.0)


# --- what files of other tools hold beside numbers


def test_times_of_day_of_a_workbook_are_times(tmp_path):
    file = tmp_path / "data.xlsx"
    times = pd.date_range("2026-11-30 23:59:50", periods=20, freq="1s")
    pd.DataFrame({"time": [t.time() for t in times], "n": range(20)}).to_excel(file, index=False)
    assert_allclose(StatedUnits(read_sheet(file)).seconds("time", "time"), 86390.0 + np.arange(20))


def test_days_of_a_parquet_file_are_dates(tmp_path):
    file = tmp_path / "data.parquet"
    days = pa.array(pd.date_range("2026-11-30", periods=5, freq="D").date)
    pq.write_table(pa.table({"time": days, "n": pa.array(np.arange(5.0))}), file)
    assert_allclose(StatedUnits(read_sheet(file)).seconds("time", "time"), 86400.0 * np.arange(5))


def test_names_that_differ_in_blanks_occur_twice(tmp_path):
    file = tmp_path / "data.xlsx"
    pd.DataFrame({"time": [0.0, 1.0], "v": [1.0, 2.0], "v ": [3.0, 4.0]}).to_excel(file, index=False)
    with pytest.raises(BadInput, match="row 1: column 'v' occurs twice; rename one"):
        read_sheet(file)


def test_an_array_in_each_row_does_not_keep_the_others_from_being_read(tmp_path):
    bytes_ = np.zeros((10, 8), dtype=np.uint8)
    mdf(tmp_path / "data.mf4", {"log": {"time": np.arange(10.0), "v": np.arange(10.0), "bytes": bytes_}})
    sheet = read_sheet(tmp_path / "data.mf4")
    assert_array_equal(sheet.numbers("v"), np.arange(10.0))
    assert sheet.apart["bytes"].startswith("holds an array in each row")
