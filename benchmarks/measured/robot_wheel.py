"""A wheel drive of a robot with a speed controller without integral part; the model lacks dry friction."""

from pathlib import Path

from benchmarks.measured.benchmark import Benchmark, of_held
from fmus.effects.input_delay import late, late_rates
from fmus.model import Model
from fmus.variables import (
    Expr,
    Input,
    Parameter,
    State,
    rate,
)


class WheelDrive(Model):
    """omega_dot = K (omega_set(t - T) - omega) - b omega + F_ext; all terms are divided by the inertia.

    The inertia is unknown. T is the dead time of bus and controller, by Padé's approximation [5/6] as in
    `fmus.effects.input_delay`; s_1 is the set speed filtered by its denominator, s_2 to s_6 are the
    derivatives of s_1 with respect to t/T.
    """

    name = "WheelDrive"
    step_size = 1e-3

    omega = State("rad/s", doc="speed of the motor", nominal=100.0)
    phi = State("rad", doc="angle of the motor", nominal=100.0)
    s_1 = State("rad/s", doc="set speed on its way", nominal=100.0)
    s_2 = State("rad/s", doc="its derivative by t/T", nominal=200.0)
    s_3 = State("rad/s", doc="its second derivative by t/T", nominal=1e3)
    s_4 = State("rad/s", doc="its third derivative by t/T", nominal=1e4)
    s_5 = State("rad/s", doc="its fourth derivative by t/T", nominal=1e5)
    s_6 = State("rad/s", doc="its fifth derivative by t/T", nominal=5e6)
    omega_set = Input("rad/s", doc="set speed")
    F_ext = Input("N.m", doc="port: torque on the motor, of 1 kg.m2", nominal=100.0)
    K = Parameter("1/s", 20.0, min=0.0, doc="gain of the controller over inertia")
    b = Parameter("1/s", 0.5, min=0.0, doc="viscous friction over inertia")
    T = Parameter("s", 0.1, min=0.02, doc="dead time from the set speed to the controller")
    omega_dot = rate(omega, "rad/s2", "acceleration of the motor")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        way = [m.s_1, m.s_2, m.s_3, m.s_4, m.s_5, m.s_6]
        rates = {f"s_{i}": rate for i, rate in enumerate(late_rates(way, m.omega_set, m.T), 1)}
        return {"omega": m.K * (late(way) - m.omega) - m.b * m.omega + m.F_ext, "phi": m.omega, **rates}


BENCHMARK = Benchmark(
    name="robot_wheel",
    title="Robot wheel",
    model=WheelDrive,
    declaration=Path(__file__).with_suffix(".toml"),
    files=dict.fromkeys(
        (
            "robot_wheel_data_for_identification_without_integral.csv",
            "robot_wheel_validation_data.csv",
        ),
        of_held("m1_setvel_rad_s"),
    ),
    missing="dry friction",
    known=frozenset({("coulomb_friction", "motor"), ("stribeck_friction", "motor")}),
    source="O. Brylev, research-wheel-slippage (github.com/BrOleg5/research-wheel-slippage), Apache-2.0",
    target={},
    rank=5,
)
