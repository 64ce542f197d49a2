"""Functions of one contact for the two of a wheelset: a processor works out both at once."""

from collections.abc import Collection

import casadi as cs

from fmus.variables import Expr


def for_two(function: cs.Function, shared: Collection[str] = ()) -> cs.Function:
    """The function of scalars as one of columns of two, but for the arguments that both have in common."""
    kind: type[Expr] = cs.SX if function.is_a("SXFunction") else cs.MX
    names = function.name_in()
    given = [kind.sym(name, 1 if name in shared else 2) for name in names]
    each = [
        function.call([g if n in shared else g[i] for n, g in zip(names, given, strict=True)]) for i in (0, 1)
    ]
    both = [cs.vertcat(*results) for results in zip(*each, strict=True)]
    if kind is cs.SX:
        both = cs.cse(both)
    return cs.Function(function.name(), given, both, names, function.name_out())
