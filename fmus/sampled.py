"""CasADi functions of scalars, evaluated by NumPy for all samples at once.

CasADi evaluates a mapped function sample by sample in an interpreter. Here each operation of the function is
one NumPy call over all samples, which takes a tenth of the time. Arguments that do not change from sample to
sample are given as numbers, and what depends on these alone is computed once.
"""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Row = float | Array  # one argument or result: a number, or its samples (N,)

OPERATIONS: dict[int, Callable[..., Any]] = {
    cs.OP_ASSIGN: lambda a: a,
    cs.OP_ADD: np.add,
    cs.OP_SUB: np.subtract,
    cs.OP_MUL: np.multiply,
    cs.OP_DIV: np.divide,
    cs.OP_NEG: np.negative,
    cs.OP_EXP: np.exp,
    cs.OP_EXPM1: np.expm1,
    cs.OP_LOG: np.log,
    cs.OP_LOG1P: np.log1p,
    cs.OP_POW: np.power,
    cs.OP_CONSTPOW: np.power,
    cs.OP_SQRT: np.sqrt,
    cs.OP_SQ: np.square,
    cs.OP_TWICE: lambda a: 2.0 * a,
    cs.OP_INV: np.reciprocal,
    cs.OP_SIN: np.sin,
    cs.OP_COS: np.cos,
    cs.OP_TAN: np.tan,
    cs.OP_ASIN: np.arcsin,
    cs.OP_ACOS: np.arccos,
    cs.OP_ATAN: np.arctan,
    cs.OP_ATAN2: np.arctan2,
    cs.OP_SINH: np.sinh,
    cs.OP_COSH: np.cosh,
    cs.OP_TANH: np.tanh,
    cs.OP_HYPOT: np.hypot,
    cs.OP_LT: lambda a, b: np.less(a, b) * 1.0,
    cs.OP_LE: lambda a, b: np.less_equal(a, b) * 1.0,
    cs.OP_EQ: lambda a, b: np.equal(a, b) * 1.0,
    cs.OP_NE: lambda a, b: np.not_equal(a, b) * 1.0,
    cs.OP_NOT: lambda a: np.equal(a, 0.0) * 1.0,
    cs.OP_AND: lambda a, b: np.logical_and(a, b) * 1.0,
    cs.OP_OR: lambda a, b: np.logical_or(a, b) * 1.0,
    cs.OP_IF_ELSE_ZERO: lambda a, b: np.where(a, b, 0.0),
    cs.OP_FLOOR: np.floor,
    cs.OP_CEIL: np.ceil,
    cs.OP_FMOD: np.fmod,
    cs.OP_FABS: np.abs,
    cs.OP_SIGN: np.sign,
    cs.OP_COPYSIGN: np.copysign,
    cs.OP_FMIN: np.fmin,
    cs.OP_FMAX: np.fmax,
}


class Sampled:
    """An SX function of scalar arguments with one column as its result, evaluated for many samples at once.

    NotImplementedError if the function has an operation that is not in `OPERATIONS`.
    """

    def __init__(self, function: cs.Function) -> None:
        self._length, self._places = function.size1_out(0), function.sz_w()
        self._rows = function.sparsity_out(0).row()
        self._program: list[tuple[int, list[int], list[int], float]] = []
        for k in range(function.n_instructions()):
            code = function.instruction_id(k)
            if code not in OPERATIONS and code not in (cs.OP_CONST, cs.OP_INPUT, cs.OP_OUTPUT):
                raise NotImplementedError(
                    f"operation {code} of {function.name()} is not evaluated by samples"
                )
            value = function.instruction_constant(k) if code == cs.OP_CONST else 0.0
            places = function.instruction_output(k), function.instruction_input(k)
            self._program.append((code, *places, value))

    def __call__(self, rows: Sequence[Row], samples: int) -> Array:
        """The result (n_out, samples) for its arguments: numbers, or their samples (samples,)."""
        work: list[Row] = [0.0] * self._places
        found = np.zeros((self._length, samples))
        with np.errstate(all="ignore"):  # as in compiled code, where a value may not be needed in the end
            for code, to, of, value in self._program:
                if code == cs.OP_CONST:
                    work[to[0]] = value
                elif code == cs.OP_INPUT:
                    work[to[0]] = rows[of[0]]
                elif code == cs.OP_OUTPUT:
                    found[self._rows[to[1]]] = work[of[0]]
                else:
                    work[to[0]] = OPERATIONS[code](*(work[i] for i in of))
        return found
