"""Cascaded tanks: a pump fills the upper one, which runs into the lower one; here they never overflow."""

from pathlib import Path

import casadi as cs

from benchmarks.measured.benchmark import Benchmark, Columns
from fmus.model import Model
from fmus.variables import Expr, Input, Parameter, State

CLOCK = 1e-3  # ks a second: laws around an FMU are worked out each thousandth of its unit of time
EMPTY = 1e-6  # V, a level below which nothing runs out


class Tanks(Model):
    """x_1' = c (u + u_0) - k_1 sqrt(x_1) + F_1 - F_12, x_2' = k_1 sqrt(x_1) - k_2 sqrt(x_2) + F_2 + F_12.

    Levels in volts of the sensor, both on one scale, and time in ks. A port is a flow: into either tank from
    outside, or out of the upper into the lower one beside the pipe.
    """

    name = "Tanks"
    step_size = 1e-3

    x_1 = State("V", 5.0, doc="level of the upper tank", nominal=5.0)
    x_2 = State("V", 5.0, doc="level of the lower tank", nominal=5.0)
    u = Input("V", doc="pump voltage")
    F_1_ext = Input("V/s", doc="port: flow into the upper tank", nominal=10.0)
    F_2_ext = Input("V/s", doc="port: flow into the lower tank", nominal=10.0)
    F_12_ext = Input("V/s", doc="port: flow into the upper tank out of the lower one", nominal=10.0)
    c = Parameter("1/s", 50.0, min=0.0, doc="flow of the pump for each volt")
    u_0 = Parameter("V", 0.0, doc="offset of the pump's characteristic")
    k_1 = Parameter("V/s", 50.0, min=0.0, doc="flow out of the upper tank at a level of 1 V")
    k_2 = Parameter("V/s", 50.0, min=0.0, doc="flow out of the lower tank at a level of 1 V")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives: Torricelli's law for both outlets."""
        out_1, out_2 = (k * cs.sqrt(cs.fmax(x, EMPTY)) for k, x in ((m.k_1, m.x_1), (m.k_2, m.x_2)))
        upper = m.c * (m.u + m.u_0) - out_1 + m.F_1_ext + m.F_12_ext
        return {"x_1": upper, "x_2": out_1 - out_2 + m.F_2_ext - m.F_12_ext}


def convert(data: Columns) -> Columns:
    """Times in ks."""
    return {**data, "time_s": data["time_s"] * CLOCK}


BENCHMARK = Benchmark(
    name="tanks",
    title="Cascaded Tanks",
    model=Tanks,
    declaration=Path(__file__).with_suffix(".toml"),
    files={"cascaded_tanks_train.csv": convert, "cascaded_tanks_test.csv": convert},
    missing="overflow of the upper tank, partly into the lower one; a lower tank that is full at 10 V",
    known=frozenset({("bump_stop", "rim"), ("bump_stop", "upper"), ("bump_stop", "lower")}),
    source="M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël, Cascaded tanks benchmark combining soft and "
    "hard nonlinearities, 4TU.ResearchData 2020, doi 10.4121/12960104",
    target={"x_2": 0.39},
    rank=3,
)
