"""What each computed variable depends on and how, from the sparsity of CasADi's Jacobian."""

from collections.abc import Iterator
from typing import TypeAlias

import casadi as cs

from fmus.model import Equations, Model
from fmus.variables import (
    Expr,
    Parameter,
    Variable,
)

# operations whose results jump where their arguments change
JUMPS = (
    cs.OP_LT, cs.OP_LE, cs.OP_EQ, cs.OP_NE, cs.OP_NOT, cs.OP_AND, cs.OP_OR, cs.OP_SIGN, cs.OP_FLOOR,
    cs.OP_CEIL, cs.OP_FMOD, cs.OP_REMAINDER, cs.OP_COPYSIGN,
)  # fmt: skip
Dependencies: TypeAlias = list[dict[int, str]]  # by unknown (derivatives, outputs): reference of known, kind


def stacked(made: Equations) -> cs.Function:
    """The function all([x, u, p]) -> [x', y]."""
    kind: type[Expr] = cs.SX if made.f.is_a("SXFunction") and made.h.is_a("SXFunction") else cs.MX
    sizes = [made.f.size1_in(i) for i in range(3)]
    known: Expr = kind.sym("known", sum(sizes))
    x, u, p = (known[sum(sizes[:i]) : sum(sizes[: i + 1])] for i in range(3))
    return cs.Function("all", [known], [cs.vertcat(made.f(x, u, p), made.h(x, u, p))])


def dependencies(made: Equations, model: Model) -> Dependencies:
    """For each state derivative and output: what it depends on, with FMI's word for how.

    The partial derivative is constant, or changes with fixed parameters, tunable parameters, or all else
    ("dependent"). A dependence without a derivative, as on what a comparison decides by, is "dependent" too.
    """
    whole = stacked(made)
    jacobian = whole.jacobian()
    entries = jacobian.sparsity_out(0)
    rows, columns = entries.get_triplet()
    entries_at = list(zip(rows, columns, strict=True))
    word = {i: _how_it_varies(v) for i, v in enumerate(model.settable())}
    strength = ["constant", "fixed", "tunable", "dependent"]
    kinds = ["constant"] * len(rows)
    for entry, known in _second(whole, jacobian):
        kinds[entry] = max(kinds[entry], word[known], key=strength.index)
    jumps = _jumps(whole)
    kinds = ["dependent" if pair in jumps else k for pair, k in zip(entries_at, kinds, strict=True)]
    found: Dependencies = [{} for _ in range(entries.size1())]
    # columns of a sparse matrix come in order, so each unknown's list is sorted
    for (unknown, known), kind in zip(entries_at, kinds, strict=True):
        found[unknown][known] = kind
    return found


def _jumps(whole: cs.Function) -> set[tuple[int, int]]:
    """Unknowns with the knowns that reach them through a comparison or a rounding, whose derivative is zero.

    Empty for a function that calls others, which hide that.
    """
    if not whole.is_a("SXFunction"):
        return set()
    every: list[set[int]] = [set() for _ in range(whole.sz_w())]  # what an element of the work depends on
    jumping = list(every)
    found: set[tuple[int, int]] = set()
    row = whole.sparsity_out(0).row()
    for k in range(whole.n_instructions()):
        code, to, of = whole.instruction_id(k), whole.instruction_output(k), whole.instruction_input(k)
        if code == cs.OP_INPUT:
            every[to[0]], jumping[to[0]] = {of[1]}, set()
        elif code == cs.OP_OUTPUT:
            found |= {(row[to[1]], known) for known in jumping[of[0]]}
        elif code == cs.OP_CONST:
            every[to[0]], jumping[to[0]] = set(), set()
        else:
            by = of if code in JUMPS else of[:1] if code == cs.OP_IF_ELSE_ZERO else ()
            jump = set().union(*(jumping[i] for i in of), *(every[i] for i in by))
            every[to[0]], jumping[to[0]] = set().union(*(every[i] for i in of)), jump
    return found


def _second(whole: cs.Function, jacobian: cs.Function) -> Iterator[tuple[int, int]]:
    """On which of the knowns each entry of the Jacobian depends.

    Derivatives of the entries do not see what only comparisons and roundings depend on, the entries do. Where
    they hold calls of functions, which hide that, those derivatives must do.
    """
    if not whole.is_a("SXFunction"):
        yield from zip(*jacobian.jac_sparsity(0, 0, True).get_triplet(), strict=True)
        return
    known = cs.SX.sym("known", whole.size1_in(0))
    place = {known[i].element_hash(): i for i in range(known.numel())}
    values: cs.SX = jacobian(known, whole(known))
    for entry in range(values.nnz()):
        for symbol in cs.symvar(values.nz[entry]):
            yield entry, place[symbol.element_hash()]


def _how_it_varies(v: Variable) -> str:
    return v.parameter_variability if isinstance(v, Parameter) else "dependent"
