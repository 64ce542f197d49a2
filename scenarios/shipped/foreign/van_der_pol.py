"""Van der Pol's oscillator by another hand: an FMU that knows PythonFMU and nothing of railfmi.

The equations are those of the Reference FMUs' VanDerPol: x0'' = mu (1 - x0²) x0' - x0.
"""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Initial


class VanDerPol(Fmi2Slave):  # type: ignore[misc]  # pythonfmu comes without types
    """x0' = x1, x1' = mu (1 - x0²) x1 - x0, by Runge-Kutta steps."""

    def __init__(self, **kwargs: object) -> None:
        """Declare the variables; PythonFMU gives the arguments."""
        super().__init__(**kwargs)
        self.x0, self.x1, self.mu = 2.0, 0.0, 1.0
        for name in ("x0", "x1"):
            state = {"causality": Fmi2Causality.output, "initial": Fmi2Initial.exact}
            self.register_variable(Real(name, **state))
        tunable = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        self.register_variable(Real("mu", **tunable))

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One step of Runge and Kutta."""
        x, h = (self.x0, self.x1), step_size
        k1 = self._slope(x)
        k2 = self._slope(_ahead(x, k1, h / 2))
        k3 = self._slope(_ahead(x, k2, h / 2))
        k4 = self._slope(_ahead(x, k3, h))
        mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
        self.x0, self.x1 = _ahead(x, mean, h)
        return True

    def _slope(self, x: tuple[float, ...]) -> tuple[float, float]:
        return x[1], self.mu * (1 - x[0] ** 2) * x[1] - x[0]


def _ahead(x: tuple[float, ...], slope: list[float] | tuple[float, ...], h: float) -> tuple[float, ...]:
    return tuple(a + h * b for a, b in zip(x, slope, strict=True))
