"""Functions given as Python text, evaluated by CasADi where it is there and by Python where it is not.

The text is run once to define its functions. Given CasADi's symbols it builds CasADi functions, of any
version; given numbers it computes them, with the values that IEEE 754 and the C library give.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Sequence
from math import copysign, inf, isinf, isnan, nan
from pathlib import Path
from typing import Any

Values = Sequence[float]


class Equations:
    """The functions of a text. `note` says in one sentence why Python evaluates them, where it does."""

    def __init__(self, text: str) -> None:
        self.note = ""
        code = compile(text, "equations", "exec")
        try:
            from .symbolic import entries

            self._entries: dict[str, Any] = entries(code)
        except Exception as error:
            # whatever a version of CasADi may lack, the numbers are the same without it
            why = "is not installed" if isinstance(error, ImportError) else f"cannot build them ({error})"
            self.note = (
                f"the equations run in plain Python, which is slower, because the package casadi {why}"
            )
            self._entries = _entries(code)

    @classmethod
    def of(cls, folder: Path) -> Equations:
        """Those in the package of an FMU: a text, or functions that CasADi has serialised."""
        text = folder / "equations.txt"
        if text.is_file():
            return cls(text.read_text(encoding="utf-8"))
        from .symbolic import serialized

        made = cls("")
        made._entries, made.note = serialized(folder), ""
        return made

    def sizes(self, name: str) -> tuple[list[int], list[int]]:
        """How many numbers each argument and each result of a function has."""
        entry = self._entries[name]
        return entry.given, entry.found

    def needed(self, name: str) -> list[list[int]] | None:
        """For each number that a function gives, which of those that it takes are in it; see Entry.needed."""
        found: list[list[int]] | None = self._entries[name].needed()
        return found

    def on_memory(self, name: str, arguments: Sequence[Any], results: Sequence[Any]) -> Callable[[], None]:
        """A call of a function that reads and writes memory of doubles, which it keeps."""
        call: Callable[[], None] = self._entries[name].on_memory(arguments, results)
        return call


class Entry:
    """A function of numbers."""

    def __init__(self, quick: Any, careful: Any, given: list[int], found: list[int]) -> None:
        self.quick, self.careful, self.given, self.found = quick, careful, given, found

    def on_memory(self, arguments: Sequence[Any], results: Sequence[Any]) -> Callable[[], None]:
        """See Equations.on_memory."""
        read, write = ([memoryview(part) for part in parts] for parts in (arguments, results))

        def call() -> None:
            x = [value for part in read for value in part.tolist()]
            try:
                y = self.quick(x)
            except (ValueError, ArithmeticError):  # where C's library gives a value, Python's raises an error
                y = self.careful(x)
            first = 0
            for part in write:
                part[:] = array("d", y[first : first + len(part)])
                first += len(part)

        return call

    def needed(self) -> list[list[int]] | None:
        """None: only CasADi knows what is in a result, and it is there where FMUs are built."""
        return None


def _entries(code: Any) -> dict[str, Entry]:
    quick, careful = (_run(code, words) for words in (QUICK, QUICK | CAREFUL))
    return {name: Entry(f, careful[name][0], *sizes) for name, (f, *sizes) in quick.items()}


def _run(code: Any, words: dict[str, Any]) -> dict[str, Any]:
    """The functions that a text marks as its entries, with their sizes."""
    found: dict[str, Any] = {}

    def entry(given: list[int], results: list[int]) -> Any:
        def keep(f: Any) -> Any:
            found[f.__name__] = (f, given, results)
            return f

        return keep

    exec(code, {**words, "entry": entry, "function": lambda *_sizes: lambda f: f})
    return found


def choice(x: Values, _n_in: int, _n_out: int, cases: Sequence[Any]) -> Any:
    """One of several functions by the number that comes first; the last one where there is none for it."""
    last = len(cases) - 1
    return cases[int(x[0]) if -1.0 < x[0] < last else last](x[1:])


def rows(table: list[float], place: float, n: int) -> list[float]:
    """n elements of a table from a place on; NaN where they are not all in it."""
    if not 0 <= place <= len(table) - n:
        return [nan] * n
    first = int(place)
    return table[first : first + n]


def divided(a: float, b: float) -> float:
    """A quotient."""
    if b:
        return a / b
    return nan if a == 0 or isnan(a) or isnan(b) else copysign(inf, a) * copysign(1.0, b)


def power(a: float, b: float) -> float:
    """A power, as C's library gives it."""
    try:
        return math.pow(a, b)
    except OverflowError:
        return -inf if a < 0 and b % 2 == 1 else inf
    except ValueError:
        if a != 0:
            return nan
        return copysign(inf, a) if b % 2 == 1 else inf  # zero to a negative power


def _guarded(f: Any, overflow: Callable[[float], float] = lambda _: inf, pole: float | None = None) -> Any:
    def g(a: float, *more: float) -> float:
        try:
            return float(f(a, *more))
        except OverflowError:
            return overflow(a)
        except ValueError:
            return -inf if a == pole else nan

    return g


QUICK: dict[str, Any] = {
    "nan": nan,
    "inf": inf,
    "choice": choice,
    "rows": rows,
    "divided": divided,
    "less": lambda a, b: a < b,
    "at_most": lambda a, b: a <= b,
    "equal": lambda a, b: a == b,
    "differ": lambda a, b: a != b,
    "both": lambda a, b: bool(a) and bool(b),
    "either": lambda a, b: bool(a) or bool(b),
    "where": lambda a, b: b if a else 0.0,
    "fmin": lambda a, b: a if a < b or isnan(b) else b,
    "fmax": lambda a, b: a if a > b or isnan(b) else b,
    "sign": lambda a: -1.0 if a < 0 else 1.0 if a > 0 else a,
    "power": math.pow,
    "floor": math.floor,
    "ceil": math.ceil,
    **{
        name: getattr(math, name)
        for name in (
            "sqrt", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "asin", "acos", "atan", "atan2",
            "sinh", "cosh", "tanh", "hypot", "fmod", "copysign", "fabs",
        )
    },
}  # fmt: skip
CAREFUL = {name: _guarded(QUICK[name]) for name in (
    "sqrt", "exp", "expm1", "sin", "cos", "tan", "asin", "acos", "cosh", "hypot", "fmod",
)} | {
    "power": power,
    "log": _guarded(math.log, pole=0.0),
    "log1p": _guarded(math.log1p, pole=-1.0),
    "sinh": _guarded(math.sinh, lambda a: copysign(inf, a)),
    "floor": lambda a: a if isinf(a) or isnan(a) else float(math.floor(a)),
    "ceil": lambda a: a if isinf(a) or isnan(a) else float(math.ceil(a)),
}  # fmt: skip
