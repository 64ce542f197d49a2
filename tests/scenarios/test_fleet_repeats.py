"""Scatter of repeated records: what was put in is found, and rough or slow vehicles are not named for it."""

from itertools import chain

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import false_discovery_control

from scenarios.fleet.drift import Points, courses
from scenarios.fleet.findings import findings_of, of_the_record
from scenarios.fleet.pooling import _mean_size
from scenarios.fleet.repeats import Repeats, Scatter, _expected, scatter_of, variance_of
from tests.scenarios.test_fleet_statistics import STD, made, rows_of

SCATTER = 0.02
MANY = 200  # vehicles


def correlated(rng, n: int, correlation: float) -> np.ndarray:
    """Successive values of unit variance with this correlation, (n,)."""
    e = rng.normal(size=n)
    for k in range(1, n):
        e[k] = correlation * e[k - 1] + np.sqrt(1 - correlation**2) * e[k]
    return e


def sound(rng, n=8, correlation=0.0, rough=1.0) -> Points:
    """A vehicle without drift; rough: its variance over that of the class."""
    mileage, std = np.sort(rng.uniform(0, 1e4, n)), STD * rng.uniform(0.5, 2.0, n)
    noise = np.sqrt(rough) * np.hypot(std, SCATTER) * correlated(rng, n, correlation)
    return Points(mileage, 0.4 + noise, std)


def sound_class(rng, vehicles=MANY, freedom=np.inf, **more) -> list[Points]:
    """freedom: of the inverse chi-square distribution of the vehicles' variances; inf: all alike."""
    rough = freedom / rng.chisquare(freedom, vehicles) if np.isfinite(freedom) else np.ones(vehicles)
    return [sound(rng, rough=x, **more) for x in rough]


@given(
    st.lists(st.floats(-3, 3), min_size=1, max_size=12), st.floats(0, 0.99)
)  # fmt: skip
def test_the_variance_of_a_sum_is_the_quadratic_form_of_its_correlations(parts, correlation):
    a = np.array(parts)
    R = correlation ** np.abs(np.subtract.outer(np.arange(len(a)), np.arange(len(a))))
    exact = [a[: k + 1] @ R[: k + 1, : k + 1] @ a[: k + 1] for k in range(len(a))]
    np.testing.assert_allclose(variance_of(a, correlation), exact, rtol=1e-9, atol=1e-9)


@given(st.integers(4, 12), st.floats(0, 0.95), st.integers(0, 99))
def test_expected_products_of_residuals_are_those_of_the_projection(n, correlation, seed):
    rng = np.random.default_rng(seed)
    basis, _ = np.linalg.qr(np.column_stack([np.ones(n), rng.normal(size=n)]))
    M = np.eye(n) - basis @ basis.T
    V = M @ correlation ** np.abs(np.subtract.outer(np.arange(n), np.arange(n))) @ M
    products, squares = (np.polyval(c[::-1], correlation) for c in _expected(basis))
    assert products == pytest.approx(np.trace(V, 1), abs=1e-9)
    assert squares == pytest.approx(np.trace(V), abs=1e-9)


@pytest.mark.parametrize(("correlation", "freedom"), [(0.0, np.inf), (0.5, np.inf), (0.0, 6.0)])
def test_what_a_class_scatters_by_is_found(correlation, freedom):
    some = sound_class(np.random.default_rng(1), freedom=freedom, correlation=correlation)
    found = scatter_of([p.about_a_line for p in some])
    assert found.beyond == pytest.approx(SCATTER, rel=0.25)
    assert found.correlation == pytest.approx(correlation, abs=0.15)
    if not correlation:  # sums of squares of correlated records differ more
        assert (found.lent < 20) == (freedom < 20)
    assert (found.usual < 1) == np.isfinite(found.lent)


def test_a_class_without_repeated_records_has_no_scatter():
    one = Repeats(np.array([1.0]), np.array([0.1]), np.ones((1, 1)))
    assert scatter_of([one, one]) == Scatter()
    assert Scatter().freedom(3) == float("inf")
    assert Scatter(lent=4.0, known=10.0).freedom(6) == pytest.approx(5.0)


def test_the_own_scatter_of_a_vehicle_counts_by_what_the_class_lends():
    alike, unequal = Scatter(), Scatter(lent=4.0, usual=0.9)
    assert alike.scale(100.0, 6) == 1.0
    assert unequal.scale(100.0, 6) == pytest.approx((4 * 0.9 + 100) / 10)


@pytest.mark.parametrize(
    ("correlation", "freedom", "records", "times"),
    [(0.0, np.inf, 8, 1), (0.0, 6.0, 8, 1), (0.5, np.inf, 8, 1), (0.5, 6.0, 8, 2), (0.0, 6.0, 4, 1)],
    ids=["alike", "rough ones", "slow", "slow and rough", "few records"],
)
def test_sound_vehicles_are_not_named_because_they_are_rough_or_slow(correlation, freedom, records, times):
    """With one scatter for all and independent records, 3 to 15 times as many had p below 0.01 as should.

    times: as many as should; where both come together the correlation is found too small.
    """
    rng, level = np.random.default_rng(2), 0.01
    some = (sound_class(rng, n=records, freedom=freedom, correlation=correlation) for _ in range(3))
    p = np.array([c.p_value for c in chain.from_iterable(courses(x) for x in some)])
    assert np.mean(p < level) <= times * level + 3 * np.sqrt(times * level / len(p))
    assert p.min() > 1e-3 / len(p)  # one fleet in a thousand


def test_drifts_are_found_in_a_class_that_is_rough_and_slow():
    rng = np.random.default_rng(3)
    some = sound_class(rng, freedom=8.0, correlation=0.3)
    for k in range(10):
        p = some[k]
        some[k] = Points(p.mileage, p.value + 5e-5 * p.mileage, p.std)
    p = np.array([c.p_value for c in courses(some)])
    named = np.flatnonzero(false_discovery_control(p) < 0.05)
    assert len({*named.tolist()} & {*range(10)}) >= 9
    assert len(named) <= 12


def test_one_rate_of_false_names_holds_over_courses_and_deviations_together():
    rows = rows_of(made(np.random.default_rng(4), 20))
    found = findings_of(rows, 0.05)
    p = [*(d.course.p_value for d in found.drifts), *(x.p_value for x in found.levels)]
    q = [*(d.q_value for d in found.drifts), *(x.q_value for x in found.levels)]
    np.testing.assert_allclose(q, false_discovery_control(p))


def test_many_estimates_with_one_belief_do_not_count_it_as_often():
    """Each record says little: its estimate is the weighted mean of the belief and what was measured."""
    rng, start, believed, error, true = np.random.default_rng(5), 0.4, 0.05, 0.05, 0.46
    measured = rng.normal(true, error, 400)
    std = (believed**-2 + error**-2) ** -0.5
    leaning = std**2 * (start / believed**2 + measured / error**2)
    rows = [
        of_the_record({"size": x, "std": std, "prior": start, "prior_std": believed}) for x in leaning
    ]  # fmt: skip
    np.testing.assert_allclose([r["size"] for r in rows], measured)
    np.testing.assert_allclose([r["std"] for r in rows], error)
    values = [(1.0, x) for x in leaning]
    more = {"prior": start, "prior_std": believed, "std": std}
    found = findings_of([{**r, **more} for r in rows_of({"v": values, "w": values})], 0.05)
    assert abs(found.levels[0].value - true) < 3 * found.levels[0].std
    assert abs(np.mean(leaning) - true) > 5 * std / np.sqrt(len(leaning))  # as it was


@pytest.mark.parametrize("more", [{"held": "at a bound"}, {"prior": 0.4, "prior_std": 1.05 * STD}])
def test_what_a_record_does_not_say_is_not_followed(more):
    rows = [{**r, **more} for r in rows_of(made(np.random.default_rng(6), 5))]
    assert findings_of(rows, 0.05).levels == []


def test_records_of_one_vehicle_are_no_independent_sizes_of_an_effect():
    one = [{"size": 0.5 + 0.001 * k, "std": 0.01} for k in range(20)]
    other = [{"size": 0.9, "std": 0.01}]
    found = _mean_size([one, other])
    assert found.groups == 2
    assert found.value == pytest.approx(0.7, abs=0.02)
    assert found.std > 0.15  # of 21 independent sizes it would be below 0.05
