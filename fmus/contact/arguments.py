"""The border of the public array functions: arguments checked once, laws of scalars mapped over arrays."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Number: TypeAlias = float | Array  # a float where all arguments were floats
Rule: TypeAlias = tuple[Callable[[Array], NDArray[np.bool_]], str]  # what must hold, and its words

POSITIVE: Rule = (lambda x: x > 0, "greater than 0")
NOT_NEGATIVE: Rule = (lambda x: x >= 0, "0 or greater")
ANY: Rule = (lambda x: np.isfinite(x), "")


def between(low: float, high: float) -> Rule:
    """Both limits included."""
    return (lambda x: (x >= low) & (x <= high), f"from {low:g} to {high:g}")


def checked(name: str, unit: str, value: ArrayLike, rule: Rule = ANY) -> Array:
    """The argument as an array of floats, any shape; ValueError that names it where the rule is broken."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number or an array of numbers [{unit}], not {value!r}") from None
    holds, words = rule
    wrong = ~(np.isfinite(array) & holds(array))
    if wrong.any():
        must = f"finite and {words}" if words else "finite"
        raise ValueError(f"{name} must be {must} [{unit}], found {array[wrong].flat[0]:g}")
    return array


def plain(array: Array) -> Number:
    """A float for an array without dimensions, the array otherwise."""
    return float(array) if array.ndim == 0 else array


def broadcast(**arrays: Array) -> dict[str, Array]:
    """The arrays by name in their common shape; ValueError with the shapes where they have none."""
    try:
        common = np.broadcast_arrays(*arrays.values())
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in arrays.items() if x.ndim)
        raise ValueError(f"the arrays do not broadcast together: {shapes}") from None
    return dict(zip(arrays, common, strict=True))


def mapped(function: cs.Function, arguments: Sequence[Array], shape: tuple[int, ...]) -> list[Number]:
    """Results of a CasADi function of scalars for arguments that broadcast to the shape."""
    points = int(np.prod(shape))
    if points == 0:
        return [np.zeros(shape) for _ in range(function.n_out())]
    rows = [np.broadcast_to(x, shape).reshape(1, points) for x in arguments]
    found = function.map(points).call(rows)
    return [plain(x.full().reshape(shape)) for x in found]
