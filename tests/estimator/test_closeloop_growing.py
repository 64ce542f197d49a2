"""Effects that the first part of a record shows, where the whole record shows another one first."""

from types import SimpleNamespace

import numpy as np
import pytest

from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.closeloop.screening.screen import screen
from estimator.closeloop.search.followed import followed
from estimator.closeloop.search.growing import at_the_beginning, begun
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import problem, record, to_and_fro

KINDS = ("coulomb_friction", "cubic_stiffness", "step_force")
MOMENT = 3.0  # s


@pytest.fixture(scope="module", params=[-60.0, 60.0])
def screened(request, tmp_path_factory):
    """A carriage with friction that is pushed from a moment on, screened as a whole."""

    def friction_and_later_a_push(t, q, v):
        return 20.0 * np.tanh(v / 0.01) + (request.param if t > MOMENT else 0.0)

    builder = ModelBuilder("drive", tmp_path_factory.mktemp("carriage"))
    asked = problem(builder, record(to_and_fro(), friction_and_later_a_push, 2))
    _, base, noise = calibrate(asked)
    forces = missing_forces(asked, base.fit.theta, noise.std)
    candidates = physical_candidates(asked, [(kind, "carriage") for kind in KINDS], forces)
    screening = Screening(asked, base.fit, noise.weighting, forces)
    change = zip(candidates, screening.changes(candidates), strict=True)
    return SimpleNamespace(
        push=request.param,
        baseline=Baseline(asked, base, noise),
        candidates=candidates,
        whole=screen(screening.fit, [((c,), g) for c, g in change]),
        early=at_the_beginning(Baseline(asked, base, noise), candidates, forces),
    )


def test_an_effect_that_acts_from_the_start_is_seen_before_another_sets_in(screened):
    assert screened.whole[0].label == "step_force@carriage"
    assert screened.early[0].label == "coulomb_friction@carriage"


def test_the_second_effect_is_found_where_the_first_ceases_to_explain(screened):
    fitter = Fitter(screened.baseline)
    alive = begun(fitter, [], screened.early)
    assert alive[0].label == "coulomb_friction@carriage"
    [best, *_] = followed(fitter, alive, screened.candidates)
    assert best.label == "coulomb_friction@carriage + step_force@carriage"
    assert screened.baseline.leaves_noise(best)
    assert best.theta["step_force_carriage_t0"] == pytest.approx(MOMENT, abs=0.01)
    assert best.theta["step_force_carriage_F_0"] == pytest.approx(screened.push, rel=0.02)
    assert followed(fitter, [best], screened.candidates) == []  # it sets in itself, and nothing else does


def test_the_leading_ones_of_each_list_are_fitted_to_the_first_parts(screened):
    fitter = Fitter(screened.baseline)
    found = [h.label for h in begun(fitter, [], screened.whole[:1], screened.early)]
    assert {"step_force@carriage", "coulomb_friction@carriage"} <= set(found)
