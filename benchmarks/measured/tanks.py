"""Cascaded tanks: a pump fills the upper tank, which drains into the lower one; the model lacks overflow."""

from pathlib import Path

import casadi as cs

from benchmarks.measured.benchmark import Benchmark, Columns
from fmus.model import Model
from fmus.variables import (
    Expr,
    Input,
    Output,
    Parameter,
    State,
    rate,
)

CLOCK = 1e-3  # ks per second; laws around an FMU are integrated with a thousandth of its unit of time
EMPTY = 1e-6  # V, level below which the outflow is zero


class Tanks(Model):
    """x_1' = c max(u + u_0, 0) - Q_1 + F_1 + F_12, x_2' = Q_1 - Q_2 + F_2 - F_12, Q = k sqrt(x).

    Both tanks and outlets are equal. Levels are in volts of the sensor and time is in ks. The ports are
    flows: into either tank from outside, and from the lower into the upper tank. The pump cannot reverse. The
    level of the upper tank is not measured; its state is the rise since the start, and its level at the start
    is a parameter, because both records are assumed to start with the same level.
    """

    name = "Tanks"
    step_size = 1e-3

    rise = State("V", doc="rise of the upper tank's level since the start", nominal=5.0)
    x_2 = State("V", 5.0, doc="level of the lower tank", nominal=5.0)
    u = Input("V", doc="pump voltage")
    F_1_ext = Input("V/s", doc="port: flow into the upper tank", nominal=10.0)
    F_2_ext = Input("V/s", doc="port: flow into the lower tank", nominal=10.0)
    F_12_ext = Input("V/s", doc="port: flow into the upper tank out of the lower one", nominal=10.0)
    x_1_start = Parameter("V", 5.0, min=0.0, doc="level of the upper tank at the start")
    c = Parameter("1/s", 50.0, min=0.0, doc="flow of the pump for each volt")
    u_0 = Parameter("V", 0.0, doc="offset of the pump's characteristic")
    k = Parameter("V/s", 50.0, min=0.0, doc="flow out of a tank at a level of 1 V")
    x_1 = Output("V", doc="level of the upper tank", nominal=5.0)
    x_1_dot = rate(rise, "V/s", "rate of the upper tank's level")
    x_2_dot = rate(x_2, "V/s", "rate of the lower tank's level")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives: Torricelli's law for both outlets."""
        out_1, out_2 = (m.k * cs.sqrt(cs.fmax(x, EMPTY)) for x in (m.x_1_start + m.rise, m.x_2))
        upper = m.c * cs.fmax(m.u + m.u_0, 0.0) - out_1 + m.F_1_ext + m.F_12_ext
        return {"rise": upper, "x_2": out_1 - out_2 + m.F_2_ext - m.F_12_ext}

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        return {"x_1": m.x_1_start + m.rise}


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
