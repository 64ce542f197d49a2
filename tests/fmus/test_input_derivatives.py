"""Derivatives of inputs by FMI 2.0: native builds take the first ones, others hold inputs and refuse them."""

from math import exp

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException

from fmus.drive.model import Drive
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.carrier import build_carrier
from fmus.export.container.coupled import build_coupled
from fmus.host.fmu import Fmu, FmuError
from fmus.model import Model
from fmus.variables import Input, State

DELAY = [("input_delay", "F")]  # off while its share is zero
HOLDING = {
    "python": build_python,
    "carried by python": lambda model, out: build_coupled(
        build_native(model, out), (), DELAY, out / "by_python.fmu"
    ),
    "carried natively": lambda model, out: build_carrier(
        build_native(model, out), (), DELAY, out / "native.fmu"
    ),
}
FORCE, FRICTION, MASS, T = 100.0, 200.0, 95.0, 0.25
DECAY = FRICTION / MASS


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    return build_native(Drive(), tmp_path_factory.mktemp("native"))


def speed(t, rate):
    """q_dot from rest under F = FORCE + rate t, of M q_ddot + F_v q_dot = F."""
    return (FORCE - rate / DECAY) / FRICTION * (1 - exp(-DECAY * t)) + rate / FRICTION * t


def set_rate(fmu, value, order=1, name="F"):
    fmu.instance._slave.setRealInputDerivatives(fmu.references([name]), [order], [value])


@pytest.mark.parametrize("build", HOLDING)
def test_inputs_are_held_where_a_build_does_not_offer_more(build, tmp_path):
    path = HOLDING[build](Drive(), tmp_path)
    offered = read_model_description(str(path)).coSimulation
    assert not offered.canInterpolateInputs
    assert not offered.maxOutputDerivativeOrder
    with Fmu(path) as fmu:
        fmu.restart(F=FORCE, F_v=FRICTION, M=MASS)
        with pytest.raises(FMICallException, match="fmi2SetRealInputDerivatives"):
            set_rate(fmu, 1e3)
        fmu.step(T)
        assert fmu["q_dot"] == pytest.approx(speed(T, 0.0), rel=1e-9)  # a rate of 1 kN/s would double it


def test_an_input_with_a_rate_is_linear_over_the_next_step_and_then_held(native):
    assert read_model_description(str(native)).coSimulation.canInterpolateInputs
    with Fmu(native) as fmu:
        fmu.restart(F=FORCE, F_v=FRICTION, M=MASS)
        set_rate(fmu, 1e3)
        fmu.step(T)
        assert fmu["q_dot"] == pytest.approx(speed(T, 1e3), rel=1e-5)
        assert fmu["F"] == pytest.approx(FORCE + 1e3 * T)
        before = fmu["q_dot"]
        fmu.step(T)
        held = fmu["F"] / FRICTION
        assert fmu["q_dot"] == pytest.approx(held + (before - held) * exp(-DECAY * T), rel=1e-9)


def test_a_rate_of_zero_is_the_same_to_the_bit(native):
    found = []
    for rated in (False, True):
        with Fmu(native) as fmu:
            fmu.restart(F=FORCE, F_v=FRICTION, M=MASS)
            if rated:
                set_rate(fmu, 0.0)
            fmu.step(T)
            found.append(fmu["q_dot"])
    assert found[0] == found[1]


def test_a_saved_state_has_its_rates(native):
    with Fmu(native) as fmu:
        fmu.restart(F=FORCE, F_v=FRICTION, M=MASS)
        set_rate(fmu, 1e3)
        slave = fmu.instance._slave
        state = slave.getFMUState()
        fmu.step(T)
        first = fmu["q_dot"]
        slave.setFMUState(state)
        fmu.step(T)
        slave.freeFMUState(state)
        assert fmu["q_dot"] == first


@pytest.mark.parametrize(
    ("value", "order", "name", "said"),
    [
        (1.0, 2, "F", "order 2"),
        (1.0, 1, "M", "not that of an input"),
        (np.nan, 1, "F", "not a finite number"),
    ],
)
def test_what_is_no_rate_of_an_input_is_refused(native, value, order, name, said):
    with Fmu(native) as fmu:
        fmu.restart(F=FORCE, F_v=FRICTION, M=MASS)
        with pytest.raises(FMICallException, match="fmi2SetRealInputDerivatives"):
            set_rate(fmu, value, order, name)
        assert said in fmu.instance.messages[-1]


class Filled(Model):
    """x' = u, with an input between 0 and 1."""

    name = "Filled"
    step_size = 0.01
    x = State("1", doc="sum", nominal=1.0)
    u = Input("1/s", min=0.0, max=1.0, doc="flow")

    def derivatives(self):
        return {"x": self.u}


def test_a_rate_that_leads_beyond_a_limit_leaves_the_step_unmade(tmp_path):
    with Fmu(build_native(Filled(), tmp_path)) as fmu:
        fmu.restart(u=0.9)
        set_rate(fmu, 1.0, name="u")
        with pytest.raises(FmuError, match="discard"):
            fmu.step(0.2)
        assert (fmu["u"], fmu["x"]) == (0.9, 0.0)


def test_a_reset_forgets_rates(native):
    with Fmu(native) as fmu:
        fmu.restart(F=FORCE, F_v=FRICTION, M=MASS)
        set_rate(fmu, 1e3)
        fmu.restart(F=FORCE, F_v=FRICTION, M=MASS)
        fmu.step(T)
        assert fmu["F"] == FORCE


def test_rates_make_the_error_of_long_steps_one_of_second_order(native):
    """F = sin(6 t): F and its rate are set at the start of each communication step."""

    def missed(step: float, rates: bool) -> float:
        w, worst = 6.0, 0.0
        with Fmu(native) as fmu:
            fmu.restart(F=0.0, F_v=FRICTION, M=MASS)
            for t in np.arange(0.0, 2.0, step):
                fmu.set(F=FORCE * np.sin(w * t))
                if rates:
                    set_rate(fmu, FORCE * w * np.cos(w * t))
                fmu.step(step)
                end = t + step
                exact = DECAY * np.sin(w * end) - w * np.cos(w * end) + w * np.exp(-DECAY * end)
                exact *= FORCE / MASS / (DECAY**2 + w**2)
                worst = max(worst, abs(fmu["q_dot"] - exact))
        return worst

    assert missed(0.02, False) / missed(0.01, False) == pytest.approx(2.0, rel=0.1)
    assert missed(0.02, True) / missed(0.01, True) == pytest.approx(4.0, rel=0.2)
    assert missed(0.02, True) < 0.1 * missed(0.02, False)
