"""Rosenbrock method of order 4 with six stages, for models with stiff parts whose swings matter."""

from collections.abc import Callable, Sequence

import casadi as cs

from fmus.integrators.integrator import Integrator
from fmus.variables import Expr

GAMMA = 0.25
# stages: shares of the earlier ones in the point, and in the rates times the step
POINTS = (
    (),
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0),
)
RATES = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
)


class Rodas4(Integrator):
    """L-stable and stiffly accurate, with an exact Jacobian; its error is known.

    The error is the difference from the embedded method of order 3, over what is tolerated for each state.
    The linear equations are eliminated in the order of the states, without exchanging any: a small state
    beside large ones keeps its digits, and states that follow and are not felt change nothing. A model
    declares displacements before speeds, so that no pivot is small at steps that resolve its swings.
    Hairer & Wanner, "Solving Ordinary Differential Equations II", 2nd ed., 1996, IV.7 and the code RODAS.
    """

    name = "rodas4"
    order = 4

    def advance(
        self, f: Callable[[Expr], Expr], x: Expr, dt: Expr, tolerated: Sequence[float]
    ) -> tuple[Expr, Expr]:
        """See Integrator.advance."""
        solve = _solver(1 / (GAMMA * dt) * cs.DM.eye(x.numel()) - cs.jacobian(f(x), x))
        k: list[Expr] = []
        for points, rates in zip(POINTS, RATES, strict=True):
            point = x + _sum(points, k)
            k.append(solve(f(point) + _sum(rates, k) / dt))
        return point + k[-1], cs.norm_inf(k[-1] / cs.DM(tolerated))


def _sum(shares: Sequence[float], of: Sequence[Expr]) -> Expr:
    return sum((share * k for share, k in zip(shares, of, strict=True)), 0.0)


def _solver(w: Expr) -> Callable[[Expr], Expr]:
    """The solution k (n,) of w k = b for any b, with w (n, n) factored once by Gauss's elimination."""
    n = w.shape[0]
    lower: list[dict[int, Expr]] = [{} for _ in range(n)]
    upper: list[dict[int, Expr]] = [{} for _ in range(n)]  # columns by row, from the pivot on
    for at, (i, j) in enumerate(zip(*w.sparsity().get_triplet(), strict=True)):
        upper[i][j] = w.nz[at]
    for k in range(n):
        for i in range(k + 1, n):
            if k in upper[i]:
                share = lower[i][k] = upper[i].pop(k) / upper[k][k]
                for j in sorted(upper[k].keys() - {k}):
                    upper[i][j] = upper[i].get(j, 0.0) - share * upper[k][j]

    def solve(rhs: Expr) -> Expr:
        found = cs.vertsplit(rhs)
        for i in range(n):
            for k in sorted(lower[i]):
                found[i] -= lower[i][k] * found[k]
        for i in reversed(range(n)):
            for j in sorted(upper[i].keys() - {i}):
                found[i] -= upper[i][j] * found[j]
            found[i] /= upper[i][i]
        return cs.vertcat(*found)

    return solve
