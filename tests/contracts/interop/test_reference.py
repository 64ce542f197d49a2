"""What docs/compatibility.md says of the Reference-FMUs is what was recorded, and is so still where they are.

RAILFMI_REFERENCE_FMUS names the folder with the FMUs and their authors' results, see reference.py.
"""

import os
from pathlib import Path

import pytest

from tests.contracts.interop import reference
from tests.contracts.interop.record import PAGE
from tests.contracts.interop.reference import REFUSED, outcome, stored

FOLDER = os.environ.get("RAILFMI_REFERENCE_FMUS")
BOTH = {"BouncingBall", "Dahlquist", "Feedthrough", "Resource", "Stair", "VanDerPol"}
THREE = {"Clocks", "Roberts", "StateSpace"}
WRONG = 1e-6  # of an output's largest value
BEYOND = 2e-5  # the same for Roberts, which goes 10 us beyond the end of a step: y3 grows by 0.04/s to 0.034


def limit(name):
    """Largest difference from the right answer, of an output's largest value."""
    return BEYOND if name == "Roberts" else WRONG


def test_the_page_shows_what_became_of_the_reference_fmus():
    inside = PAGE.read_text().split(reference.BEGIN)[1].split(reference.END)[0]
    assert inside.strip() == reference.table(stored()).strip()


def test_all_reference_fmus_of_both_versions_were_tried():
    tried = {fmi: {o.name for o in stored() if o.fmi == fmi} for fmi in (2, 3)}
    assert tried == {2: BOTH, 3: BOTH | THREE}


def test_each_gives_the_right_answer_but_the_one_for_scheduled_execution():
    refused = [o for o in stored() if o.check.startswith(REFUSED)]
    assert [o.name for o in refused] == ["Clocks"]
    for o in stored():
        if o not in refused:
            assert o.run is not None, o
            assert o.run < limit(o.name), o
            assert o.compare == "agree"


def test_the_checks_that_fail_are_restarts_of_hidden_states():
    failed = {o.name: o.check for o in stored() if o.check and not o.check.startswith(REFUSED)}
    assert failed == {"Stair": "restart", "Roberts": "restart"}


@pytest.mark.slow
@pytest.mark.skipif(not FOLDER, reason="RAILFMI_REFERENCE_FMUS names no folder of Reference-FMUs")
@pytest.mark.parametrize("known", stored(), ids=lambda o: f"{o.name}-{o.fmi}")
def test_a_reference_fmu_ends_as_recorded(known):
    folder = Path(FOLDER or "")
    if not (folder / str(known.fmi) / f"{known.name}.fmu").is_file():
        pytest.skip(f"{known.name} of FMI {known.fmi}.0 is not there")
    found = outcome(folder, known.fmi, known.name)
    assert (found.check, found.said, found.compare) == (known.check, known.said, known.compare)
    assert (found.run is None) == (known.run is None)
    assert (found.run or 0.0) < limit(known.name)
