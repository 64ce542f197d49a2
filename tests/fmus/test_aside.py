"""Long arrays that lie in files: they stay equal to those in memory, and give memory and disk back."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from fmus import aside
from fmus.aside import blocks, by_rows, joined, let_go, mean_square, set_aside
from fmus.errors import BadInput

MEGABYTE = 1 << 20


@pytest.fixture
def short_is_long(monkeypatch):
    """Every array is long, and every file and block is short."""
    monkeypatch.setattr(aside, "LONG", 1)
    monkeypatch.setattr(aside, "FILE", 8192)
    monkeypatch.setattr(aside, "BLOCK", 256)
    monkeypatch.setattr(aside._SHELF, "_last", None)  # a file of an earlier test may have room


def mapped() -> int:
    """How many files of arrays are mapped into this process."""
    return Path("/proc/self/maps").read_text().count("railfmi_aside_")


def resident() -> int:
    """Bytes of mapped files that are in memory."""
    status = Path("/proc/self/status").read_text()
    [line] = [line for line in status.splitlines() if line.startswith("RssFile")]
    return 1024 * int(line.split()[1])


@pytest.mark.parametrize("dtype", [np.float64, np.complex128, np.bool_])
@pytest.mark.parametrize("shape", [(5000,), (700, 3), (0, 3), (20, 4, 5)])
def test_an_array_is_the_same_in_its_file(short_is_long, dtype, shape):
    rng = np.random.default_rng(0)
    x = (100 * rng.standard_normal(shape)).astype(dtype)
    for given_ in (x, x.T, x[::2]):
        found = set_aside(given_)
        let_go()
        assert_array_equal(found, given_)
        assert found.dtype == dtype
    assert set_aside(x.T).flags.f_contiguous == x.T.flags.f_contiguous


def test_a_short_array_stays_as_it_is():
    x = np.ones(1000)
    assert set_aside(x) is x
    assert x.flags.writeable


def test_a_long_array_is_read_only():
    x = set_aside(np.ones(MEGABYTE))
    with pytest.raises(ValueError, match="read-only"):
        x[0] = 2.0


def test_arrays_of_several_files_do_not_touch_each_other(short_is_long):
    some = [np.full(k, float(k)) for k in range(1, 2000, 37)]
    put = [set_aside(x) for x in some]
    for x, y in zip(some, put, strict=True):
        assert_array_equal(x, y)


def test_files_vanish_with_their_arrays(short_is_long):
    before = mapped()
    some = [set_aside(np.ones(2000)) for _ in range(5)]
    assert mapped() >= before + 4
    del some
    set_aside(np.ones(2000))  # the last file is kept for the next array
    assert mapped() <= before + 1


def test_memory_is_given_back_and_the_numbers_stay():
    x = set_aside(np.arange(8 * MEGABYTE, dtype=float))
    let_go()
    before = resident()
    total = x.sum()
    assert resident() > before + x.nbytes // 2
    let_go()
    assert resident() < before + x.nbytes // 4
    assert x.sum() == total


def test_a_full_disk_is_said_with_the_way_out(short_is_long, monkeypatch):
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(BadInput, match=r"No space left on device.*TMPDIR"):
        set_aside(np.ones(100))


def test_a_forked_process_does_not_write_into_its_parents_file(short_is_long):
    set_aside(np.zeros(8))  # opens a file with room left
    if not (child := os.fork()):
        set_aside(np.full(64, 7.0))
        os._exit(0)
    os.waitpid(child, 0)
    assert_array_equal(set_aside(np.ones(64)), 1.0)


@given(rows=st.integers(0, 10**4), row_bytes=st.integers(0, 10**8), multiple=st.integers(1, 20))
def test_blocks_follow_each_other_without_a_gap(rows, row_bytes, multiple):
    some = blocks(rows, row_bytes, multiple)
    assert [b.start for b in some] == [0, *(b.stop for b in some[:-1])]
    assert some[-1].stop == rows
    assert all((b.stop - b.start) % multiple == 0 for b in some[:-1])


def test_what_is_made_in_blocks_is_what_is_made_at_once(short_is_long):
    x = np.random.default_rng(1).standard_normal((1000, 3))
    assert len(blocks(len(x), 24)) > 10
    assert_array_equal(by_rows(x.shape, lambda rows: x[rows]), x)
    assert_array_equal(joined([x[:300], x[300:]]), x)
    np.testing.assert_allclose(mean_square(lambda rows: x[rows], len(x), 24), np.mean(x**2, axis=0))
