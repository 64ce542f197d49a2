"""Expressions over signals, such as 'max(abs(variant.fmu.output)) < 2e-3'; no other code can be run.

A signal whose name is no name in a formula stands in quotes: 'max(abs("fmu.gear[2].phi")) < 2e-3'.
"""

import ast
import json
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from keyword import iskeyword
from types import MappingProxyType
from typing import Any

import numpy as np

from fmus.errors import BadInput, did_you_mean
from scenarios.simulating.functions import EXTREMES, FUNCTIONS, NUMBERS
from scenarios.simulating.value import (
    Value,
    alike,
    combined,
    power,
    product,
    quotient,
)

Lookup = Callable[[str], Value]
Side = tuple[ast.expr, float]  # of a comparison, and its number
CONSTANTS = MappingProxyType({"pi": np.pi, "e": np.e})
ARITHMETIC: Mapping[type[ast.AST], tuple[Callable[..., Any], Callable[[Value, Value], str | None]]] = (
    MappingProxyType(
        {
            ast.Add: (np.add, lambda a, b: alike([a, b])),
            ast.Sub: (np.subtract, lambda a, b: alike([a, b])),
            ast.Mult: (np.multiply, product),
            ast.Div: (np.divide, quotient),
            ast.Pow: (np.power, power),
        }
    )
)
SIGNS: Mapping[type[ast.AST], Callable[[Any], Any]] = MappingProxyType(
    {ast.USub: operator.neg, ast.UAdd: operator.pos}
)
COMPARISONS: Mapping[type[ast.AST], Callable[[float, float], bool]] = MappingProxyType(
    {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge}
)


@dataclass(frozen=True)
class Verdict:
    """Whether a statement is true, and the numbers on the sides of its comparisons, in order.

    problem: a sentence if one of these numbers is not finite; the statement then counts as not true, and so
    does its negation.
    """

    holds: bool
    values: tuple[float, ...]
    problem: str | None = None


@dataclass(frozen=True)
class Expression:
    """A formula; `names` are the signals in it. Errors begin with `where`."""

    text: str
    where: str
    tree: ast.expr
    names: tuple[str, ...]

    def value(self, lookup: Lookup) -> Value:
        """The value of the formula with the signals that `lookup` returns by name."""
        return _value(self.tree, lookup, self.where)


@dataclass(frozen=True)
class Statement(Expression):
    """A comparison of numbers, or several joined by and, or, not."""

    def verdict(self, lookup: Lookup) -> Verdict:
        """Whether the statement is true; it is not if one of its numbers is not finite."""
        sides: list[Side] = []
        try:
            holds = _holds(self.tree, lookup, self.where, sides)
        except BadInput as error:
            raise BadInput("; ".join([str(error), *_not_finite(self.names, lookup)])) from error
        values = tuple(number for _, number in sides)
        wrong = next((side for side, number in sides if not np.isfinite(number)), None)
        if wrong is None:
            return Verdict(holds, values)
        said = [f"'{ast.unparse(wrong)}' is not finite", *_not_finite(_names(wrong, self.where), lookup)]
        return Verdict(False, values, "; ".join(said))


def expression(text: str, where: str) -> Expression:
    """A formula from text; the message of a BadInput begins with `where`."""
    tree = _parsed(text, where)
    return Expression(text, where, tree, tuple(dict.fromkeys(_names(tree, where))))


def statement(text: str, where: str) -> Statement:
    """A comparison from text; the message of a BadInput begins with `where`."""
    tree = _parsed(text, where)
    sides = list(_sides(tree, where))
    names = [name for side in sides for name in _names(side, where)]
    for side in sides:
        if _is_signal(side):
            raise BadInput(f"{where}: '{ast.unparse(side)}' is a signal; compare its max, rms, last ...")
    return Statement(text, where, tree, tuple(dict.fromkeys(names)))


def in_formula(signal: str) -> str:
    """The name of a signal as a formula holds it: in quotes where it has brackets, spaces or the like."""
    parts = signal.split(".")
    plain = signal.isascii() and all(p.isidentifier() and not iskeyword(p) for p in parts)
    return signal if plain else json.dumps(signal, ensure_ascii=False)


def _parsed(text: str, where: str) -> ast.expr:
    try:
        return ast.parse(re.sub(r"[\r\n]", " ", text).strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise BadInput(
            f"{where}: '{text[:80]}' is not a formula; write one such as 'max(abs(fmu.output)) < 3e3'"
        ) from None


def _sides(node: ast.expr, where: str) -> Iterator[ast.expr]:
    """The formulas that a statement compares."""
    match node:
        case ast.BoolOp(values=parts):
            for part in parts:
                yield from _sides(part, where)
        case ast.UnaryOp(op=ast.Not(), operand=part):
            yield from _sides(part, where)
        case ast.Compare(left=left, ops=ops, comparators=rest) if all(type(op) in COMPARISONS for op in ops):
            yield from (left, *rest)
        case _:
            raise BadInput(f"{where}: '{ast.unparse(node)}' compares nothing; write it with < <= > >=")


def _names(node: ast.expr, where: str) -> Iterator[str]:
    """The signals in a formula; raises BadInput for anything that a formula may not contain."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return
        case ast.Name(id=name) if name in CONSTANTS:
            return
        case ast.Name() | ast.Attribute():
            yield _dotted(node, where)
        case ast.Constant(value=str() as name) if "." in name:
            yield name
        case ast.UnaryOp(op=op, operand=inner) if type(op) in SIGNS:
            yield from _names(inner, where)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
            yield from _names(left, where)
            yield from _names(right, where)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            _check_call(name, len(arguments), where)
            for argument in arguments:
                yield from _names(argument, where)
        case _:
            raise BadInput(
                f"{where}: '{ast.unparse(node)}' may not stand in a formula; use numbers, signals, "
                "functions and + - * / **"
            )


def _dotted(node: ast.expr, where: str) -> str:
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=inner, attr=name):
            return f"{_dotted(inner, where)}.{name}"
    raise BadInput(f"{where}: '{ast.unparse(node)}' is not the name of a signal; write it as 'fmu.output'")


def _check_call(name: str, count: int, where: str) -> None:
    if name not in FUNCTIONS:
        raise BadInput(f"{where}: function '{name}' is not known; {did_you_mean(name, FUNCTIONS)}")
    counts = FUNCTIONS[name][1]
    if count not in counts:
        wanted = " or ".join(map(str, counts))
        raise BadInput(f"{where}: '{name}' takes {wanted} arguments, not {count}; correct their number")


def _is_signal(node: ast.expr) -> bool:
    """Whether a formula gives a signal, not a number."""
    match node:
        case ast.Constant() | ast.Name() | ast.Attribute():
            is_number = isinstance(node, ast.Constant) and not isinstance(node.value, str)
            return not (is_number or getattr(node, "id", "") in CONSTANTS)
        case ast.UnaryOp(operand=inner):
            return _is_signal(inner)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            is_number = name in NUMBERS or (name in EXTREMES and len(arguments) == 1)
            return not is_number and any(map(_is_signal, arguments))
        case ast.BinOp(left=left, right=right):
            return _is_signal(left) or _is_signal(right)
    return False


def _value(node: ast.expr, lookup: Lookup, where: str) -> Value:
    """The value of a formula that `_names` has checked."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return Value(float(number))
        case ast.Name(id=name) if name in CONSTANTS:
            return Value(CONSTANTS[name])
        case ast.Name() | ast.Attribute():
            return lookup(_dotted(node, where))
        case ast.Constant(value=str() as name):
            return lookup(name)
    try:
        match node:
            case ast.UnaryOp(op=op, operand=inner):
                part = _value(inner, lookup, where)
                return combined(SIGNS[type(op)], [part], part.unit)
            case ast.BinOp(left=left, op=op, right=right):
                a, b = _value(left, lookup, where), _value(right, lookup, where)
                function, unit = ARITHMETIC[type(op)]
                return combined(function, [a, b], unit(a, b))
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return FUNCTIONS[name][0](*(_value(a, lookup, where) for a in arguments))
    except ValueError as error:
        said = str(error)
        raise BadInput(
            said if said.startswith(where) else f"{where}: '{ast.unparse(node)}' {said}"
        ) from error
    raise BadInput(f"{where}: '{ast.unparse(node)}' may not stand in a formula")


def _not_finite(names: Iterable[str], lookup: Lookup) -> Iterator[str]:
    """A sentence on each of these signals that is not finite, with the first such place."""
    for name in dict.fromkeys(names):
        signal = lookup(name)
        bad = np.flatnonzero(~np.isfinite(signal.y))
        if bad.size and signal.x is not None:
            axis, unit = ("y", "m") if "contact" in name.split(".") else ("t", "s")
            yield f"signal '{name}' is not finite from {axis} = {signal.x[bad[0]]:g} {unit} on"


def _holds(node: ast.expr, lookup: Lookup, where: str, sides: list[Side]) -> bool:
    """Whether a statement of finite numbers is true; all sides of its comparisons are evaluated."""
    match node:
        case ast.BoolOp(op=op, values=parts):
            found = [_holds(part, lookup, where, sides) for part in parts]
            return all(found) if isinstance(op, ast.And) else any(found)
        case ast.UnaryOp(op=ast.Not(), operand=part):
            return not _holds(part, lookup, where, sides)
        case ast.Compare(left=left, ops=ops, comparators=rest):
            numbers = [_value(side, lookup, where).number() for side in (left, *rest)]
            sides += zip((left, *rest), numbers, strict=True)
            pairs = zip(numbers[:-1], ops, numbers[1:], strict=True)
            return all(COMPARISONS[type(op)](a, b) for a, op, b in pairs)
    raise BadInput(f"{where}: '{ast.unparse(node)}' compares nothing")
