"""Derivatives of inputs by FMI 2.0: every build holds its inputs over a step and refuses the call."""

from math import exp

import pytest
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException

from fmus.drive.model import Drive
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.carrier import build_carrier
from fmus.export.container.coupled import build_coupled
from fmus.host.fmu import Fmu

DELAY = [("input_delay", "F")]  # off while its share is zero
BUILDS = {
    "native": build_native,
    "python": build_python,
    "carried by python": lambda model, out: build_coupled(
        build_native(model, out), (), DELAY, out / "by_python.fmu"
    ),
    "carried natively": lambda model, out: build_carrier(
        build_native(model, out), (), DELAY, out / "native.fmu"
    ),
}


@pytest.mark.parametrize("build", BUILDS)
def test_inputs_are_held_and_no_build_says_otherwise(build, tmp_path):
    """q_dot = F / F_v (1 - exp(-F_v t / M)) under a held force, whatever rate was wanted for it."""
    force, friction, mass, t = 100.0, 200.0, 95.0, 0.25
    path = BUILDS[build](Drive(), tmp_path)
    offered = read_model_description(str(path)).coSimulation
    assert not offered.canInterpolateInputs
    assert not offered.maxOutputDerivativeOrder
    with Fmu(path) as fmu:
        fmu.restart(F=force, F_v=friction, M=mass)
        with pytest.raises(FMICallException, match="fmi2SetRealInputDerivatives"):
            fmu.instance._slave.setRealInputDerivatives(fmu.references(["F"]), [1], [1e3])
        fmu.step(t)
        held = force / friction * (1 - exp(-friction / mass * t))
        assert fmu["q_dot"] == pytest.approx(held, rel=1e-9)  # a rate of 1 kN/s would double it
