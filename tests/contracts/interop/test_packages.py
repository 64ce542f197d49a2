"""What docs/exchange.md says of SSP packages of others is what was recorded, and is so still where they are.

RAILFMI_SSP_PACKAGES names the folder with the packages, see packages.py.
"""

import os
from pathlib import Path

import pytest

from tests.contracts.interop import packages
from tests.contracts.interop.packages import OURS, PAGE, RAN, Package, stored, table, tried

FOLDER = os.environ.get("RAILFMI_SSP_PACKAGES")


def test_the_page_shows_what_became_of_the_packages():
    inside = PAGE.read_text().split(packages.BEGIN)[1].split(packages.END)[0]
    assert inside.strip() == table(stored()).strip()


def test_what_is_refused_is_the_packages_fault_but_for_one():
    outcomes = {p.name: p.outcome for p in stored()}
    assert len(outcomes) >= 20
    assert [n for n, outcome in outcomes.items() if outcome == OURS] == ["dp_ship"]
    assert sum(outcome == RAN for outcome in outcomes.values()) >= 11


def test_a_refusal_that_nobody_has_looked_at_has_no_row():
    with pytest.raises(ValueError, match="no outcome on the page for 'it is too blue'"):
        table([Package("sky", "it is too blue")])


@pytest.mark.slow
@pytest.mark.skipif(not FOLDER, reason="RAILFMI_SSP_PACKAGES names no folder of packages")
@pytest.mark.parametrize("package", stored(), ids=lambda p: p.name)
def test_a_package_ends_as_recorded(package):
    file = Path(FOLDER or "") / f"{package.name}.ssp"
    if not file.is_file():
        pytest.skip(f"{file} is not there")
    assert tried(file).outcome == package.outcome
