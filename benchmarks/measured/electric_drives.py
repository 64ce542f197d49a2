"""Coupled electric drives: two motors drive a pulley by an elastic belt; the model lacks dry friction."""

from math import pi
from pathlib import Path

import casadi as cs

from benchmarks.measured.benchmark import Benchmark, of_held
from fmus.model import Model
from fmus.variables import (
    Expr,
    Input,
    Parameter,
    State,
)

STILL = 1e-3  # speed below which the magnitude is rounded, well below the resolution of the counter


class ElectricDrives(Model):
    """Two inertias, the motors (speed omega_m) and the pulley (speed omega), coupled by an elastic belt.

    omega_m' = (gain v - omega_m) / tau - share w² twist + T_m, omega' = w² twist - d omega + T,
    twist' = omega_m - omega, w = 2 pi f, each divided by its inertia. tau_e v' = u - v describes the current
    of the motors. The sensor of the pulley counts pulses over a time of about tau_s and measures only the
    magnitude of the speed.
    """

    name = "ElectricDrives"
    step_size = 1e-3

    omega_m = State("rad/s", doc="speed of the motors, on the sensor's scale", nominal=1.0)
    omega = State("rad/s", doc="speed of the pulley, on the sensor's scale", nominal=1.0)
    twist = State("rad", doc="stretch of the belt", nominal=0.1)
    v = State("V", doc="voltage that the motors' current has followed", nominal=1.0)
    speed = State("rad/s", doc="speed as the pulse counter shows it, without its sign", nominal=1.0)
    phi_m = State("rad", doc="angle of the motors", nominal=1.0)
    phi = State("rad", doc="angle of the pulley", nominal=1.0)
    u = Input("V", doc="sum of the motors' voltages")
    T_m_ext = Input("N.m", doc="port: torque on the motors, of 1 kg.m2", nominal=10.0)
    T_ext = Input("N.m", doc="port: torque on the pulley, of 1 kg.m2", nominal=10.0)
    gain = Parameter("rad/(V.s)", 3.0, doc="speed for each volt")
    tau = Parameter("s", 0.15, min=1e-3, doc="time constant of the motors")
    tau_e = Parameter("s", 0.01, min=2e-3, doc="electrical time constant of the motors")
    tau_s = Parameter("s", 0.01, min=2e-3, doc="time constant of the pulse counter")
    f = Parameter("Hz", 2.5, min=0.1, doc="frequency of the pulley on the held belt")
    share = Parameter("1", 1.0, min=0.0, doc="inertia of the pulley over that of the motors")
    d = Parameter("1/s", 3.0, min=0.0, doc="viscous friction of the pulley over its inertia")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        belt = (2 * pi * m.f) ** 2 * m.twist
        motors = (m.gain * m.v - m.omega_m) / m.tau - m.share * belt + m.T_m_ext
        return {
            "omega_m": motors,
            "omega": belt - m.d * m.omega + m.T_ext,
            "twist": m.omega_m - m.omega,
            "v": (m.u - m.v) / m.tau_e,
            "speed": (cs.sqrt(m.omega**2 + STILL**2) - m.speed) / m.tau_s,
            "phi_m": m.omega_m,
            "phi": m.omega,
        }


BENCHMARK = Benchmark(
    name="electric_drives",
    title="Coupled Electric Drives, PRBS",
    model=ElectricDrives,
    declaration=Path(__file__).with_suffix(".toml"),
    files=dict.fromkeys(("ced_prbs1.csv", "ced_prbs3.csv"), of_held("motor_voltage_sum_V")),
    missing="dry friction of the drives",
    # hysteresis that slips after a small part of the motion is dry friction (Dahl's model)
    known=frozenset(
        (kind, at)
        for kind in ("coulomb_friction", "stribeck_friction", "hysteresis")
        for at in ("motors", "pulley")
    ),
    source="T. Wigren, M. Schoukens, Coupled electric drives data set and reference models, Uppsala "
    "University 2017",
    target={},
    rank=4,
)
