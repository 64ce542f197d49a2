"""Values of an FMU's outputs at the last common times, and what they are taken to be in between."""

from collections.abc import Callable

ROUNDING = 1e-6  # of half a step, by which two sums of steps may differ that are the same time
Values = list[float]
Line = tuple[Values, Values, float]  # value j = a[j] + w * (a[j] - b[j])
Extrapolation = Callable[["Samples", float, float], Line]


class Samples:
    """Values at the time before, now and, once the FMU has stepped on while others have not, ahead.

    What is not known yet at a time stays as it was. The lists are replaced, never changed, so that a copy
    of this object keeps them.
    """

    __slots__ = ("ahead", "before", "now", "t_ahead", "t_before", "t_now")

    def __init__(self) -> None:
        self.before: Values | None = None
        self.now: Values = []
        self.ahead: Values | None = None
        self.t_before = self.t_now = self.t_ahead = 0.0

    def start(self, values: Values) -> None:
        """Values at the beginning, before which there is nothing."""
        self.now, self.t_now, self.before, self.ahead = values, 0.0, None, None

    def lead(self, values: Values, t: float) -> None:
        """The FMU has stepped on to t, s."""
        self.ahead, self.t_ahead = values + self.now[len(values) :], t

    def arrive(self, t: float) -> None:
        """The others have come to t, s, too."""
        if self.ahead is not None:
            self.before, self.t_before = self.now, self.t_now
            self.now, self.t_now, self.ahead = self.ahead, t, None

    def settle(self, values: Values) -> None:
        """Better values for now."""
        self.now = values

    def jump(self) -> None:
        """Something changed at once: no line leads through the past."""
        self.before = None

    def assign(self, other: "Samples") -> "Samples":
        """Take over all that another one holds; returns this one."""
        for name in Samples.__slots__:
            setattr(self, name, getattr(other, name))
        return self


def hold(s: Samples, t: float, end: float) -> Line:
    """The value now."""
    return s.now, s.now, 0.0


def hold_newest(s: Samples, t: float, end: float) -> Line:
    """The newest value that is not after the end of the step of who asks."""
    known = s.ahead if s.ahead is not None and s.t_ahead - end <= ROUNDING * (end - t) else s.now
    return known, known, 0.0


def linear(s: Samples, t: float, end: float) -> Line:
    """The value at t, s, on the line through now and before."""
    if s.before is None:
        return s.now, s.now, 0.0
    return s.now, s.before, (t - s.t_now) / (s.t_now - s.t_before)


def linear_newest(s: Samples, t: float, end: float) -> Line:
    """The value at t, s, on the line through the newest two, between which t may lie."""
    if s.ahead is None:
        return linear(s, t, end)
    return s.ahead, s.now, (t - s.t_ahead) / (s.t_ahead - s.t_now)


EXTRAPOLATIONS: dict[tuple[str, str], Extrapolation] = {
    ("jacobi", "hold"): hold,
    ("jacobi", "linear"): linear,
    ("gauss_seidel", "hold"): hold_newest,
    ("gauss_seidel", "linear"): linear_newest,
}
