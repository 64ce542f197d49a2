"""A record whose arrays lie in files is closed like one whose arrays lie in memory."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from estimator.closeloop.detection.detect import detect
from estimator.closeloop.diagnostics.diagnostics import diagnose
from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening import changes, levers, regressors
from estimator.closeloop.screening.candidates import fault_candidates, physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.closeloop.screening.regressors import Calibration
from estimator.closeloop.screening.regressors import alike as alike_of
from estimator.closeloop.screening.screen import screen
from fmus import aside
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import coulomb, problem, record, to_and_fro

LEVEL = 0.01


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    """A carriage with friction that the model lacks."""
    builder = ModelBuilder("drive", tmp_path_factory.mktemp("carriage"))
    return problem(builder, record(to_and_fro(), coulomb(20.0), 1))


@pytest.fixture(scope="module")
def in_memory(asked):
    return found(asked)


@pytest.fixture
def all_is_long(monkeypatch):
    """Every array is long, and no more than a few rows or columns are worked on at once."""
    monkeypatch.setattr(aside, "LONG", 1)
    monkeypatch.setattr(aside, "FILE", 1 << 16)
    monkeypatch.setattr(aside, "BLOCK", 1 << 12)
    monkeypatch.setattr(aside._SHELF, "_last", None)
    monkeypatch.setattr(changes, "TOGETHER", 1)
    monkeypatch.setattr(regressors, "READ_AT_ONCE", 1)
    monkeypatch.setattr(levers, "SAMPLES_AT_ONCE", 100)


def found(asked: Problem) -> dict[str, Any]:
    """What the steps of close-loop find, up to the fits."""
    declared, base, noise = calibrate(asked)
    baseline = Baseline(asked, base, noise)
    forces = missing_forces(asked, base.fit.theta, noise.std)
    candidates = physical_candidates(asked, asked.builder.offers, forces)
    candidates += fault_candidates(asked.record, noise.std, asked.policy.candidates)
    screening = Screening(asked, base.fit, noise.weighting, forces)
    change = list(zip(candidates, screening.changes(candidates), strict=True))
    promises = screen(screening.fit, [((c,), g) for c, g in change])
    rng, columns = np.random.default_rng(0), [g for _, g in change]
    cosines = alike_of(Calibration.of(screening.fit), columns, rng)
    seen = detect(baseline, screening.fit, columns, cosines, 1.0, False, rng)
    beside = diagnose(baseline, screening.fit, change, cosines, LEVEL, rng)
    fits = Fitter(baseline).hypotheses(promises[:3], 2)
    return {
        "declared": declared.fit.covariance,
        "base": [base.fit.values, base.fit.covariance, base.fit.residual, *base.fit.slopes],
        "change": [g for _, g in change],
        "gains": sorted(p.gain for p in promises),
        "detection": {**seen.figures, "importance": seen.importance, "p": seen.p_value},
        "black box": [beside.black_box.rms, *beside.black_box.residuals],
        "power": {(v.kind, v.location, v.parameter): v.smallest for v in beside.power},
        "decoys": beside.decoy_gain,
        "stability": beside.stability,
        "fits": {h.label: [h.fit.values, h.fit.covariance, *h.residuals] for h in fits},
    }


def test_what_is_found_does_not_depend_on_where_arrays_lie(asked, in_memory, all_is_long):
    in_files = found(asked)
    assert not in_files["base"][2].flags.writeable
    assert not in_files["change"][0].flags.writeable
    alike(in_files, in_memory)


def alike(one: Any, other: Any) -> None:
    """The same to what the order of a sum can change."""
    if isinstance(other, dict):
        assert one.keys() == other.keys()
        for key in other:
            alike(one[key], other[key])
    elif isinstance(other, list):
        for a, b in zip(one, other, strict=True):
            alike(a, b)
    else:
        assert_allclose(one, other, rtol=1e-6, atol=1e-9 * float(np.max(np.abs(other), initial=1.0)))
