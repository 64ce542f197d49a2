"""HDF5 and MAT 7.3 files that lead out of themselves: refused in one line, and no other file is opened."""

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fmus.errors import BadInput
from scenarios.cli.app import run_safely
from scenarios.experiment.readers import read_sheet

T = np.arange(50) * 0.01
SECRET = np.full(50, 17.25)


def elsewhere(folder: Path) -> None:
    """Files that nobody asked for: numbers in HDF5 and raw, and a pipe, which whoever opens it waits for."""
    with h5py.File(folder / "secret.h5", "w") as f:
        f["x"] = SECRET
        f["rows"] = SECRET[None]
    (folder / "secret.bin").write_bytes(SECRET.tobytes())
    os.mkfifo(folder / "pipe")


def external(at, path="x"):
    at.create_dataset(path, T.shape, "f8", external=[("secret.bin", 0, h5py.h5f.UNLIMITED)])


def virtual(at, path="x", source="secret.h5", most=None):
    layout = h5py.VirtualLayout(T.shape, "f8", maxshape=most)
    layout[:] = h5py.VirtualSource(source, "x", T.shape)
    at.create_virtual_dataset(path, layout)


def growing(at):
    """A virtual data set whose length is looked up in the other file as soon as it is asked for."""
    layout = h5py.VirtualLayout(T.shape, "f8", maxshape=(None,))
    source = h5py.VirtualSource("pipe", "x", T.shape, maxshape=(None,))
    layout[: h5py.h5s.UNLIMITED] = source[: h5py.h5s.UNLIMITED]
    at.create_virtual_dataset("x", layout)


def deep(at):
    external(at.create_group("a").create_group("b"))


def soft_way(at):
    """A link on the way to a data set, not the data set itself."""
    at["own/x"] = T
    at["short"] = h5py.SoftLink("/own")


def in_cell(at):
    """A data set that only a reference leads to."""
    external(at.create_group("#refs#"), "a")
    at["x"] = np.array([[at["#refs#/a"].ref]], dtype=h5py.ref_dtype)
    at["x"].attrs["MATLAB_class"] = np.bytes_("cell")


def link_in_struct(at):
    at.create_group("s").attrs["MATLAB_class"] = np.bytes_("struct")
    at["s/x"] = h5py.ExternalLink("secret.h5", "/rows")


def to(*names):
    def write(at):
        at["x"] = h5py.SoftLink(*names) if len(names) == 1 else h5py.ExternalLink(*names)

    return write


OUT = {  # how it leads out, which column is wanted of it, and what is said
    "a data set in another file": (external, "x", "data set 'x' lies in another file ('secret.bin')"),
    "a data set in another file, within groups": (
        deep,
        "a/b/x",
        "data set 'a/b/x' lies in another file ('secret.bin')",
    ),
    "a virtual data set": (virtual, "x", "data set 'x' is virtual, put together from parts of 'secret.h5'"),
    "a virtual data set that grows": (
        growing,
        "x",
        "data set 'x' is virtual, put together from parts of 'pipe'",
    ),
}
LINKS = {
    "a link to another file": (to("secret.h5", "/x"), "x", "'x' is a link to '/x' in 'secret.h5'"),
    "a link to a pipe": (to("pipe", "/x"), "x", "'x' is a link to '/x' in 'pipe'"),
    "a soft link": (to("/time"), "x", "'x' is a link to '/time'"),
    "a soft link on the way to a column": (soft_way, "short/x", "'short' is a link to '/own'"),
}
IN_MAT = {
    "a data set in another file, in a cell": (
        in_cell,
        "x{1}",
        "data set '#refs#/a' lies in another file ('secret.bin')",
    ),
    "a link to another file in a struct": (
        link_in_struct,
        "s.x",
        "'s/x' is a link to '/rows' in 'secret.h5'",
    ),
}
H5, MAT = OUT | LINKS, OUT | LINKS | IN_MAT


def made(folder: Path, name: str, write) -> Path:
    elsewhere(folder)
    file = folder / name
    with h5py.File(file, "w", libver="latest") as f:
        f["time"] = T[None] if name.endswith(".mat") else T
        write(f)
    return file


@pytest.mark.parametrize(
    ("name", "how"), [*(("data.h5", how) for how in H5), *(("data.mat", how) for how in MAT)]
)
def test_a_file_that_leads_out_is_refused_where_it_is_wanted(tmp_path, monkeypatch, name, how):
    write, column, said = MAT[how]
    file = made(tmp_path, name, write)
    monkeypatch.chdir(tmp_path)  # whose files the names in it would be looked up in, too
    with pytest.raises(BadInput) as refused:
        read_sheet(file, "time", [column])
    line = str(refused.value)
    assert line.startswith(f"{file}: {said}")
    assert line.endswith("; write its numbers into this file itself")
    assert "\n" not in line


@pytest.mark.parametrize("name", ["data.h5", "data.mat"])
@pytest.mark.parametrize("how", OUT)
def test_a_command_ends_with_one_line(tmp_path, capsys, name, how):
    file = made(tmp_path, name, OUT[how][0])
    assert run_safely(["inspect", str(file), "--out", str(tmp_path / "out")]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line]
    assert len(lines) == 1
    assert OUT[how][2] in lines[0]
    assert not [f for f in tmp_path.glob("out/*") if f.is_file()]


@pytest.mark.parametrize("how", LINKS)
def test_links_in_hdf5_that_nobody_wants_are_left_alone(tmp_path, how):
    file = made(tmp_path, "data.h5", LINKS[how][0])
    for columns in (None, ["time"]):
        sheet = read_sheet(file, "time", columns)
        assert LINKS[how][1] not in sheet.known
        assert_array_equal(sheet.cells["time"], T)


@pytest.mark.parametrize("name", ["data.h5", "data.mat"])
def test_two_names_and_a_group_within_itself_are_read(tmp_path, name):
    """Hard links do not lead out, and a file may have them in a circle."""
    shape = (1, -1) if name.endswith(".mat") else (-1,)
    with h5py.File(tmp_path / name, "w") as f:
        f["time"] = T.reshape(shape)
        f["x"] = f["time"]
        f["g/y"] = 2 * T.reshape(shape)
        f["g"].attrs["MATLAB_class"] = np.bytes_("function_handle")  # whose inside is not gone through
        f["g/again"] = f["g"]
    assert_array_equal(read_sheet(tmp_path / name, "time").cells["time"], T)


@pytest.mark.parametrize("name", ["data.h5", "data.mat"])
def test_a_file_that_is_no_hdf5_is_left_to_its_reader(tmp_path, name):
    file = tmp_path / name
    file.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(200))
    with pytest.raises(BadInput, match=r"is not a sound (HDF5|MAT) file .*; record or export it again"):
        read_sheet(file)
    file.unlink()
    with pytest.raises(BadInput, match="data file cannot be read"):
        read_sheet(file)
