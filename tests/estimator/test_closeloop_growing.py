"""Effects that the first part of a record shows, where the whole record shows another one first."""

import numpy as np
import pytest

from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.closeloop.screening.screen import screen
from estimator.closeloop.search.growing import at_the_beginning
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import problem, record, to_and_fro

KINDS = ("coulomb_friction", "cubic_stiffness", "step_force")


@pytest.mark.parametrize("push", [-60.0, 60.0])
def test_an_effect_that_acts_from_the_start_is_seen_before_another_sets_in(tmp_path, push):
    def friction_and_later_a_push(t, q, v):
        return 20.0 * np.tanh(v / 0.01) + (push if t > 3.0 else 0.0)

    asked = problem(ModelBuilder("drive", tmp_path), record(to_and_fro(), friction_and_later_a_push, 2))
    _, base, noise = calibrate(asked)
    forces = missing_forces(asked, base.fit.theta, noise.std)
    candidates = physical_candidates(asked, [(kind, "carriage") for kind in KINDS], forces)
    screening = Screening(asked, base.fit, noise.weighting, forces)
    whole = screen(
        screening.fit, [((c,), g) for c, g in zip(candidates, screening.changes(candidates), strict=True)]
    )
    early = at_the_beginning(Baseline(asked, base, noise), candidates, forces)
    assert whole[0].label == "step_force@carriage"
    assert early[0].label == "coulomb_friction@carriage"
