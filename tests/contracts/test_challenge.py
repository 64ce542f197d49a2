"""The challenge: the same set from the same seed, blind records, honest matching, a right scoreboard."""

import json
import sys
import threading
import tomllib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from benchmarks.challenge import run as running
from benchmarks.challenge.ablation import ablated, table, variants
from benchmarks.challenge.bench import NO_MORE, bench
from benchmarks.challenge.draw import Plan, counts, plans
from benchmarks.challenge.make import (
    ATTEMPTS,
    effect_of,
    fault_of,
    make,
    settled,
)
from benchmarks.challenge.match import (
    Answer,
    judged,
    named,
    other_names,
)
from benchmarks.challenge.menu import (
    FAULTS,
    MENU,
    OUTPUTS,
    entry,
)
from benchmarks.challenge.run import Challenge, closed
from benchmarks.challenge.score import failures, scoreboard
from benchmarks.challenge.sizes import (
    drawn,
    either,
    flat,
    log,
    wave,
)
from benchmarks.challenge.strange import CONFUSABLE, OUTSIDE
from benchmarks.challenge.table import markdown, text
from benchmarks.challenge.truth import (
    SHARES,
    SYSTEMS,
    Item,
    Truth,
)
from estimator.closeloop.policy import DEFAULT
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import coulomb, looked_at, problem, record, to_and_fro
from tests.truth import wheelset
from tests.truth.wheelset_motion import places as wheelset_places

VOCABULARY = [  # the contract's kinds
    *("constant_force", "step_force", "coulomb_friction", "stribeck_friction", "viscous_damping"),
    *("quadratic_damping", "cubic_stiffness", "bump_stop", "free_play", "hysteresis", "periodic_force"),
    *("harmonic_excitation", "stiffness_change", "damping_change", "parameter_offset", "parameter_step"),
    *("parameter_drift", "actuator_gain", "actuator_lag", "actuator_saturation", "input_delay"),
    "flexible_mode",
]
FAULT_KINDS = ["sensor_bias", "sensor_gain", "sensor_delay", "sensor_drift"]


# what is drawn


def test_the_whole_set_has_the_shares_that_were_asked_for():
    assert counts(240) == {
        "none": 100,
        "single": 60,
        "outside": 30,
        "confusable": 20,
        "sensor": 20,
        "double": 10,
    }
    assert counts(24) == {"none": 10, "single": 6, "outside": 3, "confusable": 2, "sensor": 2, "double": 1}


@given(st.integers(1, 500))
def test_a_smaller_set_keeps_the_shares(count):
    found = counts(count)
    assert sum(found.values()) == count
    assert all(abs(found[g] - count * share / 240) < 1 for g, share in SHARES.items())


def test_a_seed_gives_the_same_set_again_and_another_seed_another():
    assert plans(3, 60) == plans(3, 60)
    assert [p.group for p in plans(3, 60)] != [p.group for p in plans(4, 60)]


def test_the_set_covers_kinds_and_systems_and_hides_the_groups():
    drawn_ = plans(11, 240)
    assert [p.name for p in drawn_] == [f"record-{i:03d}" for i in range(240)]
    by_system = Counter((p.group, p.system) for p in drawn_ if p.group in ("none", "single", "outside"))
    for group in ("none", "single", "outside"):
        shares = [by_system[group, s] for s in SYSTEMS]
        assert max(shares) - min(shares) <= 1
    assert {p.entries[0][0].kind for p in drawn_ if p.group == "single"} >= set(VOCABULARY) - {
        "periodic_force"
    }
    assert {p.entries[0][0].kind for p in drawn_ if p.group == "sensor"} == set(FAULT_KINDS)
    assert {p.note for p in drawn_ if p.group == "confusable"} == {c.note for c in CONFUSABLE}
    assert [p.group for p in drawn_[:100]].count("none") < 60
    for p in drawn_:
        assert len(p.entries) == {"none": 0, "double": 2}.get(p.group, 1)
        assert p.group != "double" or p.entries[0][0].kind != p.entries[1][0].kind


def test_every_kind_of_the_vocabulary_is_on_a_menu_and_no_stranger_is():
    known = {e.kind for menu in MENU.values() for e in menu}
    assert known == set(VOCABULARY)
    assert {e.kind for e in FAULTS} == set(FAULT_KINDS)
    assert not {e.kind for menu in OUTSIDE.values() for e in menu} & known


@given(st.integers(0, 10_000))
def test_sizes_stay_in_their_spreads(seed):
    rng = np.random.default_rng(seed)
    assert 2.0 <= log(2.0, 50.0)(rng) <= 50.0
    assert 2.0 <= abs(either(2.0, 50.0)(rng)) <= 50.0
    assert -3.0 <= flat(-3.0, 1.0)(rng) <= 1.0
    parts = wave(2.0, 50.0, f=flat(1, 2))(rng)
    assert 1.99 <= np.hypot(parts["F_sin"], parts["F_cos"]) <= 50.05
    assert drawn({"x": flat(1, 2)}, np.random.default_rng(seed)) == drawn(
        {"x": flat(1, 2)}, np.random.default_rng(seed)
    )


# what is made


def plan(group, kind="", location="", system="rig", **ranges):
    """A plan with one effect whose parameters are as given."""
    one = entry(kind, location, **{n: (lambda rng, v=v: v) for n, v in ranges.items()})
    return Plan(5, group, system, ((one, location),) if kind else ())


def test_a_record_says_nothing_of_its_truth_and_can_be_made_again(tmp_path):
    asked = plan("single", "quadratic_damping", "roller", c=0.2)
    truth = make(asked, 3, tmp_path / "a" / "records", tmp_path / "a" / "truth")
    again = make(asked, 3, tmp_path / "b" / "records", tmp_path / "b" / "truth")
    assert truth == again == Truth.read(tmp_path / "a" / "truth" / "record-005.json")
    files = [tmp_path / x / "records" / "record-005" for x in "ab"]
    for name in ("experiment.toml", "data.csv"):
        assert (files[0] / name).read_bytes() == (files[1] / name).read_bytes()
    said = (files[0] / "experiment.toml").read_text(encoding="utf-8")
    assert "damping" not in said
    declared = tomllib.loads(said)
    low, high = declared["calibrate"]["mu0"]
    assert low < truth.true["mu0"] < high
    assert declared["split"] == {"identify": [0.0, 36], "test": [36, 60]}
    data = np.genfromtxt(files[0] / "data.csv", delimiter=",", names=True)
    assert len(data) == 12001
    assert declared["outputs"]["omega_w"]["noise_std"] == truth.noise["omega_w"]


def test_what_is_made_is_kept(tmp_path):
    asked = plan("none")
    first = make(asked, 3, tmp_path / "records", tmp_path / "truth")
    (tmp_path / "records" / "record-005" / "data.csv").write_text("untouched", encoding="utf-8")
    assert make(asked, 3, tmp_path / "records", tmp_path / "truth") == first
    assert (tmp_path / "records" / "record-005" / "data.csv").read_text(encoding="utf-8") == "untouched"
    assert first.snr == {}
    assert first.largest_snr == 0.0


def test_the_ratio_of_a_bias_is_its_size_over_the_noise(tmp_path):
    truth = make(plan("sensor", "sensor_bias", "omega_w", bias=7.0), 3, tmp_path / "r", tmp_path / "t")
    assert truth.snr["omega_w"] == pytest.approx(7.0)
    assert truth.snr["omega_r"] == 0.0
    assert truth.items[0].parameters["bias"] == pytest.approx(7.0 * truth.noise["omega_w"])


def test_the_ratio_of_a_small_effect_is_proportional_to_it(tmp_path):
    ratios = [
        make(
            plan("single", "constant_force", "roller", F_0=F), 3, tmp_path / f"r{F}", tmp_path / f"t{F}"
        ).largest_snr
        for F in (5.0, 10.0)
    ]
    assert ratios[1] == pytest.approx(2 * ratios[0], rel=0.02)


def test_two_effects_have_a_ratio_each(tmp_path):
    one, other = (
        plan("single", *pair, **p).entries[0]
        for pair, p in (
            (("constant_force", "roller"), {"F_0": 20.0}),
            (("actuator_gain", "T_P"), {"gain": 0.05}),
        )
    )
    truth = make(Plan(5, "double", "rig", (one, other)), 3, tmp_path / "r", tmp_path / "t")
    assert len(truth.each) == len(truth.left) == 2
    assert min(truth.each) > 0
    assert 0 < truth.left[0] <= truth.each[0] * 1.001
    assert 0 < truth.left[1] <= truth.each[1] * 1.001


@pytest.mark.parametrize(
    ("location", "size", "least", "most"), [("mu0", 5e-3, 0.0, 0.05), ("J_w", 0.5, 0.2, 1.0)]
)
def test_what_is_left_of_a_ratio_is_what_calibration_cannot_make_up_for(
    tmp_path, location, size, least, most
):
    asked = plan("single", "parameter_offset", location, delta=size)
    truth = make(asked, 3, tmp_path / "records", tmp_path / "truth")
    assert location == "mu0" or location not in truth.true
    assert least * truth.largest_snr <= truth.left[0] <= most * truth.largest_snr


def test_sizes_by_the_run_are_settled():
    here = bench("rig", np.random.default_rng(1))
    peak = float(np.abs(here.inputs["T_P"]).max())
    assert settled("actuator_saturation", "T_P", {"limit_share": 0.5}, here) == {"limit": 0.5 * peak}
    assert settled("dead_band", "T_P", {"limit_share": 0.1}, here) == {"band": pytest.approx(0.1 * peak)}
    drift = settled("sensor_drift", "omega_w", {"drift": 60.0}, here)
    assert drift["drift"] == pytest.approx(here.noise["omega_w"])
    fault = fault_of((Item("sensor_gain", "omega_w", {"gain": -0.1}),), "omega_w")
    assert fault.gain == pytest.approx(0.9)


def test_sizes_that_lock_the_wheel_are_drawn_again(tmp_path):
    sizes = iter([2000.0, 10.0])  # N.m on top of the request
    usual = plan("single", "constant_force", "wheel").entries[0][0]
    locks = replace(usual, sizes=lambda rng: {"F_0": next(sizes)})
    truth = make(Plan(5, "single", "rig", ((locks, "wheel"),)), 3, tmp_path / "r", tmp_path / "t")
    assert truth.items[0].parameters["F_0"] == 10.0


def test_what_acts_where_the_record_is_held_out_is_drawn_again(tmp_path):
    moments = iter([50.0, 30.0])  # s, of 60
    usual = plan("single", "step_force", "roller").entries[0][0]
    late = replace(usual, sizes=lambda rng: {"F_0": 20.0, "t0": next(moments)})
    truth = make(Plan(5, "single", "rig", ((late, "roller"),)), 3, tmp_path / "r", tmp_path / "t")
    assert truth.items[0].parameters["t0"] == 30.0


@pytest.mark.slow
def test_a_fault_that_a_sensor_cannot_show_is_drawn_at_the_next_one(tmp_path):
    gains = iter([1e-9] * ATTEMPTS + [0.1])
    usual = plan("single", "constant_force", "wheel").entries[0][0]
    gain = replace(usual, kind="sensor_gain", sizes=lambda rng: {"gain": next(gains)})
    truth = make(Plan(5, "sensor", "rig", ((gain, "omega_r"),)), 3, tmp_path / "r", tmp_path / "t")
    assert truth.items == (Item("sensor_gain", "omega_w", {"gain": 0.1}),)


def test_a_plan_that_never_works_is_refused(tmp_path):
    with pytest.raises(
        ValueError,
        match=rf"{ATTEMPTS} draws of constant_force@wheel failed, the last: .*(steady state|locks)",
    ):
        make(plan("single", "constant_force", "wheel", F_0=2000.0), 3, tmp_path / "r", tmp_path / "t")
    assert not list(tmp_path.rglob("*"))


def test_torque_can_still_be_held_on_the_lowest_friction():
    dry, wet = (bench("rig", np.random.default_rng(1), (), low) for low in (0.0, -0.25))
    assert np.abs(wet.inputs["T_P"]).max() < np.abs(dry.inputs["T_P"]).max()


# when an answer is right

STIFF = {"change": 10.0, "t0": 0.0}
SOFTER = {"change": -0.5, "t0": 0.0}
LATER = {"change": 0.5, "t0": 0.5}
LATE = {"F_0": 900.0, "t0": 0.5}
SAME = [
    ("wheelset", "viscous_damping", "primary_yaw", {"c": 3e4}, "viscous_damping", "wheelset_yaw", {"c": 3e4}),
    ("wheelset", "step_force", "wheelset_lateral", LATE, "step_force", "contact", LATE),
    (
        "wheelset",
        "viscous_damping",
        "primary_lateral",
        {"c": 2e4},
        "damping_change",
        "primary_lateral",
        STIFF,
    ),
    ("vehicle", "damping_change", "secondary_fl", STIFF, "viscous_damping", "secondary_fl", {"c": 1e4}),
    ("vehicle", "stiffness_change", "secondary", SOFTER, "parameter_offset", "k1", {"delta": -2e5}),
    ("vehicle", "damping_change", "secondary", SOFTER, "parameter_offset", "b1", {"delta": -1e4}),
    ("vehicle", "stiffness_change", "primary", SOFTER, "parameter_offset", "k2", {"delta": -2e5}),
    ("vehicle", "damping_change", "primary", LATER, "parameter_step", "b2", {"delta": 5e3, "t0": 0.5}),
    ("wheelset", "stiffness_change", "primary_lateral", SOFTER, "parameter_offset", "k_y", {"delta": -1e5}),
    ("wheelset", "damping_change", "primary_lateral", SOFTER, "parameter_offset", "b_y", {"delta": 1e4}),
    (
        "wheelset",
        "stiffness_change",
        "primary_yaw",
        LATER,
        "parameter_step",
        "k_x",
        {"delta": 1e6, "t0": 0.5},
    ),
    ("wheelset", "damping_change", "primary_yaw", SOFTER, "parameter_offset", "b_x", {"delta": 1e4}),
]


@pytest.fixture
def brief(monkeypatch):
    monkeypatch.setattr("benchmarks.challenge.bench.DURATION", 2.0)


@pytest.mark.parametrize(("system", "kind", "at", "p", "kind2", "at2", "p2"), SAME)
def test_other_names_move_alike(system, kind, at, p, kind2, at2, p2, brief):
    here = bench(system, np.random.default_rng(2))
    sizes = {**p, **p2}
    if "change" in sizes:  # of the same size as the law or as the change of the parameter
        whole = here.true.get(at2) or getattr(wheelset.DECLARED, at2, 0.0)
        sizes["change"] = sizes["c"] / here.strength(at)[1] if "c" in sizes else sizes["delta"] / whole
    one, other = (Item(k, a, {n: sizes[n] for n in own}) for k, a, own in ((kind, at, p), (kind2, at2, p2)))
    assert other.pair in other_names(system, one)
    assert one.pair in other_names(system, other)
    a, b = (here.simulate(effect_of((i,), here), NO_MORE) for i in (one, other))
    sound = here.simulate(NO_MORE, NO_MORE)
    for output, noise in here.noise.items():
        assert np.abs(a[output] - b[output]).max() < 0.05 * noise
    assert max(np.abs(a[o] - sound[o]).max() / noise for o, noise in here.noise.items()) > 1


@pytest.mark.parametrize(
    ("system", "item"),
    [
        ("vehicle", Item("coulomb_friction", "secondary_fl")),
        ("vehicle", Item("damping_change", "primary_fl", {"change": -0.5, "t0": 0.0})),
        ("vehicle", Item("damping_change", "primary_fl", {"change": 0.5, "t0": 9.0})),
        ("wheelset", Item("viscous_damping", "wheelset_lateral")),
        ("rig", Item("constant_force", "wheel")),
        ("rig", Item("viscous_damping", "wheel")),
        ("rig", Item("sensor_gain", "omega_w")),
    ],
    ids=str,
)
def test_what_only_a_record_hides_is_no_other_name(system, item):
    assert other_names(system, item) == {item.pair}


def test_groups_and_members_of_friction_name_each_other():
    step = Item("parameter_step", "friction_condition", {"t0": 20.0})
    assert ("parameter_step", "mu0") in other_names("wheelset", step)
    assert ("parameter_step", "friction_condition") in other_names("wheelset", Item("parameter_step", "k_S"))
    with pytest.raises(ValueError, match="not one of"):
        wheelset_places("friction_condition")


ROLLER = Item("quadratic_damping", "roller", {"c": 0.3})
WHEEL = Item("actuator_gain", "T_P", {"gain": 0.1})
BIAS = Item("sensor_bias", "omega_w", {"bias": 0.1})
STRANGE = Item("impact_train", "wheel", {"F": 300.0})


def truth(group="single", *items, snr=5.0, **more):
    return Truth("record-000", group, "rig", items, snr={"omega_w": snr} if items else {}, **more)


def answer(verdict, *pairs, seconds=10.0, **parameters):
    effects = tuple({"kind": k, "location": p, "parameters": parameters} for k, p in pairs)
    error = {"omega_w": {"declared": 1.0, "before": 0.5, "after": 0.02, "noise": 0.01}}
    return Answer(verdict, tuple(pairs), effects, {"omega_w": 0.98}, error, seconds, seconds)


OTHER = ("coulomb_friction", "wheel")
JUDGED = [
    (truth("none"), answer("no_discrepancy"), "right"),
    (truth("none"), answer("insufficient_excitation"), "right"),
    (truth("none"), answer("traced", OTHER), "wrong"),
    (truth("none"), answer("ambiguous", OTHER), "wrong"),
    (truth("none"), answer("unexplained"), "abstained"),
    (truth("single", ROLLER), answer("traced", ROLLER.pair), "right"),
    (truth("single", ROLLER), answer("ambiguous", OTHER, ROLLER.pair), "right"),
    (truth("single", ROLLER), answer("several", OTHER, ROLLER.pair), "part"),
    (truth("single", ROLLER), answer("traced", OTHER), "wrong"),
    (truth("single", ROLLER), answer("traced", ("quadratic_damping", "wheel")), "wrong"),
    (truth("single", ROLLER), answer("no_discrepancy"), "abstained"),
    (truth("single", ROLLER, quiet=True), answer("no_discrepancy"), "right"),
    (truth("single", ROLLER, quiet=True), answer("unexplained"), "abstained"),
    (truth("sensor", BIAS), answer("sensor_fault", BIAS.pair), "right"),
    (truth("double", ROLLER, WHEEL), answer("several", ROLLER.pair, WHEEL.pair), "right"),
    (truth("double", ROLLER, WHEEL), answer("several", ROLLER.pair, OTHER), "part"),
    (truth("double", ROLLER, WHEEL), answer("traced", ROLLER.pair), "wrong"),
    (truth("double", ROLLER, WHEEL), answer("unexplained"), "abstained"),
    (truth("outside", STRANGE), answer("unexplained"), "right"),
    (truth("outside", STRANGE), answer("no_discrepancy"), "abstained"),
    (truth("outside", STRANGE), answer("traced", OTHER), "wrong"),
    (truth("outside", STRANGE, near=(OTHER,)), answer("traced", OTHER), "part"),
    (truth("outside", STRANGE, near=(OTHER,)), answer("several", OTHER, ROLLER.pair), "wrong"),
    (truth("single", ROLLER), Answer(failure="time limit of 3 s"), "failed"),
]


@pytest.mark.parametrize(("t", "a", "word"), JUDGED)
def test_answers_are_judged(t, a, word):
    assert judged(t, a) == word


def test_each_of_two_effects_is_looked_for():
    assert named(truth("double", ROLLER, WHEEL), [WHEEL.pair, OTHER]) == [False, True]


# the scoreboard


def test_an_answer_is_read_from_what_is_kept():
    kept = {"seconds": 12.0, "cpu_seconds": 20.0, "result": {
        "verdict": "traced", "effects": [{"kind": "a", "location": "b", "parameters": {"c": [1.0, 0.1]}}],
        "gap_closed": {"y": 0.9}, "error": {"y": {"before": 1.0, "noise": 0.1}},
    }}  # fmt: skip
    a = Answer.of(kept)
    assert (a.verdict, a.names, a.seconds, a.cpu_seconds) == ("traced", (("a", "b"),), 12.0, 20.0)
    assert a.label == "traced a@b"
    lost = Answer.of({"seconds": 3.0, "failure": "exit 1: Traceback\nmore"})
    assert lost.label == "exit 1: Traceback"
    assert lost.verdict == ""


def figures(marked):
    return {row.what: row.value for row in scoreboard(marked)}


def test_counts_are_those_of_the_judgements():
    found = figures(
        [
            (truth("none"), answer("no_discrepancy")),
            (truth("none"), answer("traced", OTHER)),
            (truth("none"), answer("unexplained")),
            (truth("single", ROLLER, snr=0.5), answer("no_discrepancy")),
            (truth("single", ROLLER, snr=2.0), answer("ambiguous", OTHER, ROLLER.pair)),
            (truth("single", ROLLER, snr=40.0), answer("traced", ROLLER.pair)),
            (truth("single", ROLLER, snr=50.0), answer("traced", OTHER)),
            (truth("outside", STRANGE), answer("traced", OTHER)),
            (truth("outside", STRANGE), answer("unexplained")),
            (truth("sensor", BIAS), answer("sensor_fault", ("sensor_drift", "omega_w"))),
            (truth("sensor", BIAS), answer("sensor_fault", ("sensor_bias", "omega_r"))),
            (truth("double", ROLLER, WHEEL, each=(2.0, 3.0)), answer("several", ROLLER.pair, WHEEL.pair)),
        ]
    )
    assert found["false finds: an effect named where there is none"] == "1 of 3 (33 %)"
    assert found["unexplained where there is no effect"] == "1 of 3 (33 %)"
    assert found["single effects right, SNR 0.3 to 1"] == "0 of 1 (0 %)"
    assert found["single effects right, SNR 30 and more"] == "1 of 2 (50 %)"
    assert found["single effects right, SNR 1 and more"] == "2 of 3 (67 %)"
    assert found["of these alone in the answer, not in a class"] == "1 of 3 (33 %)"
    assert found["of these first in the answer"] == "1 of 3 (33 %)"
    assert found["single effects with a definite wrong name"] == "1 of 4 (25 %)"
    assert found["outside the vocabulary: definite wrong name"] == "1 of 2 (50 %)"
    assert found["sensor faults recognised, at the right sensor"] == "1 of 2 (50 %)"
    assert found["sensor faults right in kind and sensor, alone or in a class"] == "0 of 2 (0 %)"
    assert found["two of SNR 1 and more each, both named"] == "1 of 1 (100 %)"
    assert found["gap closed where an effect is named, median"] == "98.0%"
    assert found["wall time per record: median, 90 %, longest"] == "10, 10, 10 s"


def test_intervals_cover_by_their_errors():
    """Truths 0, 1.9 and 2.1 standard errors off: two are inside."""
    marked = [
        (truth("single", ROLLER), answer("traced", ROLLER.pair, c=[0.3 + z * 0.01, 0.01], other=[1.0, 0.1]))
        for z in (0.0, 1.9, 2.1)
    ]
    marked.append((truth("single", ROLLER), answer("traced", OTHER, c=[9.0, 0.01])))
    marked.append((truth("single", ROLLER), answer("traced", ROLLER.pair, c=[9.0, float("inf")])))
    assert (
        figures(marked)["95 % intervals of effects' parameters that contain the true value"]
        == "2 of 3 (67 %)"
    )


def test_standard_errors_that_are_right_cover_95_percent():
    rng = np.random.default_rng(1)
    marked = [
        (truth("single", ROLLER), answer("traced", ROLLER.pair, c=[0.3 + 0.02 * rng.normal(), 0.02]))
        for _ in range(2000)
    ]
    text_ = figures(marked)["95 % intervals of effects' parameters that contain the true value"]
    assert_allclose(int(text_.split()[0]) / 2000, 0.95, atol=0.015)  # three standard errors


def test_failures_are_listed_with_truth_and_answer():
    marked = [
        (truth("single", ROLLER, snr=0.1), answer("no_discrepancy")),
        (truth("single", ROLLER), answer("traced", OTHER)),
        (truth("single", ROLLER), answer("traced", ROLLER.pair)),
        (truth("none"), Answer(failure="time limit of 3 s", seconds=3.0)),
    ]
    assert [a.label for _, a in failures(marked)] == ["time limit of 3 s", "traced coulomb_friction@wheel"]
    shown = text(marked, 7, 4)
    assert "seed 7" in shown
    assert "rig: quadratic_damping@roller" in shown
    lines = markdown(marked, 7, 4, every=True).splitlines()
    assert sum(line.startswith("| record-000") for line in lines) == 4
    assert all(line.count("|") in (0, 4, 8) for line in lines)


def test_the_split_of_the_time_is_the_mean_over_answers_that_tell_it():
    marked = [
        (truth("none"), Answer("no_discrepancy", split={"calibrate": 1.0})),
        (truth("none"), Answer("no_discrepancy", split={"calibrate": 2.0, "pairs": 5.0})),
        (truth("none"), Answer(failure="time limit of 3 s", seconds=3.0)),
    ]
    assert figures(marked)["mean wall time of the steps"] == "calibrate 1.5 s, pairs 2.5 s"


# running


def writing(path, content):
    return [sys.executable, "-c", f"import pathlib; pathlib.Path({str(path)!r}).write_text({content!r})"]


def test_a_record_that_is_ended_from_outside_is_no_answer(tmp_path):
    ended = "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"
    with pytest.raises(InterruptedError, match="from outside"):
        closed([sys.executable, "-c", ended], tmp_path / "answer.json", 20.0)


def test_a_record_that_crashes_or_hangs_loses_itself_alone(tmp_path):
    answer_file = tmp_path / "a.json"
    good = closed(writing(answer_file, '{"cpu_seconds": 1.5}'), answer_file, 60.0)
    assert good["cpu_seconds"] == 1.5
    assert "failure" not in good
    crash = closed([sys.executable, "-c", "raise SystemExit('broken')"], answer_file, 60.0)
    assert crash["failure"] == "exit 1: broken\n"
    slow = closed([sys.executable, "-c", "import time; time.sleep(60)"], answer_file, 0.2)
    assert slow["failure"] == "time limit of 0.2 s"


def test_a_stopped_run_keeps_no_answer(tmp_path):
    stop = threading.Event()
    stop.set()
    with pytest.raises(InterruptedError):
        closed([sys.executable, "-c", "import time; time.sleep(60)"], tmp_path / "a.json", 60.0, stop)


@pytest.mark.slow
def test_a_run_goes_on_where_it_stopped(tmp_path, monkeypatch):
    result = json.dumps(
        {"result": {"verdict": "no_discrepancy", "effects": [], "gap_closed": {}, "error": {}}}
    )
    asked = []

    def command(self, record, part):
        asked.append(record.name)
        return writing(part, result)

    monkeypatch.setattr(Challenge, "command", command)
    challenge, chosen = Challenge(tmp_path, 3), [p for p in plans(3, 6) if p.system == "rig"]
    told = []
    first = running.run(challenge, chosen[:1], 1, told.append)
    both = running.run(challenge, chosen, 2, told.append)
    assert asked == [p.name for p in chosen]
    assert both[0] == first[0]
    assert [t.name for t, _ in both] == asked
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.slow
def test_the_chain_answers_a_record_from_end_to_end(tmp_path):
    challenge = Challenge(tmp_path, 3, limit=900.0, cores=1)
    loud = replace(plan("single", "quadratic_damping", "roller", c=0.3), index=6)
    marked = [(t, Answer.of(kept)) for t, kept in running.run(challenge, [plan("none"), loud], 1)]
    assert [judged(t, a) for t, a in marked] == ["right", "right"]
    assert figures(marked)["no answer (crash or time limit)"] == "0 of 2 (0 %)"


def test_outputs_of_the_menu_are_those_of_the_benches():
    for system in ("rig", "wheelset"):
        assert tuple(bench(system, np.random.default_rng(1)).noise) == OUTPUTS[system]


# ---- ablation


def test_every_policy_of_the_ablation_has_one_other_limit():
    versions = [policy.version for _, _, policy in variants()]
    assert DEFAULT.version not in versions
    assert len({(name, how) for name, how, _ in variants()}) == len(versions)


@pytest.mark.slow
def test_the_ablation_judges_by_the_default_as_the_chain_did(tmp_path):
    asked = problem(ModelBuilder("drive", tmp_path), record(to_and_fro(2.0), coulomb(40.0), 1))
    found = looked_at("one", asked, ("coulomb_friction",)).found
    answers = ablated(found)
    assert found.judgement.verdict == "traced"
    assert answers["default"][""] == ("traced", [("coulomb_friction", "carriage")])
    assert answers["detection.level"]["0"][0] == "no_discrepancy"
    assert answers["decision.significant"]["no end"][0] == "unexplained"
    there = truth("single", Item("coulomb_friction", "carriage"))
    rows = {line.split("`")[1]: line for line in table([(there, answers)], 7).splitlines() if "`" in line}
    assert rows.keys() == answers.keys() - {"default"}
    assert "right to abstained: 1" in rows["decision.significant"]
    assert "right" not in rows["decision.open_alike"]
