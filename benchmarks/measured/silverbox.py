"""Silverbox: a circuit that behaves as a mass on a hardening spring; here without the hardening."""

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

BAND = 250.0  # Hz; the excitation ends at 200 Hz, and what is above is not raised further
IDENTIFIED = 10000  # samples of the multisines, one period and more: the test record is kept whole
MIRRORED = 2000  # samples before and after, since a filter in the frequency domain takes a record as a loop


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
    """Samples (N,) that move a mass as the band-limited force with samples u does, exactly at the samples.

    Over a step an input acts with the mean of its ends. A mass then moves by (x / tan x)² of what it should,
    x = pi f dt: by 0.39 at 200 Hz here. What is taken there is given here; no phase is lost.
    """
    ends = 2 * u[0] - u[MIRRORED:0:-1], 2 * u[-1] - u[-2 : -MIRRORED - 2 : -1]
    spectrum = np.fft.rfft(np.concatenate([ends[0], u, ends[1]]))
    f = np.fft.rfftfreq(len(u) + 2 * MIRRORED, dt)
    x = pi * dt * np.clip(f, f[1], BAND)
    taken = (x / np.tan(x)) ** 2
    found: Array = np.fft.irfft(spectrum / taken, len(u) + 2 * MIRRORED)[MIRRORED:-MIRRORED]
    return found


def convert(data: Columns) -> Columns:
    """The force as it must be given to act as it was measured; the position untouched."""
    dt = float(np.median(np.diff(data["time_s"])))
    return {**data, "force_V": through_means(data["force_V"], dt)}


def convert_identify(data: Columns) -> Columns:
    """The same of the record to identify, its first part: each fit simulates it dozens of times."""
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
