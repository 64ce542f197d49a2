"""The room for results of simulations stays within its bound and gives what was put there, nothing else."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.kept import KEPT, KEY, OF_ALL, Kept, bits, digest
from estimator.record import Run

KEYS = st.integers(0, 9)


@settings(max_examples=200)
@given(st.lists(st.tuples(KEYS, st.integers(1, 60), st.booleans())))
def test_memory_stays_within_its_bound_and_results_are_those_that_were_put(steps):
    kept, put = Kept(4 * KEY), {}
    for key, n, asks in steps:
        if asks:
            found = kept.get(key, ("y",))
            assert found is None or np.array_equal(found, put[key])
        else:
            there = kept.get(key, ("y",)) is not None
            kept.put(key, ("y",), np.full((n, 1), float(n)))
            if not there and kept.room_for(8 * n):
                put[key] = np.full((n, 1), float(n))
                assert kept.get(key, ("y",)) is not None
        held = [result for _, result in kept._found.values()]
        assert kept.size == sum(r.nbytes + KEY for r in held) <= kept.most


def test_what_was_not_asked_for_longest_goes_first():
    one = np.zeros((KEY // 8, 1))
    kept = Kept(2 * OF_ALL * KEY)  # of results with their keys, as many as a long one takes parts
    for key in range(OF_ALL):
        kept.put(key, ("y",), one)
    kept.get(0, ("y",))
    kept.put("new", ("y",), one)
    assert [key for key in (*range(OF_ALL), "new") if kept.get(key, ("y",)) is None] == [1]


def test_a_long_result_is_not_kept():
    kept = Kept()
    long = np.zeros((KEPT // OF_ALL // 8, 1))
    kept.put("long", ("y",), long)
    assert kept.get("long", ("y",)) is None
    assert kept.size == 0
    kept.put("fits", ("y",), long[: -KEY // 8])
    assert kept.get("fits", ("y",)) is not None
    assert kept.size == KEPT // OF_ALL


def test_the_sign_of_zero_and_a_missing_value_are_told_apart():
    assert bits({"a": 0.0}) != bits({"a": -0.0})
    assert bits({"a": np.nan}) == bits({"a": np.nan})
    assert bits({"a": 1.0}) != bits({"b": 1.0})
    every = np.ones(4, bool)
    flat = Run(np.zeros(4), np.zeros((4, 2)), np.zeros((4, 1)), every, ~every, ~every)
    assert digest(flat) != digest(replace(flat, u=np.zeros((4, 1))))
    assert digest(flat) != digest(replace(flat, u=-np.zeros((4, 2))))
