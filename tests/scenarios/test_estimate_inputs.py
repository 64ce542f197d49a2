"""White noise of the recorded inputs in `railfmi estimate`, on records of the rig's truth model."""

import json

import numpy as np
import pytest

from estimator.filters.sensor_noise import SensorNoise
from fmus import aside
from scenarios.estimating import setup
from scenarios.estimating.estimating import estimate
from scenarios.estimating.policy import POLICY
from tests.scenarios.test_estimate_noise import noisy
from tests.truth import rig

ASKED = "\n[estimate]\nparameters.mu0 = {start = 0.4, std = 0.1, bounds = [0.05, 0.8]}\n"
LEVEL = 0.01  # of an input's root mean square
TRUE = 0.36
SETTLED = 5.0  # s


@pytest.fixture
def record(tmp_path, monkeypatch):
    """Makes an experiment; returns its file and the true speeds (N, 2)."""

    def made(seed, columns, duration=25.0):
        true = []
        simulate = rig.simulate
        monkeypatch.setattr(rig, "simulate", lambda *of: true.append(simulate(*of)) or true[-1])
        rng, truth = np.random.default_rng(seed), {"mu0": TRUE}
        file = rig.write_record(tmp_path, "rig", rng, duration=duration, dt=0.01, parameters_true=truth)
        file.write_text(file.read_text() + ASKED)
        names = file.with_name("data.csv").read_text().split("\n", 1)[0].split(",")
        rows = np.loadtxt(file.with_name("data.csv"), delimiter=",", skiprows=1)
        size = {c: LEVEL * np.sqrt(np.mean(rows[:, names.index(c)] ** 2)) for c in columns}
        errors = {c: SensorNoise(c, std) for c, std in size.items()}
        return noisy(file, errors, 100 + seed), np.transpose(true[0]), size

    return made


def held(folder, true):
    """Share of the time in which each speed is within its 95 % band."""
    rows = np.genfromtxt(folder / "estimate.csv", delimiter=",", names=True)
    late = rows["time"] > SETTLED
    return [
        np.mean(np.abs(rows[n] - true[:, j])[late] < setup.BAND * rows[f"{n}_std"][late])
        for j, n in enumerate(("omega_w", "omega_r"))
    ]


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_of_the_inputs_is_found_and_counted_with(record, tmp_path, monkeypatch, seed):
    """Without it, the filter takes for friction what noise of the torque and the frequency did."""
    file, true, size = record(seed, ("T_P", "f_sync"))
    result = estimate(file, tmp_path / "out")
    assert result.consistent
    assert result.input_noise == pytest.approx(size, rel=0.2)
    assert min(held(tmp_path / "out", true)) > 0.9
    mu0 = result.estimated["mu0"]
    assert mu0["value"] == pytest.approx(TRUE, abs=3 * mu0["std_error"])
    assert sum("has white noise" in note for note in result.notes) == 2
    assert {e["unit"] for n, e in result.estimated.items() if n.startswith("T_P")} == {"N.m"}
    assert json.loads((tmp_path / "out" / "result.json").read_text())["input_noise"] == result.input_noise
    assert not any("_error" in line for line in result.lines())
    monkeypatch.setattr(setup, "possible_errors", lambda *_: ())
    assert not estimate(file).consistent


def test_declared_noise_counts_in_a_record_that_is_too_short_for_a_spectrum(record):
    file, _, size = record(4, ("T_P", "f_sync"), duration=10.0)
    taken_for_exact = estimate(file)
    assert taken_for_exact.input_noise == {}
    text = file.read_text()
    for name, std in size.items():
        text = text.replace(f'{name} = "{name}"', f'{name} = {{column = "{name}", noise_std = {std:.6g}}}')
    file.write_text(text)
    result = estimate(file)
    assert result.consistent > taken_for_exact.consistent
    assert result.input_noise == pytest.approx(size, rel=1e-4)
    assert not any("by its spectrum" in note for note in result.notes)


def test_inputs_without_noise_are_taken_as_they_are(record, tmp_path):
    """A speed that is measured is not said to be surer than the simulation is."""
    file, true, _ = record(3, ())
    result = estimate(file, tmp_path / "out")
    assert result.input_noise == {}
    assert min(held(tmp_path / "out", true)) > 0.95
    least = POLICY.told_apart * rig.NOISE
    assert min(result.estimated[n]["std_error"] for n in ("omega_w", "omega_r")) >= least


def test_a_long_record_whose_history_lies_in_files_gives_the_same_errors(record, monkeypatch):
    file, *_ = record(3, ())
    short = estimate(file)
    monkeypatch.setattr(aside, "BLOCK", 1 << 15)
    assert estimate(file).estimated == short.estimated
