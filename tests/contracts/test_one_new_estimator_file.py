"""What the README promises of the estimator: a sensor fault and a filter are one new file each."""

import json
import re

import pytest

from estimator.filters import filters
from tests.helpers.carriage import record, to_and_fro, write
from tests.helpers.further import Further

SQUARE = '''
"""A sensor that is not linear.

In data: a residual in proportion to the square of one output.
"""

from estimator.sensor_faults.sensor_fault import SensorFault


class Square(SensorFault):
    """y + square y^2."""

    kind = "sensor_square"
    parameter = "square"
    unit = "1/({})"
    phrase = "a bent characteristic"

    def size(self, spread, length, step):
        """See SensorFault.size."""
        return 0.05 / spread

    def apply(self, y, t, value):
        """See SensorFault.apply."""
        return y + value * y**2
'''
SQUARE_FILE = "estimator/sensor_faults/square.py"
SCREENED = """
    from pathlib import Path

    from estimator.closeloop.fitting.calibrate import calibrate
    from estimator.closeloop.screening.candidates import fault_candidates
    from estimator.closeloop.screening.changes import Screening
    from estimator.closeloop.screening.screen import screen
    from fmus.export.builders.hypotheses import ModelBuilder
    from tests.helpers.carriage import NOISE, problem, record, to_and_fro

    made = record(to_and_fro(), lambda t, q, v: 0.0, 3)
    [run] = made.runs
    run.y[:, 1] += 0.5 * run.y[:, 1] ** 2
    asked = problem(ModelBuilder("drive", Path("drive")), made)
    _, base, noise = calibrate(asked)
    faults = fault_candidates(made, NOISE, asked.policy.candidates)
    screening = Screening(asked, base.fit, noise.weighting)
    best = screen(screening.fit, [((c,), g) for c, g in zip(faults, screening.changes(faults))])[0]
    print(*(c.label for c in faults), best.label, best.start["sensor_square_q_dot"])
"""

DEAF = '''
"""An unscented filter that hears nothing."""

from estimator.filters.ukf import Ukf


class Deaf(Ukf):
    """It predicts and corrects nothing."""

    name = "deaf"

    def _correct(self, x, P, used, innovation, S, R):
        return x, P
'''
OPTIONS = """
[estimate]
rate = 20.0
parameters.M = {{start = 85.0, std = 5.0, bounds = [70.0, 120.0]}}
[estimate.options]
filter = "{name}"
process_std = {{q = 1e-4, q_dot = 1e-3}}
input_parts = 1
"""


@pytest.fixture
def mine(tmp_path):
    return Further(tmp_path)


@pytest.mark.slow
def test_a_sensor_fault_is_one_file(mine):
    mine.write(SQUARE_FILE, SQUARE)
    *candidates, best, size = mine.says(SCREENED).split()
    kinds = ("bias", "gain", "delay", "drift", "rectification", "square")
    assert candidates == [f"sensor_{kind}@{output}" for output in ("q", "q_dot") for kind in kinds]
    assert best == "sensor_square@q_dot"
    assert float(size) == pytest.approx(0.5, abs=0.05)  # s/m, ten standard errors of the fit


@pytest.mark.slow
def test_a_sensor_fault_gets_its_tests_for_free(mine):
    mine.write(SQUARE_FILE, SQUARE)
    assert mine.passes("tests/estimator/test_sensor_faults.py", "-k", "square") >= 5


@pytest.mark.slow
def test_a_new_sensor_fault_is_found_by_closing_the_loop(mine):
    mine.write(SQUARE_FILE, SQUARE)
    made = record(to_and_fro(), lambda t, q, v: 0.0, 3)
    [run] = made.runs
    run.y[:, 1] += 0.5 * run.y[:, 1] ** 2
    folder = write(mine.work, "bent", made)
    mine.railfmi("close-loop", str(folder / "experiment.toml"), "--out", "out")
    result = json.loads((mine.work / "out" / "result.json").read_text())
    assert result["verdict"] == "sensor_fault"
    [found] = result["effects"]
    assert (found["kind"], found["location"]) == ("sensor_square", "q_dot")
    assert found["parameters"]["square"][0] == pytest.approx(0.5, abs=0.02)
    page = re.sub(r"<[^>]+>", " ", (mine.work / "out" / "report.html").read_text(encoding="utf-8"))
    assert "with a bent characteristic in the sensor of q_dot" in page
    assert "1/(m/s)" in page


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SQUARE.replace('kind = "sensor_square"', 'kind = "square"'), "call it 'sensor_square'"),
        (SQUARE.replace("    unit =", "    unity ="), "has no 'unit'"),
    ],
)
def test_a_sensor_fault_that_cannot_be_used_is_refused_in_one_line(mine, text, words):
    mine.write(SQUARE_FILE, text)
    said = mine.refused("close-loop", ".", "--out", "out")
    assert words in said
    assert re.search("sensor_faults.square", said)


def asks_for(folder, name):
    """An experiment that estimates a mass of 95 kg, believed to be 85 kg, with the filter of that name."""
    file = write(folder, f"by_{name}", record(to_and_fro(), lambda t, q, v: 0.0, 3)) / "experiment.toml"
    kept = file.read_text().replace("M = 95.0\n", "").replace("[calibrate]\nM = [80.0, 110.0]\n", "")
    file.write_text(kept + OPTIONS.format(name=name))
    return str(file)


def test_a_filter_is_one_file(mine):
    mine.write("estimator/filters/deaf.py", DEAF)
    files = [asks_for(mine.work, name) for name in ("deaf", "ukf")]
    estimates = """
        import sys
        from scenarios import estimate
        for file in sys.argv[1:]:
            result = estimate(file)
            print(result.filter, result.estimated["M"]["value"])
    """
    found = dict(line.split() for line in mine.says(estimates, *files).splitlines())
    assert float(found["deaf"]) == pytest.approx(85.0, rel=1e-12)
    assert float(found["ukf"]) == pytest.approx(95.0, abs=0.5)  # kg, five standard errors


def test_a_filter_of_ones_own_is_offered_where_another_name_is_wrong(mine):
    mine.write("estimator/filters/deaf.py", DEAF)
    said = mine.refused("estimate", asks_for(mine.work, "def"), "--out", "out")
    assert f"key 'estimate.options.filter' must be one of {', '.join(filters())}, deaf, not 'def'" in said
