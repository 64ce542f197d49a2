"""The algebra of a plan: laws of what is visible, of what is told apart, and of what would split it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, ncx2

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.planning.classes import class_of, classed, grouped_by, splitter
from estimator.closeloop.planning.comparison import Comparison, noncentrality
from estimator.closeloop.planning.comparison import Test as Limits
from estimator.closeloop.planning.excitations import changes
from estimator.closeloop.planning.responses import Responses
from estimator.closeloop.planning.sought import Sought
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Unknown

N, OUTPUTS = 400, ("a", "b", "c")
LIMITS = Limits(DEFAULT, 0.8)
seeds = st.integers(0, 10_000)


def candidate(name: str, kind: str = "viscous_damping") -> Candidate:
    return Candidate(kind, name, (Unknown(f"{kind}_{name}_c", 0.0, -np.inf, np.inf, 0.5),))


def shown(columns: np.ndarray, names: list[str], unknowns: int = 1, width: float = np.inf) -> Responses:
    """Responses (N, n_y, K): of the unknowns of the calibration, then of one candidate each."""
    known = tuple(Unknown(f"p{i}", 1.0, 1.0 - width / 2, 1.0 + width / 2, 0.1) for i in range(unknowns))
    prior = np.array([12 / (width / 0.1) ** 2] * unknowns)
    own = {candidate(n): (np.array([unknowns + i]), np.zeros(0, np.intp)) for i, n in enumerate(names)}
    choose = np.arange(len(columns)) % 5 == 4
    values = columns.astype(np.float32)
    parts = {"fit": ~choose, "choose": choose}
    return Responses(OUTPUTS, np.ones(3), known, prior, own, values, parts, 1.0)


def drawn(seed: int, effects: int = 3, unknowns: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((N, 3, unknowns + effects))


def compared(
    responses: Responses, std: float | np.ndarray = 0.1, measured: tuple[int, ...] = (0, 1)
) -> Comparison:
    noise = np.full(3, np.inf)
    noise[list(measured)] = np.broadcast_to(std, 3)[list(measured)]
    return Comparison(responses, noise, LIMITS)


def sights(names: list[str]) -> list[Sought]:
    return [Sought("viscous_damping", n, (candidate(n),)) for n in names]


def smallest(comparison: Comparison, name: str = "x") -> float:
    [seen] = comparison.visible(candidate(name), np.inf)
    return seen.detected


@given(seeds, st.floats(1e-3, 10.0), st.floats(1.1, 50.0))
@settings(max_examples=20, deadline=None)
def test_the_smallest_size_is_in_proportion_to_the_noise(seed: int, std: float, times: float) -> None:
    r = shown(drawn(seed), ["x", "y", "z"])
    assert smallest(compared(r, std * times)) == pytest.approx(times * smallest(compared(r, std)), rel=1e-6)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_twice_the_record_shows_effects_smaller_by_the_root_of_two(seed: int) -> None:
    columns = drawn(seed)
    once, twice = (compared(shown(c, ["x", "y", "z"])) for c in (columns, np.tile(columns, (2, 1, 1))))
    assert smallest(twice) == pytest.approx(smallest(once) / np.sqrt(2), rel=1e-5)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_a_further_sensor_never_hides_an_effect_nor_joins_a_class(seed: int) -> None:
    r = shown(drawn(seed), ["x", "y", "z"])
    two, three = compared(r), compared(r, measured=(0, 1, 2))
    assert smallest(three) <= smallest(two) * (1 + 1e-9)
    some, sizes = sights(["x", "y", "z"]), [0.05] * 3
    score = [c.distances(some, sizes).scores()[0, 1] for c in (two, three)]
    assert np.all(np.isfinite(score))


@given(seeds, st.permutations([0, 1, 2]))
@settings(max_examples=20, deadline=None)
def test_the_order_of_outputs_and_effects_changes_nothing(seed: int, order: list[int]) -> None:
    columns = drawn(seed)
    columns[:, :, 2] = columns[:, :, 1] + 0.02 * columns[:, :, 2]  # y is close to x
    names = ["x", "y", "z"]
    moved = np.concatenate([columns[:, :, :1], columns[:, :, 1:][:, :, order]], axis=2)[:, order]
    std = np.array([0.1, 0.2, np.inf])
    one = Comparison(shown(columns, names), std, LIMITS)
    other = Comparison(shown(moved, [names[i] for i in order]), std[order], LIMITS)
    assert smallest(other) == pytest.approx(smallest(one), rel=1e-6)
    found = [
        {frozenset(m.location for m in c.members) for c in classed(k, sights(n), [0.3] * 3)}
        for k, n in ((one, names), (other, [names[i] for i in order]))
    ]
    assert found[0] == found[1]


@given(seeds, st.floats(0.01, 100.0))
@settings(max_examples=20, deadline=None)
def test_exact_twins_are_one_class_at_any_size_and_nothing_splits_them(seed: int, size: float) -> None:
    columns = drawn(seed)
    columns[:, :, 3] = columns[:, :, 1]
    comparison = compared(shown(columns, ["x", "y", "z"]))
    [pair] = [c for c in classed(comparison, sights(["x", "y", "z"]), [size] * 3) if len(c.members) > 1]
    assert {m.location for m in pair.members} >= {"x", "z"}
    twins = class_of(
        comparison, sights(["x", "z"]), [size] * 2, comparison.distances(sights(["x", "z"]), [size] * 2)
    )
    assert (twins.size, twins.times) == (np.inf, None)
    with_all = compared(comparison.responses, measured=(0, 1, 2))
    assert splitter(twins, with_all, "c").pairs == 0


def test_a_sensor_that_shows_the_difference_splits_a_class() -> None:
    columns = drawn(4)
    columns[:, :2, 2] = columns[:, :2, 1]  # alike in the outputs that are measured
    r = shown(columns, ["x", "y", "z"])
    [pair] = [c for c in classed(compared(r), sights(["x", "y", "z"]), [1.0] * 3) if len(c.members) > 1]
    assert {m.location for m in pair.members} == {"x", "y"}
    found = splitter(pair, compared(r, measured=(0, 1, 2)), "c")
    assert (found.pairs, found.margin > 1) == (1, True)
    assert found.score > 100 * pair.score


def test_the_stated_size_and_duration_are_what_it_takes() -> None:
    columns = drawn(5)
    columns[:, :, 2] = columns[:, :, 1] + 0.02 * columns[:, :, 2]
    r, some = shown(columns, ["x", "y", "z"]), sights(["x", "y"])
    now = compared(r)
    sizes = [1.0, 1.0]
    found = class_of(now, some, sizes, now.distances(some, sizes))
    assert found.margin < 1 < found.size < np.inf
    larger = [found.size * 1.001] * 2
    assert np.min(now.distances(some, larger).margins(now.needed)[0, 1]) >= 1
    assert found.times is not None
    longer = compared(replace(r, samples=found.times, _kept={}))
    assert longer.distances(some, sizes).margins(longer.needed)[0, 1] >= 1
    shorter = compared(replace(r, samples=0.9 * found.times, _kept={}))
    assert shorter.distances(some, sizes).margins(shorter.needed)[0, 1] < 1


def test_what_calibration_makes_up_for_is_not_visible_unless_bounds_hold_it() -> None:
    columns = drawn(6)
    columns[:, :, 1] = columns[:, :, 0]
    assert smallest(compared(shown(columns, ["x", "y", "z"]))) == np.inf
    held = smallest(compared(shown(columns, ["x", "y", "z"], width=0.01)))
    free = smallest(compared(shown(columns, ["x", "y", "z"], unknowns=1, width=0.1)))
    assert held < free < np.inf


@given(seeds)
@settings(max_examples=3, deadline=None)
def test_at_the_stated_size_the_stated_share_of_noise_draws_detects_it(seed: int) -> None:
    r = shown(drawn(seed), ["x", "y", "z"])
    comparison = compared(r)
    steps = smallest(comparison) / 0.5  # in scales
    fit, rng = r.parts["fit"], np.random.default_rng(seed)
    flat = r.values[fit][:, :2].astype(float).reshape(-1, 4) / 0.1
    cal, own = flat[:, :1], flat[:, 1]
    own = own - cal @ np.linalg.lstsq(cal, own, rcond=None)[0]
    along = own / np.linalg.norm(own)
    limit = chi2.isf(LIMITS.false_alarm, 1)
    draws = rng.standard_normal((4000, len(own))) + steps * flat[:, 1]
    share = np.mean((draws @ along) ** 2 > limit)
    assert share == pytest.approx(0.8, abs=0.03)  # four standard errors of 4000 draws


@given(st.floats(1e-6, 0.2), st.floats(0.3, 0.99), st.integers(1, 6))
@settings(max_examples=30, deadline=None)
def test_the_noncentrality_gives_the_power_asked_for(alarm: float, power: float, freedom: int) -> None:
    limit = chi2.isf(alarm, freedom)
    assert ncx2.sf(limit, freedom, noncentrality(alarm, power, freedom)) == pytest.approx(power, rel=1e-6)


def test_classes_hold_pairs_that_are_all_alike() -> None:
    chain = np.array([[0, 0.5, 3.0, 9], [0.5, 0, 0.6, 9], [3.0, 0.6, 0, 9], [9, 9, 9, 0.0]])
    found = [set(at.tolist()) for at in grouped_by(chain)]
    assert found == [{0, 1}, {2}, {3}]


@pytest.mark.parametrize("varies", [True, False])
def test_changes_of_an_input_keep_its_length_and_move_it(varies: bool) -> None:
    s = np.linspace(0, 1, 501)
    u = 3.0 + np.sin(20 * s) * varies
    made = changes(u, s, len(s), 1.0)
    assert ("with its variation doubled" in made) == varies
    for words, changed in made.items():
        assert changed.shape == u.shape, words
        assert np.max(np.abs(changed - u)) > 0.1, words
