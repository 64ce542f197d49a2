"""Variables that are no scalar Real or Float64: whole numbers, truths, short reals, elements of arrays.

Here each is a number by a name of its own, `y[1]` or `A[2,1]` for an element, counted from 1. A number beyond
all value references of FMI stands for it where references are passed on.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from ctypes import (  # fmt: skip
    c_bool,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_uint,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
)
from dataclasses import dataclass
from itertools import product
from math import isfinite
from typing import Any

from fmus.host.status import ERROR, OK, WARNING
from fmus.host.watch import PAGE

BEYOND = 1 << 32  # no value reference is as large
MOST_ELEMENTS = 10_000  # of an array; a larger one is not offered by its elements
REAL = ("Real", "Float64", "Float32")  # types whose values need not be whole
C_TYPES = {
    "Real": c_double, "Integer": c_int, "Float64": c_double, "Float32": c_float, "Int8": c_int8,
    "UInt8": c_uint8, "Int16": c_int16, "UInt16": c_uint16, "Int32": c_int32, "UInt32": c_uint32,
    "Int64": c_int64, "UInt64": c_uint64,
}  # fmt: skip
LIMITS = {"Integer": (-(2**31), 2**31 - 1), "Boolean": (0, 1)} | {
    f"{sign}Int{bits}": (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for sign in ("", "U")
    for bits in (8, 16, 32, 64)
}


@dataclass(frozen=True)
class Place:
    """Where such a variable lies: element of the values of an array of that size, or the only one of one.

    type: as in the names of FMI's functions; start: values of the whole array before the start.
    """

    type: str
    reference: int
    element: int = 0
    start: tuple[float, ...] = (0.0,)


def called(fmi_type: str, fmi3: bool) -> str:
    """A type as in the names of the functions that set and read it: an enumeration has none of its own."""
    return fmi_type if fmi_type != "Enumeration" else "Int64" if fmi3 else "Integer"


def elements(shape: Sequence[int]) -> Iterator[str]:
    """What follows the name of an array in those of its elements, in the order of its values."""
    for index in product(*(range(1, n + 1) for n in shape)):
        yield f"[{','.join(map(str, index))}]"


class Transfer:
    """Sets and reads the variables of one instance that have places.

    function(name): a raw function of its library that takes references, their number, values and, by FMI 3.0,
    the number of values. complain: where a reason is left for a call that fails.
    """

    def __init__(
        self, places: Sequence[Place], fmi3: bool, who: int, function: Callable[[str], Callable[..., int]],
        complain: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._places, self._fmi3, self._who, self._function = places, fmi3, who, function
        self._complain, self.call = complain, ""  # the last one
        self._arrays: dict[tuple[str, int], list[float]] = {}
        self.begin()

    def begin(self) -> None:
        """The instance is new or was reset: arrays have their start values."""
        self._arrays = {(p.type, p.reference): list(p.start) for p in self._places if len(p.start) > 1}

    def forget(self) -> None:
        """A state was restored: what is in the arrays has to be read."""
        self._arrays.clear()

    def setter(self, references: Sequence[int], values: Any) -> Callable[[], int]:
        """A call that sets variables from a sequence of numbers and returns its status."""
        groups = list(self._grouped(references))

        def push() -> int:
            status = OK
            for kind, refs, wanted in groups:
                status = max(status, self._put(kind, refs, wanted, values))
                if status > WARNING:
                    break
            return status

        return push

    def getter(self, references: Sequence[int], values: Any) -> Callable[[], int]:
        """A call that reads variables into a sequence of numbers and returns its status."""
        groups = list(self._grouped(references))

        def pull() -> int:
            status = OK
            for kind, refs, wanted in groups:
                found, said = self._read(kind, refs, sum(size for size, _ in wanted))
                status = max(status, said)
                if status > WARNING:
                    break
                begin = 0
                for size, parts in wanted:
                    for element, i in parts:
                        values[i] = float(found[begin + element])
                    begin += size
            return status

        return pull

    def _grouped(
        self, references: Sequence[int]
    ) -> Iterator[tuple[str, list[int], list[tuple[int, list[tuple[int, int]]]]]]:
        """A type, value references of it, and for each its size and elements with their places in values."""
        found: dict[str, dict[int, tuple[int, list[tuple[int, int]]]]] = {}
        for i, handle in enumerate(references):
            if handle >= BEYOND:
                p = self._places[handle - BEYOND]
                one = found.setdefault(p.type, {}).setdefault(p.reference, (len(p.start), []))
                one[1].append((p.element, i))
        for kind, by_reference in found.items():
            yield kind, list(by_reference), list(by_reference.values())

    def _put(self, kind: str, refs: list[int], wanted: Iterable[tuple[int, Any]], values: Any) -> int:
        whole: list[float] = []
        for reference, (size, parts) in zip(refs, wanted, strict=True):
            own = self._known(kind, reference, size)
            if own is None:
                return ERROR
            for element, i in parts:
                own[element] = values[i]
            whole += own
        self.call = self._named("Set", kind)
        try:
            held = _held(kind, self._fmi3, whole)
        except ValueError as error:
            self._complain(str(error))
            return ERROR
        return self._transferred("Set", kind, refs, held)

    def _known(self, kind: str, reference: int, size: int) -> list[float] | None:
        """The values of an array that are set, to be changed in place; None if they cannot be read."""
        if size == 1:
            return [0.0]
        if (kind, reference) not in self._arrays:
            found, status = self._read(kind, [reference], size)
            if status > WARNING:
                return None
            self._arrays[kind, reference] = [float(x) for x in found]
        return self._arrays[kind, reference]

    def _read(self, kind: str, refs: list[int], size: int) -> tuple[Any, int]:
        found = (_c_type(kind, self._fmi3) * size)()
        return found, self._transferred("Get", kind, refs, found)

    def _named(self, way: str, kind: str) -> str:
        return f"fmi{3 if self._fmi3 else 2}{way}{kind}"

    def _transferred(self, way: str, kind: str, refs: list[int], held: Any) -> int:
        n, self.call = len(refs), self._named(way, kind)
        PAGE.calling(self._who, self.call)
        more = (len(held),) if self._fmi3 else ()
        return self._function(self.call)((c_uint * n)(*refs), n, held, *more)


def _c_type(kind: str, fmi3: bool) -> Any:
    return (c_bool if fmi3 else c_int) if kind == "Boolean" else C_TYPES[kind]


def _held(kind: str, fmi3: bool, values: Sequence[float]) -> Any:
    """A C array of a type; ValueError for a number that it cannot hold."""
    if kind in REAL:
        return (_c_type(kind, fmi3) * len(values))(*values)
    low, high = LIMITS[kind]
    whole = [round(x) if isfinite(x) else high + 1 for x in values]
    for x, nearest in zip(values, whole, strict=True):
        if not low <= nearest <= high:
            raise ValueError(f"{x:g} does not fit into a variable of type {kind}")
    return (_c_type(kind, fmi3) * len(values))(*whole)
