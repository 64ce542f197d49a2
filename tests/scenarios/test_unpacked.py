"""Small files that would become large ones: each is refused in one line before it fills the memory."""

import gzip
import resource

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal
from openpyxl import Workbook
from scipy.io import savemat

from fmus import limits, taken
from fmus.errors import BadInput
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.readers.mat import Mat

ROWS = 4000
SMALL = 2e-5  # GB, less than the numbers of ROWS rows of three columns
COLUMNS = {name: np.zeros(ROWS) for name in ("t", "F", "x")}


def gz(file):
    file.write_bytes(gzip.compress(pd.DataFrame(COLUMNS).to_csv(index=False).encode()))


def parquet(file):
    pq.write_table(pa.table(COLUMNS), file)


def hdf5(file):
    with h5py.File(file, "w") as target:
        for name in COLUMNS:
            target.create_dataset(name, shape=ROWS, dtype="f8", chunks=True)  # nothing of it is written


def mat(file):
    savemat(file, COLUMNS, do_compression=True)


def mdf(file):
    made = MDF(version="4.10")
    made.append([Signal(COLUMNS[n], np.arange(ROWS) * 0.01, name=n) for n in ("F", "x")])
    made.save(file, overwrite=True, compression=1)
    made.close()


def excel(file):
    pd.DataFrame(COLUMNS).to_excel(file, index=False)


WRITTEN = {"a.csv.gz": gz, "a.parquet": parquet, "a.h5": hdf5, "a.mat": mat, "a.mf4": mdf, "a.xlsx": excel}


@pytest.mark.parametrize("name", WRITTEN)
def test_what_becomes_too_large_is_refused_and_what_does_not_is_read(name, tmp_path, monkeypatch):
    file = tmp_path / name
    WRITTEN[name](file)
    monkeypatch.setattr(Mat, "fragile", False)  # to be read in this process, whose limit is set here
    time = "t" if name != "a.mf4" else None
    assert len(read_sheet(file, time).cells) == ROWS
    monkeypatch.setattr(limits, "RECORD", SMALL)
    with pytest.raises(BadInput, match=rf"{name}: holds .* GB, more than 2e-05 GB; cut it") as told:
        read_sheet(file, time)
    assert "\n" not in str(told.value)


def test_columns_that_are_not_wanted_do_not_count(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "RECORD", 1.7 * ROWS * taken.NUMBER / taken.GB)
    for name in ("a.parquet", "a.h5"):
        WRITTEN[name](tmp_path / name)
        assert len(read_sheet(tmp_path / name, "t", ["t"]).cells) == ROWS
        with pytest.raises(BadInput, match="cut it"):
            read_sheet(tmp_path / name, "t", ["t", "x"])


def test_a_file_of_2_kb_that_says_it_holds_80_tb(tmp_path):
    """At the true limit, and without the memory: nothing of it may be asked for."""
    file = tmp_path / "a.h5"
    with h5py.File(file, "w") as target:
        target.create_dataset("t", shape=10**13, dtype="f8", chunks=True)
    assert file.stat().st_size < 1e4
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(BadInput, match=r"a\.h5: holds 8e\+04 GB, more than 8 GB"):
        read_sheet(file, "t", ["t"])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1e5  # kB


def test_one_cell_far_out_is_a_large_worksheet(tmp_path):
    """The last row and column of Excel: 1.7e10 cells, of which one is filled."""
    book = Workbook()
    book.active.append(["t", "x"])
    book.active.cell(1_048_576, 16_384, 1.0)
    book.save(tmp_path / "a.xlsx")
    with pytest.raises(BadInput, match=r"a\.xlsx: holds 137 GB"):
        read_sheet(tmp_path / "a.xlsx", "t")


def test_a_worksheet_that_is_not_read_does_not_count(tmp_path, monkeypatch):
    book = Workbook()
    book.active.append(["t", "x"])
    book.active.append([0.0, 1.0])
    for _ in range(100):
        book.create_sheet("more" if len(book.sheetnames) == 1 else None).append([0.0] * 50)
    book.save(tmp_path / "a.xlsx")
    monkeypatch.setattr(limits, "RECORD", 1e-7)
    assert len(read_sheet(tmp_path / "a.xlsx", "t").cells) == 1
    with pytest.raises(BadInput, match="cut it"):
        read_sheet(tmp_path / "a.xlsx", None, None, {"sheet_name": "more"})


def test_a_zip_of_too_much_xml_is_not_opened(tmp_path, monkeypatch):
    excel(tmp_path / "a.xlsx")
    monkeypatch.setattr(limits, "UNPACKED", 1e-6)
    with pytest.raises(BadInput, match=r"a\.xlsx: holds .* GB, more than 1e-06 GB; pack only"):
        read_sheet(tmp_path / "a.xlsx", "t")


def test_text_that_cannot_grow_beyond_the_limit_is_unpacked_once(tmp_path, monkeypatch):
    """The bound of deflate spares the usual file a second reading."""
    gz(tmp_path / "a.csv.gz")
    opened = []
    real = gzip.open
    monkeypatch.setattr(taken.gzip, "open", lambda *given: opened.append(given) or real(*given))
    taken.check_gzip(tmp_path / "a.csv.gz")
    assert not opened
    monkeypatch.setattr(limits, "RECORD", 1e-4)
    taken.check_gzip(tmp_path / "a.csv.gz")
    assert opened


def test_deflate_does_not_do_better_than_its_bound():
    """Of zeros, which it packs best."""
    n = 50_000_000
    assert n / len(gzip.compress(bytes(n))) < taken.DEFLATE
