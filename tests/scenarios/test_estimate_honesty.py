"""What estimate says of its own numbers: the filter's tests of itself, bounds, and what no data inform."""

import json
import re

import numpy as np
import pytest

from estimator.filters.consistency import checks
from fmus.model import declared
from fmus.models import MODELS
from scenarios.estimating.estimating import estimate
from scenarios.estimating.page import headline
from scenarios.experiment.estimated import Options
from tests.scenarios.test_command_line import railfmi
from tests.scenarios.test_estimate_command import write_rig, write_vdp
from tests.truth.rig import write_record

BELIEVED = "its value is still the start value"


def checks_of(innovation):
    """The checks of normalised innovations (N, m) of outputs that do not depend on one another."""
    n, m = innovation.shape
    return checks(np.sum(innovation**2, axis=1), np.full(n, float(m)), innovation, ["a", "b"][:m])


def test_a_filter_that_is_right_is_rejected_as_rarely_as_promised():
    """Of 400 records 5 % are 20 with a deviation of 4.4."""
    rng = np.random.default_rng(5)
    rejected = [not all(c.passed for c in checks_of(rng.normal(size=(400, 2)))) for _ in range(400)]
    assert 6 <= sum(rejected) <= 34


def test_each_check_rejects_what_it_is_for():
    white = np.random.default_rng(6).normal(size=(2000, 2))
    by_name = {c.check: c for c in checks_of(1.2 * white)}
    assert [n for n, c in by_name.items() if not c.passed] == ["NIS"]
    assert by_name["NIS"].value > by_name["NIS"].limit[1]
    coloured = white.copy()
    coloured[1:, 1] = (white[1:, 1] + 0.3 * white[:-1, 1]) / np.hypot(1.0, 0.3)
    assert [c.check for c in checks_of(coloured) if not c.passed] == ["whiteness of b"]


def test_what_the_gate_has_left_out_is_in_no_check(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp)
    text = (tmp_path / "data.csv").read_text().splitlines()
    for k in (100, 101, 102, 250, 251, 252):
        t, u, _ = text[k].split(",")
        text[k] = f"{t},{u},9.0"
    (tmp_path / "data.csv").write_text("\n".join(text) + "\n")
    options = Options(gate=5.0, process_std={"x0": 1e-3, "x1": 1e-3})
    result = estimate(file, options=options)
    assert result.consistent, result.doubt
    assert result.innovations["x0"]["rms_over_expected"] == pytest.approx(1.0, abs=0.12)
    assert result.innovations["x0"]["gated_share"] == pytest.approx(6 / 400)


def optimistic(folder, vdp):
    """An oscillator whose sensor is declared 2.5 times better than it is."""
    file = write_vdp(folder, vdp)
    file.write_text(file.read_text().replace("noise_std = 0.05", "noise_std = 0.02"))
    return file


def test_a_number_that_its_own_tests_reject_says_so_everywhere(vdp, tmp_path, capsys):
    options = "[estimate.options]\nprocess_std = {x0 = 1e-3, x1 = 1e-3}\n"
    file = optimistic(tmp_path, vdp)
    file.write_text(file.read_text() + options)
    assert railfmi("estimate", file, "--out", tmp_path / "out") == 1
    said = capsys.readouterr().out
    sentence = (
        r"not consistent with the record: NIS [\d.]+, expected [\d.]+ to [\d.]+.*; "
        "so the standard error is too small"
    )
    assert re.search(sentence, said)
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    assert written["consistent"] is False
    (nis,) = (c for c in written["checks"] if c["check"] == "NIS")
    assert nis["value"] > nis["limit"][1]
    assert nis["passed"] is False
    page = (tmp_path / "out" / "estimate.html").read_text(encoding="utf-8")
    (head,) = re.findall(r"<h1>(.*?)</h1>", page, re.DOTALL)
    assert re.search(sentence, head)
    assert "passes its consistency tests" not in page


def test_a_number_that_passes_its_tests_stands_alone(vdp, tmp_path, capsys):
    file = write_vdp(tmp_path, vdp)
    assert railfmi("estimate", file, "--out", tmp_path / "out") == 0
    assert "not consistent" not in capsys.readouterr().out
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    assert written["consistent"] is True
    assert {c["check"] for c in written["checks"]} == {"NIS", "whiteness of x0"}
    assert "not consistent" not in (tmp_path / "out" / "estimate.html").read_text(encoding="utf-8")


def test_correlated_innovations_are_said_to_be(vdp, tmp_path):
    """An input that the filter is told without its scale leaves a motion in the innovations."""
    file = write_vdp(tmp_path, vdp, text="[estimate.options]\nprocess_std = {x0 = 0.0, x1 = 0.0}\n")
    data = tmp_path / "data.csv"
    rows = np.loadtxt(data, delimiter=",", skiprows=1)
    rows[:, 1] *= 1.5
    np.savetxt(data, rows, delimiter=",", header="t,u,x", comments="")
    result = estimate(file)
    assert not result.consistent
    assert "innovations of x0 correlated in time (p = " in result.doubt


@pytest.mark.slow
def test_a_value_that_the_record_pushed_to_its_bound_says_which(vdp, tmp_path, capsys):
    """True is 0.8, and the bounds leave it out."""
    file = write_vdp(tmp_path, vdp)
    file.write_text(file.read_text().replace("bounds = [0.0, 10.0]", "bounds = [1.2, 10.0]"))
    railfmi("estimate", file, "--out", tmp_path / "out")
    assert re.search(r"mu = 1\.2.* \(at its lower bound\)", capsys.readouterr().out)
    written = json.loads((tmp_path / "out" / "result.json").read_text())
    assert written["estimated"]["mu"]["at_bound"] == "lower"
    (note,) = (n for n in written["notes"] if n.startswith("'mu'"))
    assert note.startswith("'mu' was moved from its start 1.5 to its lower bound 1.2 by the record,")
    assert not any(BELIEVED in n for n in written["notes"])


def test_what_no_data_inform_is_still_at_its_start(vdp, tmp_path):
    text = "parameters.fault = {start = 0.2, std = 0.01, bounds = [0.0, 0.5]}\n"
    result = estimate(write_vdp(tmp_path, vdp, text=text, n=200))
    assert result.estimated["fault"]["value"] == pytest.approx(0.2, abs=1e-3)
    assert f"the record contains no information on 'fault': {BELIEVED}" in result.notes
    assert "at_bound" not in result.estimated["fault"]


def test_what_moved_without_being_informed_is_said_to_have_moved(vdp, tmp_path):
    """A parameter that may wander far in a sample is never known better than it was at first."""
    file = write_vdp(tmp_path, vdp, n=200)
    result = estimate(file, options=Options(walk={"mu": 3.0}, process_std={"x0": 1e-3, "x1": 1e-3}))
    mu = result.estimated["mu"]
    assert mu["informed_by_data"] is False
    assert abs(mu["value"] - 1.5) > 0.1
    (note,) = (n for n in result.notes if "'mu'" in n)
    assert re.match(
        r"the record contains little information on 'mu': \d+% of its start deviation is left, "
        "yet its value moved",
        note,
    )
    assert BELIEVED not in note


def slippery(folder):
    """A record of the rig on rails of little friction, mu0 = 0.1, and an estimate that begins at 0.3."""
    file = write_record(
        folder, "rig", np.random.default_rng(2), duration=12.0, dt=0.01, parameters_true={"mu0": 0.1}
    )
    text = "\n[estimate]\nparameters.mu0 = {start = 0.3, std = 0.1, bounds = [0.02, 0.8]}\n"
    file.write_text(file.read_text() + text)
    return file


@pytest.mark.slow
def test_alarm_levels_are_the_models_and_a_foreign_fmu_has_none(tmp_path, built):
    ours = slippery(tmp_path)
    assert [a.limit for a in estimate(ours).alarms] == ["below 0.15"]
    foreign = ours.with_name("foreign.toml")
    foreign.write_text(ours.read_text().replace('model = "testrig"', f'fmu = "{built("testrig")}"'))
    result = estimate(foreign)
    assert result.estimated["mu0"]["value"] < 0.15
    assert result.alarms == []


def test_an_empty_table_of_alarms_takes_the_models_away(tmp_path):
    assert estimate(slippery(tmp_path), options=Options(alarms={})).alarms == []


def test_every_alarm_level_lies_within_its_variables_limits():
    levels = [
        (v, level)
        for model in MODELS.values()
        for v in declared(model).values()
        for level in (v.alarm_below, v.alarm_above)
        if level is not None
    ]
    assert {v.name for v, _ in levels} == {"mu0"}
    assert all((v.min or -np.inf) < level < (v.max or np.inf) for v, level in levels)


def test_the_headline_of_a_filter_that_passes_is_its_values(tmp_path):
    result = estimate(write_rig(tmp_path, 0))
    assert result.consistent
    assert headline(result).startswith("mu0 = 0.3")
    assert ":" not in headline(result)


def test_a_value_that_is_known_close_to_its_bound_is_not_called_at_it(vdp, tmp_path):
    """True is 0.8, less than 1 % of the width above the lower bound and many standard errors from it."""
    file = write_vdp(tmp_path, vdp, n=1600)
    file.write_text(file.read_text().replace("bounds = [0.0, 10.0]", "bounds = [0.72, 10.0]"))
    result = estimate(file, options=Options(process_std={"x0": 1e-3, "x1": 1e-3}))
    mu = result.estimated["mu"]
    assert 3 * mu["std_error"] < mu["value"] - 0.72 < 0.0928
    assert "at_bound" not in mu
