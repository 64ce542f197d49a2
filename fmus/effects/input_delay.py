"""A delay of an input: a bus, a sampled controller, two clocks, a wheel that passes later.

In data: a residual in proportion to the input's rate; the outputs come late by a fixed time.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fmus.effects.input_effect import WHOLE, InputEffect
from fmus.effects.timing import over_samples
from fmus.variables import Expr, Parameter, State

DELAYS = (0.03, 0.1, 0.3)  # s
# exp(-s) = (1 - 5/11 s + 1/11 s2 - 1/99 s3 + 1/1584 s4 - 1/55440 s5)
#         / (1 + 6/11 s + 3/22 s2 + 2/99 s3 + 1/528 s4 + 1/9240 s5 + 1/332640 s6)
OUT = (1.0, -5 / 11, 1 / 11, -1 / 99, 1 / 1584, -1 / 55440)
BACK = (332640.0, 181440.0, 45360.0, 6720.0, 630.0, 36.0)  # the denominator's, over that of s6


def late(x: Sequence[Expr]) -> Expr:
    """What arrives, from the states: the input through the denominator, and its derivatives by t/T."""
    return sum(c * s for c, s in zip(OUT, x, strict=True))


def late_rates(x: Sequence[Expr], u: Expr, T: Expr) -> list[Expr]:
    """Derivatives by time of these states, where the input u goes in and arrives T later."""
    last = BACK[0] * u - sum(c * s for c, s in zip(BACK, x, strict=True))
    return [rate / T for rate in (*x[1:], last)]


class InputDelay(InputEffect):
    """u + share (u(t - T) - u), u = u_0 before the start; share = 1 is a delay.

    u(t - T) by Padé's approximation [5/6]: within 1 % up to omega T = 6.5, 10 % up to 8.3. The states are
    share (u - u_0) through its denominator, and its derivatives by t/T.
    """

    kind = "input_delay"
    source = (
        "Padé's approximation with the numerator's degree one below the denominator's, which does not "
        "jump with the input: Vajta, Some remarks on Padé approximations, 3rd TEMPUS-INTCOM (2000)"
    )
    amplitudes = ("share",)
    complete = WHOLE
    told = ("u_0",)
    of_run = ("u_0",)
    share = Parameter("1", min=0.0, max=1.0, doc="how much of it acts, 1 = all")
    T = Parameter("s", 0.1, min=0.02, doc="delay")
    u_0 = Parameter("{u}", doc="input before the start")
    x1 = State("{u}", doc="share of the input since the start, filtered", nominal=1.0)
    x2 = State("{u}", doc="its derivative by t/T", nominal=11 / 5)
    x3 = State("{u}", doc="its second derivative by t/T", nominal=11.0)
    x4 = State("{u}", doc="its third derivative by t/T", nominal=99.0)
    x5 = State("{u}", doc="its fourth derivative by t/T", nominal=1584.0)
    x6 = State("{u}", doc="its fifth derivative by t/T", nominal=55440.0)

    def passed(self, u: Expr) -> Expr:
        """See InputEffect.passed."""
        return u + late(self._chain()) - self.share * (u - self.u_0)

    def rates(self, u: Expr) -> dict[str, Expr]:
        """See InputEffect.rates."""
        rates = late_rates(self._chain(), self.share * (u - self.u_0), self.T)
        return {f"x{i}": rate for i, rate in enumerate(rates, 1)}

    def _chain(self) -> list[Expr]:
        return [self.x1, self.x2, self.x3, self.x4, self.x5, self.x6]

    @classmethod
    def guesses(cls, t: NDArray[np.float64], u: NDArray[np.float64]) -> list[dict[str, float]]:
        """See InputEffect.guesses: delays over a decade, at rest at the first sample."""
        return [{"T": T, "u_0": float(u[0])} for T in over_samples(DELAYS, t)]
