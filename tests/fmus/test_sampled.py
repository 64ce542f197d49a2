"""Functions evaluated by samples have the values that CasADi gives sample by sample."""

import casadi as cs
import numpy as np
import pytest

from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw
from fmus.sampled import OPERATIONS, Sampled

N = 200


def mapped(function: cs.Function, rows: list) -> np.ndarray:
    """CasADi's own values, (n_out, N)."""
    given = [np.broadcast_to(row, N)[None, :] for row in rows]
    return np.array(function.map(N)(*given).full())


UNARY = {
    "exp": cs.exp, "expm1": cs.expm1, "log1p": lambda a: cs.log1p(a * a), "log": lambda a: cs.log(1 + a * a),
    "sqrt": lambda a: cs.sqrt(a * a + 1), "square": lambda a: a**2, "twice": lambda a: a + a,
    "inverse": lambda a: 1 / (2 + cs.cos(a)), "sin": cs.sin, "tan": cs.tan,
    "asin": lambda a: cs.asin(cs.sin(a)),
    "acos": lambda a: cs.acos(cs.cos(a)), "atan": cs.atan, "sinh": cs.sinh, "cosh": cs.cosh, "tanh": cs.tanh,
    "floor": cs.floor, "ceil": cs.ceil, "abs": cs.fabs, "sign": cs.sign, "negative": lambda a: -a,
    "not": lambda a: cs.logic_not(a > 0), "power": lambda a: cs.fabs(a) ** 1.7,
}  # fmt: skip
BINARY = {
    "add": lambda a, b: a + b, "subtract": lambda a, b: a - b, "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / (3 + b * b), "power": lambda a, b: cs.fabs(a) ** b, "atan2": cs.atan2,
    "hypot": cs.hypot, "less": lambda a, b: a < b, "at most": lambda a, b: a <= b,
    "equal": lambda a, b: a == b, "unequal": lambda a, b: a != b,
    "and": lambda a, b: cs.logic_and(a > 0, b), "or": lambda a, b: cs.logic_or(a, b > 0),
    "choice": lambda a, b: cs.if_else(a > 0, b, a), "remainder": lambda a, b: cs.fmod(a, 1 + b * b),
    "least": cs.fmin, "most": cs.fmax, "sign of": cs.copysign,
}  # fmt: skip


@pytest.mark.parametrize("name", UNARY)
def test_an_operation_on_one_argument(name):
    a = cs.SX.sym("a")
    f = cs.Function("f", [a], [UNARY[name](a)])
    x = np.random.default_rng(1).normal(size=N) * 2
    assert Sampled(f)([x], N) == pytest.approx(mapped(f, [x]), rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("name", BINARY)
@pytest.mark.parametrize("fixed", [None, -0.7])
def test_an_operation_on_two_arguments(name, fixed):
    a, b = cs.SX.sym("a"), cs.SX.sym("b")
    f = cs.Function("f", [a, b], [cs.vertcat(BINARY[name](a, b), 0, a)])
    x, y = np.random.default_rng(2).normal(size=(2, N))
    rows = [x, y if fixed is None else fixed]
    assert Sampled(f)(rows, N) == pytest.approx(mapped(f, rows), rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("kind", sorted(k for k, e in EFFECTS.items() if issubclass(e, ForceLaw)))
def test_a_law_has_the_force_that_casadi_computes(kind):
    law, rng = EFFECTS[kind], np.random.default_rng(3)
    q, v = rng.normal(size=(2, N))
    names = [p.name for p in law.parameters("translation")] + [s.name for s in law.states("translation")]
    symbols = {name: cs.SX.sym(name) for name in names}
    clock, at, speed = (cs.SX.sym(n) for n in ("clock", "q", "v"))
    f = cs.Function(
        "f", [at, speed, clock, *symbols.values()], [law({**symbols, "clock": clock}).force(at, speed)]
    )
    rows = [q, v, np.linspace(0, 9, N), *rng.uniform(0.5, 2.0, len(names)).tolist()]
    assert Sampled(f)(rows, N) == pytest.approx(mapped(f, rows), rel=1e-12, abs=1e-13)


def test_what_no_sample_can_have_is_refused():
    a = cs.SX.sym("a")
    with pytest.raises(NotImplementedError, match="operation 33 of f"):
        Sampled(cs.Function("f", [a], [cs.erf(a)]))
    assert cs.OP_ERF not in OPERATIONS
