"""Silverbox: a circuit that behaves as a mass on a hardening spring; the model has a linear spring."""

from math import pi
from pathlib import Path

import numpy as np

from benchmarks.measured.benchmark import Array, Benchmark, Columns
from fmus.model import Model
from fmus.variables import (
    Expr,
    Input,
    Parameter,
    State,
    rate,
)

BAND = 250.0  # Hz; the correction is constant above this, the excitation ends at 200 Hz
IDENTIFIED = 10000  # samples of the multisines that are used, more than one period
MIRRORED = 2000  # samples that are mirrored at both ends, since the spectral filter assumes a periodic record


class Oscillator(Model):
    """q_ddot = omega² (gain (u + u_0) - q) - 2 D omega q_dot + F_ext, omega = 2 pi f_0."""

    name = "Oscillator"
    step_size = 2e-4

    q = State("V", doc="position", nominal=0.1)
    q_dot = State("V/s", doc="velocity", nominal=40.0)
    u = Input("V", doc="force")
    F_ext = Input("V/s2", doc="port: force over mass", nominal=1e3)
    f_0 = Parameter("Hz", 70.0, min=1.0, doc="natural frequency")
    D = Parameter("1", 0.05, min=0.0, doc="damping ratio")
    gain = Parameter("1", 1.0, doc="static gain")
    u_0 = Parameter("V", 0.0, nominal=0.01, doc="offset of the force amplifier")
    q_ddot = rate(q_dot, "V/s2", "acceleration")

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        omega = 2 * pi * m.f_0
        spring = omega**2 * (m.gain * (m.u + m.u_0) - m.q)
        return {"q": m.q_dot, "q_dot": spring - 2 * m.D * omega * m.q_dot + m.F_ext}


def through_means(u: Array, dt: float) -> Array:
    """Samples (N,) with which a mass moves, at the samples, as with the band-limited force with samples u.

    An input acts over a step with the mean of its ends. A mass then moves by (x / tan x)² of the right
    amount, x = pi f dt, which is 0.39 at 200 Hz here. The force is divided by this factor, which is real, so
    that phases are kept.
    """
    ends = 2 * u[0] - u[MIRRORED:0:-1], 2 * u[-1] - u[-2 : -MIRRORED - 2 : -1]
    spectrum = np.fft.rfft(np.concatenate([ends[0], u, ends[1]]))
    f = np.fft.rfftfreq(len(u) + 2 * MIRRORED, dt)
    x = pi * dt * np.clip(f, f[1], BAND)
    taken = (x / np.tan(x)) ** 2
    found: Array = np.fft.irfft(spectrum / taken, len(u) + 2 * MIRRORED)[MIRRORED:-MIRRORED]
    return found


def convert(data: Columns) -> Columns:
    """The force corrected for the averaging of inputs over a step; the position is unchanged."""
    dt = float(np.median(np.diff(data["time_s"])))
    return {**data, "force_V": through_means(data["force_V"], dt)}


def convert_identify(data: Columns) -> Columns:
    """The same for the first part of the record to identify, since each fit simulates it many times."""
    return {name: column[:IDENTIFIED] for name, column in convert(data).items()}


BENCHMARK = Benchmark(
    name="silverbox",
    title="Silverbox, arrow",
    model=Oscillator,
    declaration=Path(__file__).with_suffix(".toml"),
    files={"silverbox_train.csv": convert_identify, "silverbox_test_arrow.csv": convert},
    missing="cubic stiffness",
    known=frozenset({("cubic_stiffness", "mass")}),
    source="T. Wigren, J. Schoukens, Three free data sets for development and benchmarking in nonlinear "
    "system identification, European Control Conference 2013",
    target={"q": 0.6e-3},
    rank=1,
)
