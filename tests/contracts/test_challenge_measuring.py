"""Ways in which the challenge measures its records: each does to noise, inputs and clocks what it says."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.challenge.draw import Plan, plans
from benchmarks.challenge.make import make
from benchmarks.challenge.match import Answer
from benchmarks.challenge.measuring import EACH, WAYS, Measuring
from benchmarks.challenge.menu import MENU
from benchmarks.challenge.truth import SHARES, SYSTEMS, Item, Truth
from benchmarks.challenge.ways import rows

T = np.arange(12001) * 0.005
CLEAN = {"y": 3.0 * np.sin(2.0 * T)}
NOISE = {"y": 0.2}
INPUTS = {"u": 5.0 * np.sin(T), "v": np.full(len(T), 2.0)}
TEXT = 'id = "a"\n[outputs.y]\nunit = "m"\nnoise_std = 0.2\n[outputs.z]\nnoise_std = 3e-05\n'

COLOURED = ("correlated", "unknown")


def way(name, seed=1):
    """A way with a generator of its own."""
    return WAYS[name](np.random.default_rng(seed))


@pytest.mark.parametrize("name", sorted(set(WAYS) - {"clock"}))
@pytest.mark.parametrize("seed", range(4))
def test_noise_has_the_size_that_is_declared(name, seed):
    error = way(name, seed).outputs(T, CLEAN, NOISE)["y"] - CLEAN["y"]
    slow = 100 if name in COLOURED else 1  # samples that count as one
    assert_allclose(np.mean(error**2), 0.04, rtol=4 * np.sqrt(2 * slow / len(T)))


@pytest.mark.parametrize("name", sorted(set(WAYS) - {"inputs"}))
def test_only_one_way_changes_the_inputs(name):
    found = way(name).inputs(T, INPUTS)
    assert all(found[n] is u for n, u in INPUTS.items())


@pytest.mark.parametrize("seed", range(8))
def test_inputs_get_half_a_percent_to_two_percent_of_noise_all_alike(seed):
    found = way("inputs", seed).inputs(T, INPUTS)
    shares = [np.std(found[n] - u) / np.sqrt(np.mean(u**2)) for n, u in INPUTS.items()]
    assert 0.0049 < min(shares) < max(shares) < 0.0205
    assert_allclose(shares[0], shares[1], rtol=0.05)


@pytest.mark.parametrize("name", COLOURED)
@pytest.mark.parametrize("seed", range(8))
def test_correlated_noise_forgets_within_half_a_second_but_not_at_once(name, seed):
    error = way(name, seed).outputs(T, CLEAN, NOISE)["y"] - CLEAN["y"]
    near, far = (np.mean(error[k:] * error[:-k]) / np.mean(error**2) for k in (1, 600))
    assert near > 0.35
    assert abs(far) < 0.25


@pytest.mark.parametrize("seed", range(8))
def test_rounded_values_lie_on_a_grid_of_no_more_than_six_times_the_noise(seed):
    seen = np.unique(way("quantised", seed).outputs(T, CLEAN, NOISE)["y"])
    step = np.diff(seen).min()
    assert_allclose(seen / step, np.round(seen / step), atol=1e-6)
    assert 0.1 < step < 6 * 0.2


@pytest.mark.parametrize("seed", range(8))
def test_a_clock_is_no_more_than_a_sample_off(seed):
    found = way("clock", seed).outputs(T, CLEAN, {"y": 0.0})["y"]
    rate = 6.0 * np.cos(2.0 * T)
    off = (found - CLEAN["y"]) @ rate / (rate @ rate)
    assert abs(off) < 0.005
    jitter = np.std((found - CLEAN["y"] - off * rate)[np.abs(rate) > 3] / rate[np.abs(rate) > 3])
    assert_allclose(jitter, 0.05 * 0.005, rtol=0.1)


def test_only_what_is_not_declared_is_left_out_of_the_experiment():
    left = 'id = "a"\n[outputs.y]\nunit = "m"\n[outputs.z]\n'
    silent = ("undeclared", "unknown")
    assert all(way(name).said(TEXT) == (left if name in silent else TEXT) for name in WAYS)


def test_a_record_differs_between_ways_by_its_measurement_alone(tmp_path):
    plan = Plan(5, "none", "rig", conditions=("plain",))
    truths, data = [], {}
    for name in WAYS:
        here = replace(plan, way=name)
        truths.append(make(here, 3, tmp_path / name, tmp_path / f"{name}-truth"))
        data[name] = np.genfromtxt(tmp_path / name / plan.name / "data.csv", delimiter=",", names=True)
    assert [replace(t, way="white") for t in truths] == len(WAYS) * truths[:1]
    assert Measuring.name in WAYS
    for name in set(WAYS) - {"inputs"}:
        assert_array_equal(data[name]["T_P"], data[Measuring.name]["T_P"])
    assert np.any(data["inputs"]["T_P"] != data[Measuring.name]["T_P"])


@pytest.mark.parametrize("system", SYSTEMS)
def test_noise_of_the_inputs_counts_where_an_effect_is_compared_with_noise(system, tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.challenge.bench.DURATION", 4.0)
    entry, at = next((e, e.locations[0]) for e in MENU[system] if e.kind == "parameter_offset")
    here, there = (
        make(
            Plan(5, "single", system, ((entry, at),), way=name),
            3,
            tmp_path / name,
            tmp_path / f"{name}-truth",
        )
        for name in ("white", "inputs")
    )
    assert here.noise == there.noise
    assert here.items == there.items
    table = np.genfromtxt(tmp_path / "inputs" / here.name / "data.csv", delimiter=",", names=True)
    exact = np.genfromtxt(tmp_path / "white" / here.name / "data.csv", delimiter=",", names=True)
    assert any(np.any(table[n] != exact[n]) for n in table.dtype.names)
    assert all(0 < there.snr[o] < here.snr[o] for o in here.snr)
    assert 0 < there.left[0] < here.left[0]


def test_a_set_in_each_way_has_the_same_records_and_every_way_as_often():
    white, each = plans(5, 240), plans(5, 240, EACH)
    assert [replace(p, way="white") for p in each] == white
    for group in SHARES:
        often = Counter(p.way for p in each if p.group == group)
        assert set(often) == set(WAYS) - {Measuring.name}
        assert max(often.values()) - min(often.values()) <= 1


def test_answers_are_counted_by_way():
    effect = Item("quadratic_damping", "roller", {"c": 0.3})
    marked = [
        (Truth("a", "none", "rig", way="clock"), Answer("traced", (("free_play", "shaft"),))),
        (Truth("b", "none", "rig", way="inputs"), Answer("no_discrepancy")),
        (
            Truth("c", "single", "rig", (effect,), snr={"w": 5.0}, way="clock"),
            Answer("traced", (effect.pair,)),
        ),
    ]
    assert rows(marked[:1]) == []
    head, _, clock, inputs, every = rows(marked)
    assert head.startswith("| measured | false finds |")
    assert clock.startswith("| clock | 1 of 1 | 0 of 1 | 1 of 1 |")
    assert inputs.startswith("| inputs | 0 of 1 | 0 of 1 | 0 of 0 |")
    assert every.startswith("| all | 1 of 2 | 0 of 2 | 1 of 1 |")
