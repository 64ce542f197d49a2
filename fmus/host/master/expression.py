"""Expressions in the time `t` as text, as '300 * sin(2 * pi * t) if t < 5 else 0'; no other code runs."""

import ast
import operator
from collections.abc import Callable, Mapping
from functools import reduce
from types import MappingProxyType
from typing import Any

import numpy as np

from fmus.errors import BadInput, did_you_mean
from fmus.host.loop import Array

Evaluation = Callable[[Array], Any]

LONGEST = 1000  # characters
CONSTANTS = MappingProxyType({"pi": np.pi, "e": np.e})
FUNCTIONS: Mapping[str, tuple[Callable[..., Any], int]] = MappingProxyType(
    {
        **{
            n: (getattr(np, n), 1)
            for n in ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "sign", "floor")
        },
        "abs": (np.abs, 1),
        "min": (np.minimum, 2),
        "max": (np.maximum, 2),
        "where": (np.where, 3),
        "step": (lambda t: np.where(t < 0, 0.0, 1.0), 1),
    }
)
OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = MappingProxyType(
    {
        ast.Add: operator.add,
        ast.Sub: operator.sub,
        ast.Mult: operator.mul,
        ast.Div: operator.truediv,
        ast.Mod: operator.mod,
        ast.Pow: np.power,
        ast.USub: operator.neg,
        ast.UAdd: operator.pos,
        ast.Not: lambda a: 1.0 * np.logical_not(a),  # truths are 1.0 and 0.0, to calculate with
        ast.And: lambda a, b: 1.0 * np.logical_and(a, b),
        ast.Or: lambda a, b: 1.0 * np.logical_or(a, b),
        ast.Lt: lambda a, b: 1.0 * (a < b),
        ast.LtE: lambda a, b: 1.0 * (a <= b),
        ast.Gt: lambda a, b: 1.0 * (a > b),
        ast.GtE: lambda a, b: 1.0 * (a >= b),
    }
)


def parsed(text: str, where: str) -> Evaluation:
    """A function of times (n,) -> values (n,); `where` begins the message of the BadInput."""
    if len(text) > LONGEST:
        raise BadInput(f"{where}: the expression has {len(text)} characters; give a table instead")
    try:
        tree = ast.parse(text.strip(), mode="eval")
        inner = _compiled(tree.body, where)
    except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"{where}: '{text}' is no expression in t, such as '5 * sin(2 * pi * t)'") from None

    def evaluate(t: Array) -> Any:
        with np.errstate(all="ignore"):  # both branches of a choice are computed; Signal checks what counts
            return inner(t)

    return evaluate


def _compiled(node: ast.expr, where: str) -> Evaluation:
    """A function of t from one node of the syntax tree; BadInput where it is nothing a formula needs."""

    def part(inner: ast.expr) -> Evaluation:
        return _compiled(inner, where)

    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            number = np.float64(value)
            return lambda t: number
        case ast.Name(id=name):
            return _name(name, where)
        case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
            return _applied(OPERATORS[type(op)], [part(operand)])
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return _applied(OPERATORS[type(op)], [part(left), part(right)])
        case ast.BoolOp(op=op, values=values):
            return _joined(OPERATORS[type(op)], [part(v) for v in values])
        case ast.Compare(left=left, ops=ops, comparators=rest) if all(type(op) in OPERATORS for op in ops):
            sides = [part(side) for side in (left, *rest)]
            pairs = zip(ops, sides[:-1], sides[1:], strict=True)
            return _joined(OPERATORS[ast.And], [_applied(OPERATORS[type(op)], [a, b]) for op, a, b in pairs])
        case ast.IfExp(test=test, body=body, orelse=other):
            return _applied(np.where, [part(test), part(body), part(other)])
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _call(name, [part(a) for a in arguments], where)
    raise BadInput(
        f"{where}: '{ast.unparse(node)}' may not stand in an expression; use numbers, t and formulas"
    )


def _name(name: str, where: str) -> Evaluation:
    if name == "t":
        return lambda t: t
    if name not in CONSTANTS:
        known = did_you_mean(name, ["t", *CONSTANTS, *FUNCTIONS])
        raise BadInput(f"{where}: '{name}' is not known in an expression; {known}")
    number = CONSTANTS[name]
    return lambda t: number


def _call(name: str, arguments: list[Evaluation], where: str) -> Evaluation:
    if name not in FUNCTIONS:
        raise BadInput(f"{where}: function '{name}' is not known; {did_you_mean(name, FUNCTIONS)}")
    function, count = FUNCTIONS[name]
    if len(arguments) != count:
        raise BadInput(f"{where}: '{name}' takes {count} arguments, not {len(arguments)}; give these")
    return _applied(function, arguments)


def _applied(function: Callable[..., Any], arguments: list[Evaluation]) -> Evaluation:
    return lambda t: function(*(argument(t) for argument in arguments))


def _joined(function: Callable[[Any, Any], Any], parts: list[Evaluation]) -> Evaluation:
    return lambda t: reduce(function, (part(t) for part in parts))
