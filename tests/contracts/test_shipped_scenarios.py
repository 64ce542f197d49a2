"""The shipped scenarios come true; the long ones are slow tests."""

import pytest

from scenarios.simulating import run, run_all
from tests.helpers.scenario_files import SHIPPED_FILES

QUICK = {"step_of_both_bogies", "contact_geometry", "contact_patch", "rig_speed_control"}
SOME = [file for file in SHIPPED_FILES if file.stem in QUICK]


@pytest.mark.parametrize("file", SOME, ids=lambda f: f.stem)
def test_a_quick_one_comes_true(file, tmp_path):
    result = run(file, tmp_path)
    assert [finding.sentence for finding in result.failed] == []
    assert result.ok


@pytest.mark.slow
def test_all_come_true_in_one_go(tmp_path):
    results = run_all(SHIPPED_FILES, tmp_path)
    assert [(r.id, f.sentence) for r in results for f in r.failed] == []
    assert all(r.ok for r in results)
    assert len(results) == len(SHIPPED_FILES)
    assert (tmp_path / "contact-sheet.png").is_file()


def test_every_quick_one_exists():
    assert len(SOME) == len(QUICK)
