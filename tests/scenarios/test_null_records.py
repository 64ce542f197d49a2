"""Null honesty: records without an effect, with parameters wrong within their bounds, are left alone."""

from pathlib import Path

import pytest
from joblib import Parallel, delayed

from scenarios import close_loop
from tests.truth.rig import write_null_record

SEEDS = range(7000, 7040)
ALLOWED = 1  # of the forty, by chance


def verdict(folder: Path, seed: int, jobs: int = 1) -> str:
    """What close-loop says of a record without an effect."""
    return close_loop(write_null_record(folder, seed), jobs=jobs).verdict


@pytest.mark.slow
def test_records_without_an_effect_are_not_called_one(tmp_path: Path) -> None:
    found = Parallel(n_jobs=2)(delayed(verdict)(tmp_path, seed) for seed in SEEDS)
    called = {seed: v for seed, v in zip(SEEDS, found, strict=True) if v != "no_discrepancy"}
    assert len(called) <= ALLOWED, called


def test_a_record_without_an_effect_is_left_alone(tmp_path: Path) -> None:
    assert verdict(tmp_path, 6999, jobs=2) == "no_discrepancy"
