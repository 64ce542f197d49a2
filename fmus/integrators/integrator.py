"""An integrator: how a model's states are carried over one internal step."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import casadi as cs

from fmus.variables import Expr


class Integrator(ABC):
    """A method that integrates x' = f(x, u, p) with the inputs u held over the step.

    name: by which a model chooses it as its `method`; order: of convergence, in the limit of short steps;
    joins: whether a step over several samples (see lanes_joined.c) can take the place of its steps.
    """

    name: ClassVar[str]
    order: ClassVar[int]
    joins: ClassVar[bool] = False

    @abstractmethod
    def advance(
        self, f: Callable[[Expr], Expr], x: Expr, dt: Expr, tolerated: Sequence[float]
    ) -> tuple[Expr, Expr]:
        """States after a step dt of x' = f(x) from the symbols x (n,), and the error of the step.

        The error is over what is `tolerated` of each state (n,): above 1 the step is made again with a
        shorter one (`fmus.export.runtime.stepping`). It is 0.0 where the method does not estimate it.
        """

    def step(
        self, f: cs.Function, tolerated: Sequence[float], calls: bool = False, moving: int | None = None
    ) -> cs.Function:
        """The CasADi function step(x, u, p, dt) -> (x after dt, error) for f(x, u, p) -> x'.

        calls: whether the step calls f at each stage; otherwise it contains its equations instead. moving:
        number of states, the first ones, that may change; the function `step_alone` gives these only. By
        default all do.
        """
        kind: Expr = cs.SX if f.is_a("SXFunction") else cs.MX
        x, u, p = (kind.sym(f.name_in(i), f.size1_in(i)) for i in range(3))
        dt = kind.sym("dt")
        graph = f.wrap() if calls else f

        def rates(states: Expr) -> Expr:
            every = states if moving is None else cs.vertcat(states, x[moving:])
            return graph.call([every, u, p], False, calls)[0][:moving]

        x1, error = self.advance(rates, x[:moving], dt, tolerated[:moving])
        if kind is cs.SX:
            both: Expr = cs.cse(cs.vertcat(x1, error))
            x1, error = both[:-1], both[-1]
        name = "step" if moving is None else "step_alone"
        return cs.Function(name, [x, u, p, dt], [x1, error], ["x", "u", "p", "dt"], ["x1", "error"])
