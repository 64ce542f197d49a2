"""Many rows of values through one step or a record in one call, of FMUs that offer it: railfmi's native ones.

The call is no part of FMI. It gives what instances would give that are reset, set, initialised and stepped
one after the other, and takes a third of the time or less, since it advances four or eight rows at once.
"""

from collections.abc import Mapping
from ctypes import Structure, byref, c_int, c_longlong, c_size_t, c_void_p
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.host.description import FmuDescription
from fmus.host.instance import Instance
from fmus.host.loop import Array

NAME = "railfmi_rows_2"  # the second version of the structure; FMUs with the first one are not asked
AT_ONCE = "railfmi_rows_at_once"
JOINS = "railfmi_joins"
FOUR = 4  # rows at once of an FMU that does not say how many
ALIKE = 1e-12  # of a value, by which a row may differ from an instance alone: vectors round otherwise
References = NDArray[np.uint32]


class _Asked(Structure):
    """The C structure of the call, see lanes.c."""

    _fields_ = (
        ("n_base", c_size_t), ("base", c_void_p), ("n_rows", c_size_t), ("n_put", c_size_t),
        ("put", c_void_p), ("rows", c_void_p), ("n_samples", c_size_t), ("t", c_void_p),
        ("n_inputs", c_size_t), ("inputs", c_void_p), ("during", c_void_p), ("after", c_void_p),
        ("n_get", c_size_t), ("get", c_void_p), ("first", c_int), ("found", c_void_p), ("processor", c_int),
        ("joined", c_int), ("every", c_size_t),
    )  # fmt: skip


@dataclass(frozen=True)
class Inputs:
    """Inputs that all rows share: references (n_u,), values (N-1, n_u) over each step, and after it.

    joined: whether a step goes over several samples; the values are those of all samples then, (N, n_u).
    """

    references: References
    during: Array
    after: Array | None
    joined: bool = False


class Rows:
    """The call for chosen variables: base (n,) of all that can be set, by reference; put, get: references."""

    def __init__(self, library: Any, base: Array, put: References, get: References) -> None:
        self._call = getattr(library, NAME)
        self._call.restype = c_longlong
        self._kept = (base, put, get)  # their memory is read by its address
        self._asked = _Asked(
            n_base=len(base), base=_at(base), n_put=len(put), put=_at(put), n_get=len(get), get=_at(get)
        )
        self._address = byref(self._asked)
        self._t = np.empty(0)
        self._inputs: Inputs | None = None

    def run(self, rows: Array, t: Array, found: Array, inputs: Inputs | None = None, every: int = 1) -> int:
        """Fill `found` (k, N - 1 or N, n_get) from rows (k, n_put) at times t (N,), s; all C-contiguous.

        With N results for each row the first is that before the first step. every: a divisor of N - 1; only
        every so-manyth sample after the first one is read, with fewer results. Returns -1, or a row of a
        group of which one cannot be set or advanced; instances have to be asked why, and for the other rows.
        """
        asked = self._asked
        asked.n_rows, asked.rows, asked.found = len(rows), _at(rows), _at(found)
        if t is not self._t:
            self._t = t
            asked.n_samples, asked.t = len(t), _at(t)
        asked.first, asked.every = int(found.shape[1] > (len(t) - 1) // every), every
        if inputs is not self._inputs:
            self._inputs = inputs
            self._set_inputs(inputs)
        failed: int = self._call(self._address)
        return failed

    def _set_inputs(self, inputs: Inputs | None) -> None:
        asked = self._asked
        asked.n_inputs, asked.inputs, asked.during, asked.after, asked.joined = 0, None, None, None, 0
        if inputs is not None:
            asked.n_inputs, asked.inputs = len(inputs.references), _at(inputs.references)
            asked.during = _at(inputs.during)
            asked.after = None if inputs.after is None else _at(inputs.after)
            asked.joined = int(inputs.joined)


def offers_rows(instance: Instance) -> bool:
    """Whether the FMU's library has the call."""
    return isinstance(instance, Instance) and hasattr(instance.library, NAME)


def rows_at_once(instance: Instance) -> int:
    """Number of rows that take the time of little more than one; 1 if the FMU's library lacks the call."""
    if not offers_rows(instance):
        return 1
    asked = getattr(instance.library, AT_ONCE, None)
    return int(asked()) if asked else FOUR


def joins(instance: Instance) -> bool:
    """Whether the steps of rows may go over several samples."""
    return offers_rows(instance) and hasattr(instance.library, JOINS)


def base_of(description: FmuDescription, start: Mapping[str, float]) -> Array:
    """Values of all variables that can be set, by reference: from `start`, by default their start values.

    Not a number for those that the description does not list, which have the library's start values.
    """
    settable = {n: v for n, v in description.variables.items() if v.start is not None}
    first = 1 if description.fmi_version.startswith("3") else 0
    base = np.full(max((v.reference for v in settable.values()), default=first - 1) + 1 - first, np.nan)
    for n, v in settable.items():
        given = start.get(n, v.start or 0.0)
        base[v.reference - first] = np.inf if np.isnan(given) else given  # the library refuses it
    return base


def _at(array: NDArray[Any]) -> int:
    address: int = array.__array_interface__["data"][0]  # half the time of array.ctypes.data
    return address
