"""Measured-like records whose effect is told: closing the loop answers each as it was made."""

import json
from pathlib import Path
from typing import Any

import pytest

from scenarios import close_loop
from tests.helpers.paths import SHARED

RECORDS = SHARED / "data" / "experiments"
TRUTH = RECORDS / "truth.json"
TOLD: dict[str, dict[str, Any]] = json.loads(TRUTH.read_text()) if TRUTH.is_file() else {}


@pytest.mark.slow
@pytest.mark.skipif(not TOLD, reason="the told experiments are not on this machine")
@pytest.mark.parametrize("name", sorted(TOLD))
def test_a_told_experiment_is_answered_as_it_was_made(name: str, tmp_path: Path) -> None:
    told = TOLD[name]
    result = close_loop(RECORDS / name, tmp_path, jobs=1)
    assert result.verdict == told["verdict"], result.reason
    accepted = {(kind, location) for kind, location in told["accept"]}
    named = {(e.kind, e.location) for e in result.effects}
    assert bool(named & accepted) == bool(accepted)
