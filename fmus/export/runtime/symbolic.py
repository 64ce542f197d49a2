"""The functions of a text as CasADi functions, built by whatever version of CasADi is there.

A function is one of scalars (SX) where it calls none, or where its version of CasADi can call functions from
there, as 3.8 can; and one of matrices (MX) otherwise, which computes the same in more time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise
from math import inf, nan
from pathlib import Path
from typing import Any

import casadi as cs

SCALARS: Any = cs.SX
MATRICES: Any = cs.MX


KEPT: list[
    Any
] = []  # has a reference of its own that nobody gives back, so that nothing in it is ever destroyed
ctypes.pythonapi.Py_IncRef(ctypes.py_object(KEPT))


class NoCalls(Exception):
    """A function of scalars cannot call another one in this version of CasADi."""


def entries(code: Any) -> dict[str, Entry]:
    """The functions that a text marks as its entries."""
    found: dict[str, Entry] = {}

    def entry(given: list[int], results: list[int]) -> Any:
        def keep(f: Any) -> Any:
            found[f.__name__] = Entry(built(f.__name__, f, given, results), given, results)
            return f

        return keep

    def function(n_in: int, n_out: int) -> Any:
        return lambda f: Helper(built(f.__name__, f, [n_in], [n_out]))

    exec(code, {**WORDS, "entry": entry, "function": function})
    return found


def serialized(folder: Path) -> dict[str, Entry]:
    """The functions that CasADi has serialised in the files of a folder; RuntimeError if it is older now."""
    found = {}
    for file in sorted(folder.glob("*.casadi")):
        try:
            function = cs.Function.deserialize(file.read_text())
        except RuntimeError as error:
            raise RuntimeError(
                f"it needs a newer package casadi than {cs.CasadiMeta.version()} here"
            ) from error
        sizes = (function.nnz_in, function.n_in()), (function.nnz_out, function.n_out())
        found[file.stem] = Entry(function, *([size(i) for i in range(n)] for size, n in sizes))
    return found


class Entry:
    """A function of several arguments and results that is called from outside."""

    def __init__(self, function: cs.Function, given: list[int], found: list[int]) -> None:
        self.function, self.given, self.found = kept(function), given, found

    def on_memory(self, arguments: Sequence[Any], results: Sequence[Any]) -> Callable[[], None]:
        """See Equations.on_memory."""
        return on_memory(self.function, arguments, results)

    def needed(self) -> list[list[int]] | None:
        """For each number of the results, those of the arguments that are in it, both counted through."""
        found: list[list[int]] = []
        for result, size in enumerate(self.found):
            part: list[list[int]] = [[] for _ in range(size)]
            for argument, first in enumerate(accumulate(self.given[:-1], initial=0)):
                there = self.function.jac_sparsity(result, argument).get_triplet()
                for row, column in zip(*there, strict=True):
                    part[row].append(first + column)
            found += part
        return found


def kept(function: cs.Function) -> cs.Function:
    """The function, which is never destroyed.

    A host that is not Python ends the interpreter when it exits, after CasADi's library has already taken
    down what its functions refer to; a function that is destroyed then ends the process with an error.
    """
    KEPT.append(function)
    return function


def on_memory(function: cs.Function, arguments: Sequence[Any], results: Sequence[Any]) -> Callable[[], None]:
    """A call of a CasADi function that reads and writes memory of doubles, which it keeps."""
    buffer: Any  # its type stubs ask for a size that a memoryview has
    call: Any
    buffer, call = function.buffer()
    for i, part in enumerate(arguments):
        buffer.set_arg(i, memoryview(part))
    for i, part in enumerate(results):
        buffer.set_res(i, memoryview(part))
    call.held = (buffer, arguments, results)  # CasADi has their addresses only
    return call  # type: ignore[no-any-return]


class Helper:
    """A function that others call, with a vector of scalars and a list of scalars as its result."""

    def __init__(self, function: cs.Function) -> None:
        self.function = kept(function)
        # scalars call no other kind
        self.graph = function if function.is_a("MXFunction") else kept(function.wrap())

    def __call__(self, x: Sequence[Any]) -> list[Any]:
        kind = MATRICES if any(isinstance(v, MATRICES) for v in x) else SCALARS
        given = [kind(cs.vertcat(*x))] if x else [kind(0, 1)]
        try:
            called = (self.function if kind is MATRICES else self.graph).call(given, False, True)
        except RuntimeError as error:
            if kind is MATRICES:
                raise
            raise NoCalls from error
        return scalars(called[0])


def built(name: str, f: Any, given: list[int], found: list[int]) -> cs.Function:
    """A CasADi function of what a function of the text does with symbols."""
    for kind in (SCALARS, MATRICES):
        symbols = [kind.sym(f"x{i}", n) for i, n in enumerate(given)]
        try:
            made = f([v for part in symbols for v in scalars(part)])
        except NoCalls:
            continue
        if isinstance(made, cs.Function):  # a choice is one by itself
            return made
        results = [kind(cs.vertcat(*made[a:b])) for a, b in pairwise(accumulate(found, initial=0))]
        return cs.Function(name, symbols, results)
    raise NoCalls(name)


def scalars(vector: Any) -> list[Any]:
    """The elements of a column."""
    return list(cs.vertsplit(vector)) if vector.numel() > 1 else [vector] * vector.numel()


def choice(_x: Any, n_in: int, _n_out: int, cases: list[Helper]) -> cs.Function:
    """One of several functions by the number that comes first; the last one where there is none for it."""
    *some, default = (case.function for case in cases)
    switch = cs.Function.conditional("choice", some, default)
    x = cs.MX.sym("x", n_in)
    return cs.Function("choose", [x], switch.call([x[0], x[1:]], False, True))


TABLES: dict[
    tuple[int, int], tuple[list[float], cs.Function]
] = {}  # with the table, which keeps its identity


def rows(table: list[float], place: Any, n: int) -> list[Any]:
    """n elements of a table from a place on; NaN where they are not all in it."""
    key = id(table), n
    if key not in TABLES:
        at = cs.MX.sym("at")
        found = cs.Function("rows", [at], [cs.MX(cs.DM(table))[at + cs.DM(range(n))]])
        TABLES[key] = table, found
    return Helper(TABLES[key][1])([place])


WORDS: dict[str, Any] = {
    "nan": nan,
    "inf": inf,
    "choice": choice,
    "rows": rows,
    "divided": lambda a, b: a / b,
    "less": lambda a, b: a < b,
    "at_most": lambda a, b: a <= b,
    "equal": lambda a, b: a == b,
    "differ": lambda a, b: a != b,
    "both": cs.logic_and,
    "either": cs.logic_or,
    "where": lambda a, b: cs.if_else(a, b, 0.0),
    "power": lambda a, b: a**b,
    **{
        name: getattr(cs, name)
        for name in (
            "sqrt", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "asin", "acos", "atan", "atan2",
            "sinh", "cosh", "tanh", "hypot", "floor", "ceil", "fmod", "sign", "copysign", "fabs", "fmin",
            "fmax",
        )
    },
}  # fmt: skip
