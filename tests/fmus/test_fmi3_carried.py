"""An FMI 3.0 FMU carried in a coupled one, which is FMI 2.0 itself."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fmus.export.container.coupled import build_coupled
from fmus.host.archive import describe
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu, FmuError
from fmus.host.grading.check import grade
from fmus.host.grading.trials import TRIALS
from tests.helpers.vdp import (
    ERROR,
    OUTPUTS,
    solved,
    stirred,
)

PORT = PortNames("mass", "u", "x1", "x0")


def test_an_effect_at_its_port(vdp, tmp_path):
    """Carried in a coupled FMU: force held over coupling steps of 1 ms, so of first order in these."""
    damped = build_coupled(vdp, [PORT], [("viscous_damping", "mass")], tmp_path)
    t = np.linspace(0, 4, 401)
    u = stirred(t)
    [name] = set(describe(damped).parameters) - {"mu", "fault"}
    with Fmu(vdp) as bare, Fmu(damped) as coupled:
        expected = bare.simulate(t, {"u": u}, OUTPUTS[:2], {})
        assert_allclose(coupled.simulate(t, {"u": u}, OUTPUTS[:2], {}), expected, atol=ERROR)
        found = coupled.simulate(t, {"u": u}, OUTPUTS[:2], {name: 0.4})
        assert_allclose(found, solved(t, u, damping=0.4)[:, :2], atol=5e-3)
        for fault, words in ((1, "stopped in the step"), (2, "stopped in the step at t = 0 s")):
            coupled.restart(fault=fault)
            with pytest.raises(FmuError, match=f"the carried FMU {words}"):
                coupled.step(0.01)
        coupled.restart(mu=np.nan)
        with pytest.raises(FmuError, match="mu = nan"):
            coupled.step(0.01)
        assert_array_equal(coupled.simulate(t, {"u": u}, OUTPUTS[:2], {name: 0.4}), found)


def test_the_grade_of_a_coupled_one_is_clean_but_for_a_saved_state(vdp, tmp_path):
    found = grade(build_coupled(vdp, [PORT], [("coulomb_friction", "mass")], tmp_path))
    assert {c.title: c.passed for c in found.checks} == {**dict.fromkeys(TRIALS, True), "saved state": None}
