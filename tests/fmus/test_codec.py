"""Values come back from an archive to the bit, shared where they were, and nothing in an archive can run."""

import io
import pickle
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as some
from numpy.typing import NDArray

from fmus import codec
from fmus.codec import Unreadable


@dataclass(frozen=True)
class Point:
    """A value with fields of the kinds that checkpoints have."""

    name: str
    x: float
    kind: Literal["a", "b"] = "a"
    at: tuple[float, ...] = ()
    told: Mapping[str, float] = field(default_factory=dict)
    y: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Other:
    """A type that no reader here allows."""

    x: float


TYPES = (Point,)


def written(value: object, key: str = "", types: codec.Types = TYPES) -> bytes:
    stream = io.BytesIO()
    codec.write(stream, value, key, types)
    return stream.getvalue()


def back(value: object) -> Any:
    return codec.read(io.BytesIO(written(value)), types=TYPES)


def altered(name: str, content: bytes, of: object = ()) -> io.BytesIO:
    """An archive of a value, one member of which is replaced."""
    new = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(written(of))) as old, zipfile.ZipFile(new, "w") as archive:
        for member in old.namelist():
            archive.writestr(member, content if member == name else old.read(member))
    new.seek(0)
    return new


def same(a: Any, b: Any) -> bool:
    """Whether two values are of the same types and equal to the bit."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.str_):  # an empty one has no bytes, but tobytes gives four
        return a.dtype == b.dtype and str(a) == str(b)
    if isinstance(a, np.ndarray | np.generic):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, float):
        return struct.pack(">d", a) == struct.pack(">d", b)
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return same(list(a.items()), list(b.items()))
    if isinstance(a, Point):
        return same(vars(a), vars(b))
    return a == b


NUMBERS = (
    some.integer_dtypes() | some.floating_dtypes() | some.complex_number_dtypes() | some.boolean_dtypes()
    | some.datetime64_dtypes(endianness="=")
)  # fmt: skip
DTYPES = NUMBERS | some.unicode_string_dtypes() | some.byte_string_dtypes() | some.array_dtypes(NUMBERS)
ARRAYS = some.arrays(DTYPES, some.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4))
NATIVE = NUMBERS.map(lambda dtype: dtype.newbyteorder("="))
SCALARS = NATIVE.flatmap(some.from_dtype) | st.text().map(np.str_)
WORDS = st.text(st.characters())  # lone surrogates too, which names of files can hold
ATOMS = st.none() | st.booleans() | st.integers() | st.floats() | WORDS | WORDS.map(
    lambda s: Path(s.replace("\0", ""))
) | SCALARS  # fmt: skip
POINTS = st.builds(
    Point, WORDS, st.floats(), st.sampled_from(["a", "b"]), st.lists(st.floats(), max_size=3).map(tuple),
    st.dictionaries(WORDS, st.floats(), max_size=3),
    st.none() | some.arrays(np.float64, some.array_shapes(max_side=3)),
)  # fmt: skip
KEYS = WORDS | st.lists(WORDS, max_size=3).map(tuple)
VALUES = st.recursive(
    ATOMS | ARRAYS | POINTS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=4).map(tuple)
        | st.dictionaries(KEYS, inner, max_size=4)
    ),
    max_leaves=12,
)


@given(VALUES)
def test_a_value_comes_back_to_the_bit(value: object) -> None:
    assert same(back(value), value)


@given(VALUES)
def test_what_is_shared_stays_shared(value: object) -> None:
    """And what is only equal stays apart, as hypotheses are compared by identity."""
    one = [value]
    shared, apart = back((one, {"again": one})), back(([value], [value]))
    assert shared[0] is shared[1]["again"]
    assert apart[0] is not apart[1]


def test_numbers_at_the_ends_of_their_ranges_are_exact() -> None:
    payload = struct.unpack(">d", bytes.fromhex("7ff800000000beef"))[0]
    values = [-0.0, 5e-324, 1.7976931348623157e308, float("inf"), payload, 2**53 - 1, -(2**53), 10**5000]
    assert same(back(values), values)


def test_columns_stay_together_as_in_memory() -> None:
    """So that sums over an array that was read run in the same order."""
    array = back(np.asfortranarray(np.arange(6.0).reshape(2, 3)))
    assert array.flags.f_contiguous
    assert array[:, 1].tolist() == [1.0, 4.0]


def test_fields_of_an_array_may_have_names_of_any_alphabet() -> None:
    array = np.ones(2, dtype=[("Ā", "<f8"), ("f", "?")])
    assert same(back(array), array)


def test_a_cached_property_is_not_kept() -> None:
    point = Point("a", 1.0)
    vars(point)["worked_out"] = 2.0
    assert not hasattr(back(point), "worked_out")


class Harmful:
    """What a pickle can do to who reads it."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.mark,)


def test_a_pickle_does_not_run(tmp_path: Path) -> None:
    """Neither by itself, nor as an array of objects within an archive."""
    mark = tmp_path / "ran"
    array = io.BytesIO()
    np.save(array, np.array([Harmful(mark)], dtype=object), allow_pickle=True)
    planted = [io.BytesIO(pickle.dumps(Harmful(mark))), altered("0.npy", array.getvalue(), np.zeros(1))]
    for stream in planted:
        with pytest.raises(Unreadable):
            codec.read(stream)
    assert not mark.exists()
    np.load(io.BytesIO(array.getvalue()), allow_pickle=True)
    assert mark.exists()  # it would have run


@pytest.mark.parametrize(
    "value",
    [Other(1.0), object(), {1, 2}, len, np.array([None]), np.ma.array([1.0]), b"bytes", Harmful(Path())],
)
def test_what_is_not_known_is_not_written(value: object) -> None:
    with pytest.raises(TypeError, match="cannot be written"):
        written([value])


def test_what_holds_itself_is_not_written() -> None:
    endless: list[object] = []
    endless.append(endless)
    with pytest.raises(TypeError, match="holds itself"):
        written(endless)


def test_only_the_types_of_the_reader_are_made() -> None:
    with pytest.raises(Unreadable, match="Other"):
        codec.read(io.BytesIO(written(Other(1.0), types=(Other,))), types=TYPES)


@pytest.mark.parametrize(
    "wrong",
    [
        Point("a", "__import__('os')"),  # type: ignore[arg-type]
        Point(1.0, 1.0),  # type: ignore[arg-type]
        Point("a", 1.0, "c"),  # type: ignore[arg-type]
        Point("a", 1.0, "a", ("b",)),  # type: ignore[arg-type]
        Point("a", 1.0, "a", (), {"b": "c"}),  # type: ignore[dict-item]
        Point("a", 1.0, y=np.array(["b"])),
    ],
)
def test_fields_are_of_the_types_that_they_declare(wrong: Point) -> None:
    """Text in place of a number could end in the source of an FMU."""
    with pytest.raises(Unreadable, match="holds a"):
        back(wrong)


def test_the_key_is_compared_before_anything_else_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    archive = written([1.0], "one")
    assert codec.read(io.BytesIO(archive), "one") == [1.0]
    monkeypatch.setattr(codec, "_Reading", lambda *_: pytest.fail("was read"))
    with pytest.raises(Unreadable, match="belongs to something else"):
        codec.read(io.BytesIO(archive), "another")
    monkeypatch.setattr(codec, "FORMAT", codec.FORMAT + 1)
    with pytest.raises(Unreadable, match="another format"):
        codec.read(io.BytesIO(archive), "one")


@pytest.mark.parametrize(
    "tree",
    [
        '{"nodes":[],"root":[0]}',
        '{"nodes":[{"list":[[0]]}],"root":[0]}',
        '{"nodes":[{"list":[[-1]]}],"root":[0]}',
        '{"nodes":[{"array":7}],"root":[0]}',
        '{"nodes":[{"scalar":["O","00"]}],"root":[0]}',
        '{"nodes":[{"object":["os.system",{"command":"true"}]}],"root":[0]}',
        '{"nodes":[{"object":["tests.test_codec.Point",{"name":"a"}]}],"root":[0]}',
        '{"nodes":[{"eval":"1"}],"root":[0]}',
        '{"nodes":[{"dict":[[[0],1]]}],"root":[0]}',
        '{"nodes":[7],"root":[0]}',
        '{"nodes":[],"root":{"int":"0xg"}}',
        "[" * 100_000,
        "[]",
        "",
    ],
)
def test_a_tree_that_is_none_is_refused(tree: str) -> None:
    with pytest.raises(Unreadable):
        codec.read(altered(codec.TREE, tree.encode()), types=TYPES)


@given(st.data())
def test_a_damaged_archive_is_refused_or_read_as_it_was(data: st.DataObject) -> None:
    """Whatever byte is another, or wherever the archive ends."""
    value = ["text", np.arange(3.0), Point("a", 1.5, told={"b": 2.0})]
    archive = bytearray(written(value))
    i = data.draw(st.integers(0, len(archive) - 1))
    archive[i] ^= data.draw(st.integers(1, 255))
    end = data.draw(st.just(len(archive)) | st.integers(0, len(archive)))
    try:
        found = codec.read(io.BytesIO(bytes(archive[:end])), types=TYPES)
    except Unreadable:
        return
    assert same(found, value)
