"""Drift, change points and deviations: errors hold as often as they say, and nothing is found in nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.fleet.drift import Points, change_in, courses, line_through
from scenarios.fleet.findings import findings_of
from scenarios.fleet.repeats import Scatter
from scenarios.fleet.rows import SCHEMA
from scenarios.fleet.scatter import excess, mean_over, weighted_median

STD = 0.01
TRIALS = 300


def points(rng, n=10, slope=0.0, jump=0.0, at=5000.0, scatter=0.0, level=0.4) -> Points:
    """Values of a vehicle over 10 000 km, with standard errors between half and twice STD."""
    mileage = np.sort(rng.uniform(0, 1e4, n))
    std = STD * rng.uniform(0.5, 2.0, n)
    noise = rng.normal(0, np.hypot(std, scatter))
    return Points(mileage, level + slope * mileage + jump * (mileage > at) + noise, std)


def fleet(rng, vehicles=20, **more) -> list[Points]:
    return [points(rng, **more) for _ in range(vehicles)]


@given(st.floats(-10, 10), st.floats(-1e-3, 1e-3), st.integers(0, 99))
def test_a_line_without_noise_is_found_exactly(level, slope, seed):
    rng = np.random.default_rng(seed)
    p = points(rng)
    exact = Points(p.mileage, level + slope * p.mileage, p.std)
    found = line_through(exact, Scatter())
    assert found.slope == pytest.approx(slope, abs=1e-12)
    assert found.squares == pytest.approx(0.0, abs=1e-9)


@given(st.floats(-5, 5), st.floats(0.1, 10), st.integers(0, 99))
def test_units_and_origin_change_nothing_but_the_numbers(shift, scale, seed):
    p = points(np.random.default_rng(seed), jump=0.05)
    moved = Points(p.mileage, shift + scale * p.value, scale * p.std)
    a, b = change_in(p, Scatter(known=100.0)), change_in(moved, Scatter(known=100.0))
    assert a is not None
    assert b is not None
    assert b.at == a.at
    assert b.size == pytest.approx(scale * a.size, rel=1e-6, abs=1e-9)
    assert b.p_value == pytest.approx(a.p_value, rel=1e-6, abs=1e-12)


def test_the_interval_of_a_slope_holds_as_often_as_it_says():
    rng, slope = np.random.default_rng(1), 3e-6
    held = [
        c.low <= slope <= c.high
        for _ in range(TRIALS // 10)
        for c in courses(fleet(rng, 10, slope=slope, scatter=0.02))
    ]
    # 3 standard deviations of 300 trials about 95 %, the class in common, and what is not known of it
    assert 0.92 <= np.mean(held) <= 0.99


def test_the_interval_of_a_change_holds_the_place_and_the_size():
    rng, jump = np.random.default_rng(2), 0.03
    places, sizes = [], []
    for _ in range(TRIALS):
        found = change_in(points(rng, 12, jump=jump), Scatter())
        assert found is not None
        places.append(found.low <= 5000.0 <= found.high)
        sizes.append(found.size_low <= jump <= found.size_high)
    assert np.mean(places) >= 0.92
    assert np.mean(sizes) >= 0.92


def test_nothing_is_found_in_nothing():
    """The p value of line and change together is at most as small as it says."""
    rng = np.random.default_rng(3)
    p = np.array([c.p_value for _ in range(15) for c in courses(fleet(rng))])
    for level in (0.01, 0.05, 0.2):
        assert np.mean(p < level) <= level + 3 * np.sqrt(level / len(p))


def test_scatter_of_repeated_records_is_in_the_errors():
    rng = np.random.default_rng(4)
    quiet, loud = courses(fleet(rng, 40)), courses(fleet(rng, 40, scatter=0.05))
    assert quiet[0].scatter < 0.3 * STD
    assert loud[0].scatter == pytest.approx(0.05, rel=0.25)
    assert loud[0].line.std > 3 * quiet[0].line.std


def test_odd_vehicles_do_not_raise_the_scatter_of_the_class():
    rng = np.random.default_rng(5)
    series = fleet(rng, 18) + fleet(rng, 2, jump=1.0)
    found = courses(series)
    assert found[0].scatter < STD
    assert [c.form for c in found[-2:]] == ["change", "change"]
    assert max(c.p_value for c in found[-2:]) < 1e-6


def test_a_drift_is_a_line_and_a_step_a_change():
    rng = np.random.default_rng(6)
    found = courses([*fleet(rng, 20), points(rng, slope=2e-5), points(rng, jump=0.2)])
    assert found[-2].form == "line"
    assert found[-1].form == "change"
    assert found[-2].low < 2e-5 < found[-2].high


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=30))
def test_a_weighted_median_of_equal_weights_is_the_median(values):
    v = np.array(values)
    assert weighted_median(v, np.ones(len(v))) == pytest.approx(float(np.median(v)), abs=1e-9)


def test_no_scatter_is_found_where_the_errors_say_all():
    freedom = np.array([3.0, 4.0])
    assert excess(lambda tau: np.array([1.0, 2.0]) / (1 + tau), freedom, 0.1) == 0.0


def test_the_mean_of_a_class_contains_its_spread():
    rng = np.random.default_rng(7)
    held = []
    for _ in range(TRIALS):
        values = rng.normal(1.0, 0.1, 15) + rng.normal(0, STD, 15)
        m = mean_over(values.tolist(), [STD] * 15)
        held.append(abs(m.value - 1.0) < 2.145 * m.std)  # t with 14 degrees of freedom
    assert 0.9 <= np.mean(held) <= 0.99
    assert mean_over([1.0], [0.1]).std == pytest.approx(0.1)


def rows_of(values: dict[str, list[tuple[float, float]]], **more) -> list[dict]:
    """Rows of an estimated parameter, (mileage, value) by vehicle."""
    blank = {f.name: None if f.type == "double" else "" for f in SCHEMA}
    fixed = {"command": "estimate", "verdict": "consistent", "kind": "parameter", "location": "mu0"}
    return [
        {**blank, **fixed, "parameter": "mu0", "vehicle": v, "mileage": m, "size": x, "std": STD, **more}
        for v, entries in values.items()
        for m, x in entries
    ]


def made(rng, vehicles: int, odd: float = 0.0, slope: float = 0.0) -> dict[str, list[tuple[float, float]]]:
    """Vehicles with a spread of 0.02, the first of which is `odd` further or drifts."""
    found = {}
    for k in range(vehicles):
        level = 0.4 + rng.normal(0, 0.02) + (odd if k == 0 else 0.0)
        miles = np.sort(rng.uniform(0, 1e4, 8))
        drift = slope * miles if k == 0 else 0.0
        found[f"v{k}"] = [*zip(miles.tolist(), (level + drift + rng.normal(0, STD, 8)).tolist(), strict=True)]
    return found


def named_in(rng, odd: float) -> list[str]:
    """The vehicles of a class of 30 that are said to deviate."""
    return [x.vehicle for x in findings_of(rows_of(made(rng, 30, odd)), 0.05).levels if x.deviates]


def test_who_deviates_from_the_class_is_found():
    rng = np.random.default_rng(8)
    named = [named_in(rng, odd=0.2) for _ in range(20)]
    assert all("v0" in some for some in named)
    assert sum(map(len, named)) <= 1.2 * len(named)


@pytest.mark.slow
def test_nobody_deviates_in_a_class_without_odd_vehicles():
    rng, classes, level = np.random.default_rng(13), 60, 0.05
    false = np.mean([bool(named_in(rng, odd=0.0)) for _ in range(classes)])
    assert false <= level + 3 * np.sqrt(level * (1 - level) / classes)


def test_a_drifting_vehicle_is_found_and_nobody_else():
    found = findings_of(rows_of(made(np.random.default_rng(9), 30, slope=2e-5)), 0.05)
    assert [d.vehicle for d in found.drifts if d.drifts] == ["v0"]


def test_failed_and_diverged_records_say_nothing():
    rows = rows_of(made(np.random.default_rng(10), 5))
    for verdict in ("failed", "diverged"):
        assert findings_of([{**row, "verdict": verdict} for row in rows], 0.05).levels == []


def test_a_class_of_few_vehicles_has_nobody_who_deviates():
    found = findings_of(rows_of(made(np.random.default_rng(11), 3, odd=1.0)), 0.05)
    assert [x.p_value for x in found.levels] == [None] * 3
    assert not any(x.deviates for x in found.levels)


def test_classes_are_kept_apart():
    rng = np.random.default_rng(12)
    rows = rows_of(made(rng, 10), **{"class": "tram"})
    rows += rows_of({f"w{v}": x for v, x in made(rng, 10).items()}, **{"class": "metro"}, place="depot")
    levels = findings_of(rows, 0.05).levels
    assert {x.of_class.groups for x in levels} == {10}
