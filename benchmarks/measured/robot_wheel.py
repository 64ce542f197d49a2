"""A wheel drive of a robot under a speed controller without integral part; here without dry friction."""

from pathlib import Path

from benchmarks.measured.benchmark import Benchmark, of_held
from fmus.model import Model
from fmus.variables import Expr, Input, Parameter, State, rate


class WheelDrive(Model):
    """omega_dot = K (omega_set - omega) - b omega + F_ext: all over the inertia, which nothing here tells."""

    name = "WheelDrive"
    step_size = 1e-3

    omega = State("rad/s", doc="speed of the motor", nominal=100.0)
    phi = State("rad", doc="angle of the motor", nominal=100.0)
    omega_set = Input("rad/s", doc="set speed")
    F_ext = Input("N.m", doc="port: torque on the motor, of 1 kg.m2", nominal=100.0)
    K = Parameter("1/s", 20.0, min=0.0, doc="gain of the controller over inertia")
    b = Parameter("1/s", 0.5, min=0.0, doc="viscous friction over inertia")
    omega_dot = rate(omega, "rad/s2", "acceleration of the motor")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        return {"omega": m.K * (m.omega_set - m.omega) - m.b * m.omega + m.F_ext, "phi": m.omega}


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
