"""The challenge counts what is right of the answers that are said with a probability."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.challenge.match import Answer
from benchmarks.challenge.reliability import bins, diagram, rows, stated
from benchmarks.challenge.truth import Item, Truth

DRAG, LAG = ("viscous_damping", "roller"), ("actuator_lag", "T_P")


def truth(*items: Item) -> Truth:
    return Truth("record-000", "single" if items else "none", "rig", items, snr={str(i): 5.0 for i in items})


def answer(verdict: str, said: dict[str, float], *names: tuple[str, str]) -> Answer:
    return Answer(verdict, names, probability=said)


@pytest.mark.parametrize(
    ("a", "p"),
    [
        (answer("traced", {"viscous_damping@roller": 0.9, "viscous_damping@wheel": 0.05}, DRAG), 0.9),
        (answer("ambiguous", {"viscous_damping@roller": 0.6, "actuator_lag@T_P": 0.3}, DRAG, LAG), 0.9),
        (answer("several", {"actuator_lag@T_P + viscous_damping@roller": 0.8}, DRAG, LAG), 0.8),
        (answer("no_discrepancy", {"no_discrepancy": 0.7}), 0.7),
        (answer("unexplained", {"viscous_damping@roller": 0.3}), 0.7),
        (answer("unexplained", {}), 1.0),
        (answer("sensor_fault", {}), None),
    ],
)
def test_an_answer_has_the_probability_of_what_it_says(a, p):
    assert stated(a) == (p if p is None else pytest.approx(p))


@given(st.integers(0, 2**32 - 1), st.integers(1, 300))
def test_every_answer_is_in_one_bin_and_right_answers_are_counted(seed, n):
    rng = np.random.default_rng(seed)
    said = [*rng.random(n - 1), 1.0]
    right = rng.random(n) < said
    drag = Item(*DRAG)
    marked = [
        (truth(drag), answer("traced", {f"{DRAG[0]}@{DRAG[1]}": p}, DRAG))
        if ok
        else (truth(), answer("traced", {f"{DRAG[0]}@{DRAG[1]}": p}, DRAG))
        for p, ok in zip(said, right, strict=True)
    ]
    found = bins(marked)
    assert sum(b.number for b in found) == n
    assert sum(b.right for b in found) == right.sum()
    assert all(b.low <= b.said <= b.high for b in found)
    assert all(b.interval[0] <= b.right / b.number <= b.interval[1] for b in found)
    assert len(rows(marked)) == len(found) + 2


def test_answers_without_probabilities_make_no_table(tmp_path: Path):
    assert rows([(truth(), answer("no_discrepancy", {}))]) == []
    diagram([(truth(), answer("no_discrepancy", {}))], tmp_path / "empty.svg")
    assert "svg" in (tmp_path / "empty.svg").read_text()
