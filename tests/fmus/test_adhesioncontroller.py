"""The adhesion controller: what it passes, what it observes, and that it finds a peak that it is not told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fmus.adhesioncontroller.model import AdhesionController
from fmus.host.fmu import Fmu
from fmus.model import equations
from fmus.variables import Input, Output, Parameter, State
from tests.helpers.everything import start, values
from tests.helpers.native import native

MODEL = AdhesionController()
MADE = equations(MODEL)
P = {v.name: v.start for v in MODEL.of(Parameter)}
OUTPUTS = [v.name for v in MODEL.of(Output)]
SPEED, RADIUS = 20.0, P["r0"] / P["i_g"]  # m/s, m: of the wheel over the motor's speed


def outputs(omega_m, V, T_demand, **states):
    """Outputs by name; the filters have settled unless told otherwise."""
    x = [{"omega_f": omega_m, **states}.get(v.name, v.start) for v in MODEL.of(State)]
    u = [{"omega_m": omega_m, "V": V, "T_demand": T_demand}[v.name] for v in MODEL.of(Input)]
    return dict(zip(OUTPUTS, values(MADE.h, x, u, start(MODEL, Parameter)), strict=True))


@given(st.floats(0.0, 50.0), st.floats(-0.5, 0.5), st.floats(0.0, 1e4), st.floats(0.0, 1e4))
def test_it_never_asks_for_more_than_the_driver_nor_brakes(V, creep, demand, load):
    T = outputs((V + creep * max(V, 1.0)) / RADIUS, V, demand, T_f=load)["T"]
    assert 0 <= T <= demand


@given(st.floats(2.0, 50.0), st.floats(0.0, 9e3))
def test_it_leaves_what_adheres_to_the_driver(V, demand):
    seen = outputs(V / RADIUS, V, demand, T_f=demand)
    assert seen["T"] == demand
    assert seen["limiting"] == 0


@given(st.floats(2.0, 50.0), st.floats(0.03, 0.3), st.floats(5e3, 9e3))
def test_it_takes_torque_from_a_wheel_that_slips(V, creep, demand):
    seen = outputs(V * (1 + creep) / RADIUS, V, demand, T_f=demand)
    assert seen["T"] < demand
    assert seen["limiting"] == 1
    assert_allclose(seen["xi"], creep)


def hauled(peak, duration=12.0, dt=1e-3, load=5e3):
    """Creep and load torque (N,) of one rotating mass at constant speed under the control.

    The load torque over creep has its maximum, `load`, at the creep `peak`.
    """
    omega, T, rows = SPEED / RADIUS, 0.0, []
    with Fmu(native("adhesioncontroller")) as fmu:
        fmu.restart(omega_f=omega)
        for k in range(round(duration / dt)):
            fmu.step(dt, omega_m=omega, V=SPEED, T_demand=min(9e3, 9e3 * k * dt))
            T = fmu["T"]
            for _ in range(20):
                creep = omega * RADIUS / SPEED - 1
                torque = load * 2 * creep * peak / (creep**2 + peak**2)
                omega += dt / 20 * (T - torque) / P["J"]
            rows.append((creep, torque, fmu["T_load"]))
    return np.array(rows).T


@pytest.mark.parametrize("peak", [0.006, 0.012, 0.03])
def test_it_finds_the_peak_of_adhesion(peak):
    creep, torque, observed = hauled(peak)
    late = slice(-3000, None)
    assert torque[late].mean() > 0.97 * 5e3
    assert 0.6 * peak < creep[late].mean() < 1.6 * peak
    assert creep.max() < 5 * peak
    assert_allclose(observed[late].mean(), torque[late].mean(), rtol=0.01)
