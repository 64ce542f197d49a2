"""The compiled loop of a simulation and the loop in Python give the same numbers and the same refusals."""

import numpy as np
import pytest

from fmus import aside
from fmus.drive.model import Drive
from fmus.export.builders.native.build import build_native
from fmus.host import loop
from fmus.host.fmu import Fmu, FmuError
from tests.helpers.vdp import OUTPUTS

T = np.cumsum(np.tile([1e-3, 2e-3], loop.LONG))  # s, more steps than the loop in Python makes
FORCE = 100 * np.sin(2 * T)
INPUTS = {
    "none": {},
    "sampled": {"F": FORCE, "F_ext": 10 * np.cos(7 * T)},
    "held": {"F": FORCE[:-1]},
}
NAMES = ["q", "q_dot", "q_ddot"]


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2", "FMI 3"])
def drive(request, tmp_path_factory):
    return build_native(Drive(), tmp_path_factory.mktemp("drive"), fmi=request.param)


@pytest.mark.parametrize("kind", INPUTS)
def test_both_loops_give_the_same_to_the_bit(drive, kind, monkeypatch):
    assert loop._march() is not None
    with Fmu(drive) as fmu:
        compiled = fmu.simulate(T, INPUTS[kind], NAMES, {"q_dot": 0.5})
        monkeypatch.setattr(loop, "_march", lambda: None)
        plain = fmu.simulate(T, INPUTS[kind], NAMES, {"q_dot": 0.5})
    assert np.array_equal(compiled, plain)
    assert np.ptp(plain[:, 0]) > 0.01


@pytest.mark.parametrize("every", [1, 7])
@pytest.mark.parametrize("kind", INPUTS)
def test_a_simulation_in_blocks_is_one_simulation(drive, kind, every, monkeypatch):
    with Fmu(drive) as fmu:
        whole = fmu.simulate(T, INPUTS[kind], NAMES, {"q_dot": 0.5})
        monkeypatch.setattr(aside, "BLOCK", 2048)
        parts = fmu.simulate(T, INPUTS[kind], NAMES, {"q_dot": 0.5}, every=every)
    assert len(aside.blocks(len(T), 8 * 5)) > 5
    assert np.array_equal(parts, whole[::every])


def test_both_loops_say_where_an_input_was_refused(drive, monkeypatch):
    force = FORCE.copy()
    force[800] = np.nan
    said = []
    with Fmu(drive) as fmu:
        for march in (loop._march, lambda: None):
            monkeypatch.setattr(loop, "_march", march)
            with pytest.raises(FmuError, match=rf"step at t = {T[799]:g} s.*F = nan") as refused:
                fmu.simulate(T, {"F": force}, NAMES, {})
            said.append(str(refused.value))
    assert said[0] == said[1]


@pytest.mark.parametrize("fault", [1.0, 2.0, 3.0])
def test_both_loops_refuse_a_step_of_fmi_3_that_is_not_all_of_a_step(vdp, fault, monkeypatch):
    said = []
    for march in (loop._march, lambda: None):
        monkeypatch.setattr(loop, "_march", march)
        with Fmu(vdp) as fmu:
            with pytest.raises(FmuError) as refused:
                fmu.simulate(T, {}, OUTPUTS, {"fault": fault})
            assert fmu.instance.dead == (fault == 3)
        said.append(str(refused.value))
    assert said[0] == said[1]
