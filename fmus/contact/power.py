"""Powers that cost nothing where their exponent is one."""

from functools import cache
from typing import Any

import casadi as cs

from fmus.variables import Expr


@cache
def power(n: int) -> cs.Function:
    """Function (n bases > 0, exponent) -> bases to the exponent: the bases where the exponent is 1.

    Its derivatives are those of the power also there, by the exponent too.
    """
    base, exponent, found = cs.MX.sym("base", n), cs.MX.sym("exponent"), cs.MX.sym("found", n)
    given: list[Expr] = [base, exponent]
    itself = cs.Function("itself", given, [base])
    other = cs.Function("other", given, [base**exponent])
    slopes: list[Expr] = [cs.diag(exponent * base ** (exponent - 1)), cs.log(base) * base**exponent]
    names = ["jac_found_base", "jac_found_exponent"]
    jacobian = cs.Function("jac_power", [*given, found], slopes, ["base", "exponent", "out_found"], names)
    chosen = cs.Function.if_else("chosen", itself, other)(exponent == 1, *given)
    # CasADi would else derive the branch that is taken, which does not know its exponent
    options: dict[str, Any] = {"custom_jacobian": jacobian, "jac_penalty": 0}
    options |= {"enable_forward": False, "enable_reverse": False}
    return cs.Function("power", given, [chosen], ["base", "exponent"], ["found"], options)
