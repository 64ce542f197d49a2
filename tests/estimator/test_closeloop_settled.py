"""An FMU that computes its outputs in a step, from what acts over it, against exact motion."""

import numpy as np
import pytest

from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.resolution import in_settled_steps
from estimator.closeloop.question.problem import Problem
from estimator.plant import Steps
from estimator.record import Record, Run
from estimator.weighting import Weighting
from fmus.export.builders.hypotheses import ForeignBuilder

K, DT, NOISE = 2.0, 0.02, 1e-4
EXACT = "away = self.h - self.u / self.k\nself.h = self.u / self.k + away * math.exp(-self.k * dt)\n"
IN_A_STEP = EXACT + "self.x = self.h + 0.5 * self.u"  # u: the mean over the step
STATE = EXACT + "self.x = self.h"
FROM_REST = "def exit_initialization_mode(self):\n    self.x = 0.0"


def recorded(foreign, folder, step, direct) -> Problem:
    """h' = -k h + sin 3t from rest, of which h + direct * u is measured without noise."""
    t = np.arange(0.0, 20.0, DT)
    u, w = np.sin(3 * t), 3.0
    h = (K * u - w * np.cos(w * t) + w * np.exp(-K * t)) / (K**2 + w**2)
    run = Run(t, u[:, None], (h + direct * u)[:, None], t < 10, (t >= 10) & (t < 13), t >= 13)
    record = Record((run,), ("u",), ("x",), np.array([NOISE]))
    return Problem(
        ForeignBuilder(foreign(step, FROM_REST), (), folder), record, {"k": 1.5}, {"k": (1.0, 4.0)}
    )


def test_outputs_that_a_step_computes_are_read_with_the_inputs_of_their_sample(foreign, tmp_path):
    problem = recorded(foreign, tmp_path, IN_A_STEP, 0.5)
    _, held, noise = calibrate(problem)
    found = in_settled_steps(problem, held.theta, noise.weighting)
    assert found.steps == found.searched == Steps(settled=True)
    _, settled, _ = calibrate(found)
    late = 0.5 * 3 * DT / 2 / np.sqrt(2)  # rms of what half a step of delay does to the direct part
    left = [np.sqrt(np.mean(found.record.of(h.residuals, "fit") ** 2)) for h in (held, settled)]
    assert left[0] > late / 4  # a wrong k hides some of it
    assert left[1] < late / 50
    assert abs(settled.theta["k"] - K) < abs(held.theta["k"] - K) / 20


@pytest.mark.parametrize("coupled", [0.0, DT])
def test_an_fmu_whose_outputs_are_states_keeps_its_steps(foreign, tmp_path, coupled):
    problem = recorded(foreign, tmp_path, STATE, 0.0).in_steps(Steps(coupled=coupled))
    assert in_settled_steps(problem, {"k": K}, Weighting.white(np.array([NOISE]))) is None
