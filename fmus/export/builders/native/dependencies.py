"""What each computed variable depends on and how, from the sparsity of CasADi's Jacobian."""

from typing import TypeAlias

import casadi as cs

from fmus.model import Equations, Model
from fmus.variables import (
    Expr,
    Parameter,
    Variable,
)

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
    ("dependent").
    """
    jacobian = stacked(made).jacobian()
    entries = jacobian.sparsity_out(0)
    rows, columns = entries.get_triplet()
    word = {i: _how_it_varies(v) for i, v in enumerate(model.settable())}
    strength = ["constant", "fixed", "tunable", "dependent"]
    kinds = ["constant"] * len(rows)
    second = jacobian.jac_sparsity(0, 0, True)  # of the Jacobian's entries
    for entry, known in zip(*second.get_triplet(), strict=True):
        kinds[entry] = max(kinds[entry], word[known], key=strength.index)
    found: Dependencies = [{} for _ in range(entries.size1())]
    # columns of a sparse matrix come in order, so each unknown's list is sorted
    for unknown, known, kind in zip(rows, columns, kinds, strict=True):
        found[unknown][known] = kind
    return found


def _how_it_varies(v: Variable) -> str:
    return v.parameter_variability if isinstance(v, Parameter) else "dependent"
