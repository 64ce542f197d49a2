"""The row on friction from torsion: found at the limit of adhesion, and honest below it."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.literature import ROWS, run_row
from scenarios.literature import friction_torsion as torsion
from scenarios.literature.case import Record
from scenarios.literature.following import rmse
from scenarios.literature.twin import twin
from tests.helpers.native import native
from tests.helpers.rows import truth
from tests.truth.traction import Inputs, Traction, rolling, simulate


def case_of(name, **changed):
    (found,) = (c for c in ROWS["friction_torsion"].cases if c.name == name)
    return replace(found, **changed)


@pytest.mark.parametrize("name", ["wet", "wet_fastsim", "worst_fastsim"])
@pytest.mark.slow
def test_friction_is_found_from_one_pull_to_the_limit(name):
    case = case_of(name, duration=1.6)
    found = torsion.followed(case, truth(case), native("traction"))
    late = found.t > torsion.SETTLED
    true = case.truth("mu0", found.t)
    assert rmse(found.value["mu0"][late], true[late]) < torsion.FOUND
    assert abs(found.value["mu0"][0] - true[0]) < 3 * torsion.STD  # it did not begin there
    assert abs(torsion.START - true[0]) > torsion.FOUND or name.startswith("wet")


@pytest.mark.slow
def test_far_below_the_limit_the_filter_says_that_it_does_not_know():
    case = case_of("dry", duration=1.5)
    t, rng = case.times, np.random.default_rng(1)
    T_m = np.interp(t, [0.0, 0.5, 1.5], [0.0, 1500.0, 1500.0])  # a fifth of the adhesion
    p = Traction()
    states = simulate(Inputs(t, {"T_m": T_m}), p, rolling(p, case.speed))
    true = dict(zip(("omega_left", "omega_right", "omega_m", "V"), states[:, 4:].T, strict=True))
    seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    found = torsion.followed(case, Record({"time": t, "T_m": T_m, **seen}), native("traction"))
    pulled = truth(case)
    reached = torsion.followed(case, pulled, native("traction"))
    assert found.std["mu0"][-1] > 0.05
    assert reached.std["mu0"].min() < 0.01


def test_the_fmu_makes_records_for_a_first_try():
    case = case_of("transition", duration=3.0)
    record = twin(native("traction"))(case)
    assert set(record.columns) == set(case.columns)
    assert all(np.isfinite(x).all() for x in record.columns.values())
    assert record.columns["V"][-1] > case.speed


@pytest.mark.slow
def test_the_row_meets_its_targets(tmp_path):
    outcome = run_row("friction_torsion", tmp_path, truth, native("traction"))
    assert not [f for f in outcome.findings if f.met is False]
    for file in ("result.json", "table.md", "friction_torsion.png", "friction_torsion_fastsim.png"):
        assert (tmp_path / file).stat().st_size > 0
