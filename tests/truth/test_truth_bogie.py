"""The truth of the bogie: beside the product's model, and its records."""

import numpy as np
import pytest

from fmus.bogie.model import Bogie
from fmus.variables import State
from scenarios.experiment.experiment import load_experiment
from tests.helpers.evaluated import Evaluated
from tests.truth.bogie import DECLARED, STATES, Truth, felt_behind, rates, write_record
from tests.truth.wheelset_track import random_alignment

BOGIE = Evaluated(Bogie())
SIZES = {v.name: v.nominal for v in BOGIE.model.of(State)}


@pytest.mark.parametrize(("hollow", "dampers"), [(0.0, 1.0), (0.4, 1.0), (0.0, 0.0)])
@pytest.mark.parametrize("seed", range(4))
def test_rates_are_those_of_the_model(hollow, dampers, seed):
    """1e-3 of each rate's size: tables are linear between 10 um in one and splines in the other."""
    rng = np.random.default_rng(seed)
    x = {name: SIZES[name] * rng.uniform(-1.5, 1.5) for name in STATES}
    rail = tuple(rng.uniform(-1, 1, 4) * [1e-3, 2e-2, 1e-3, 2e-2])
    track = dict(zip(("y_irr_1", "y_irr_1_dot", "y_irr_2", "y_irr_2_dot"), rail, strict=True))
    worn = {"wear": hollow / 0.4, "b_d": DECLARED.b_d * dampers}
    found = BOGIE.rates(**x, **track, V=50.0, **worn)
    true = rates(Truth(hollow=hollow, yaw_dampers=dampers), 50.0, rail, tuple(x[name] for name in STATES))
    for name, rate in zip(STATES, true, strict=True):
        assert found[name] == pytest.approx(rate, rel=1e-3, abs=0.02 if "omega" in name else 2e-3), name


def test_the_trailing_wheelset_feels_the_track_later():
    t = np.arange(2001) * 1e-3
    run = random_alignment(np.random.default_rng(1), t, 40.0)
    late = felt_behind(run, 4.0)
    assert np.allclose(late.y_irr[200:], run.y_irr[:-200], atol=1e-7)  # 0.1 s


def test_a_record_is_an_experiment(tmp_path):
    path = write_record(tmp_path, "bogie", np.random.default_rng(2), Truth(), duration=1.0)
    experiment = load_experiment(path)
    assert set(experiment.outputs) == {"y_1", "y_2", "y_b_dot", "psi_b_dot"}
