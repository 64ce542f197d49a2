"""The test of a stream: its statistics, its rate of false alarms, and that cuts change nothing."""

from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.watching.false_alarms import autoregression, false_alarms, heavy_tails
from estimator.filters.history import History
from estimator.monitoring.blocks import block_statistics, statistics
from estimator.monitoring.cusum import mean_run, threshold
from estimator.monitoring.monitor import KEPT, Monitor, Settings
from estimator.monitoring.policy import POLICY
from estimator.monitoring.reference import Reference, correlation, learned
from fmus import codec

SETTINGS = Settings(false_alarms_per_hour=1.0, block=0.1, learn=5.0, settle=0.2, quiet=1.0)


class Fixed:
    """One effect, seen in both outputs alike, or in neither."""

    names = ("an effect",)

    def __init__(self, direction=(0.6, 0.8)):
        self.direction = np.array([direction])

    def at(self, x, u, t):
        return self.direction


def history(innovation, dt=0.01, t0=0.0):
    """The results of a filter with these innovations (n, 2) over their standard deviations."""
    n = len(innovation)
    there = np.isfinite(innovation)
    return History(
        ("x",), t0 + dt * np.arange(1, n + 1), np.zeros((n, 1)), np.ones((n, 1)), innovation,
        np.nansum(innovation**2, axis=1), there.sum(axis=1).astype(float), np.zeros((n, 2), bool),
        np.zeros(n), None, "",
    )  # fmt: skip


def test_statistics_of_white_innovations_are_standard_normal():
    rng = np.random.default_rng(1)
    direction = np.array([[0.6, 0.8]])
    rows = []
    for _ in range(2000):
        e = rng.normal(size=(50, 2))
        rows.append(block_statistics(e, (e**2).sum(axis=1), np.full(50, 2.0), direction))
    found = np.array(rows)
    assert found.shape[1] == len(statistics(("a", "b"), ("c",)))
    assert_allclose(found.mean(axis=0), 0.0, atol=0.09)  # four standard errors of a mean of 2000
    assert_allclose(found.std(axis=0), 1.0, atol=0.07)


def test_what_is_not_measured_has_no_statistic():
    e = np.random.default_rng(2).normal(size=(50, 2))
    e[:, 1] = np.nan
    found = block_statistics(e, e[:, 0] ** 2, np.ones(50), np.array([[1.0, 0.0], [0.0, 0.0]]))
    assert_array_equal(np.isnan(found), [False, True, False, False, True, False, True])


@given(st.floats(0.01, 50.0), st.floats(0.05, 5.0), st.integers(1, 200))
def test_the_threshold_grows_with_what_is_asked_of_it(rate, block, count):
    h = threshold(mean_run(rate, block, count))
    assert h > threshold(mean_run(2 * rate, block, count))
    assert h < threshold(mean_run(rate, block, count + 1))


def test_the_mean_run_of_normal_values_is_the_stated_one_or_longer():
    """Siegmund's formula at b = h, so that the run is longer by about exp(2 k 1.166)."""
    rng = np.random.default_rng(3)
    asked = 200.0
    h = threshold(asked)
    sums, runs, since = np.zeros(500), [], np.zeros(500)
    for _ in range(3000):
        sums = np.maximum(sums + rng.normal(size=500) - POLICY.allowance, 0.0)
        since += 1
        hit = sums > h
        runs += since[hit].tolist()
        sums[hit], since[hit] = 0.0, 0.0
    assert asked < np.mean(runs) < 5 * asked


@pytest.mark.parametrize(
    ("draw", "learn"),
    [(autoregression(0.0), 240), (autoregression(0.5), 480), (autoregression(0.8), 240), (heavy_tails, 240)],
    ids=["white", "correlated", "much correlated", "heavy tails"],
)
def test_false_alarms_are_at_most_as_many_as_stated(draw, learn):
    """Over ten hours of 40 streams at 20 an hour; each has learned from its own blocks."""
    found = false_alarms(draw, 20.0, learn, 0.25, 40, seed=17)
    assert found.unlearned == 0
    assert found.rate <= 20.0


def test_without_the_long_run_scale_the_rate_is_not_kept():
    """The test above can fail: with the plain scatter of the blocks, correlated ones raise many alarms."""

    def plain(r):
        return Reference(r.mean, np.ones(len(r.mean)), r.blocks)

    assert false_alarms(autoregression(0.5), 20.0, 480, 0.25, 40, seed=17, spoil=plain).rate > 2 * 20.0


def test_a_reference_waits_until_the_blocks_tell_enough():
    values = autoregression(0.9)(np.random.default_rng(5), 400, 3)
    assert correlation(values) == pytest.approx(0.9, abs=0.1)
    assert learned(values[:200], 20.0) is None
    assert learned(autoregression(0.0)(np.random.default_rng(5), 200, 3), 20.0) is not None


def test_a_statistic_that_is_rarely_there_holds_up_no_other():
    values = autoregression(0.0)(np.random.default_rng(7), 2000, 3)
    values[20:, 1], values[400:, 2] = np.nan, np.nan
    found = learned(values, 20.0)
    assert found is not None
    assert_array_equal(np.isfinite(found.scale), [True, False, True])
    assert found.blocks[0] == 2000
    assert found.blocks[2] == 400
    assert learned(values[:, [1]], 20.0) is None


def test_the_scale_of_a_reference_is_the_one_of_long_sums():
    memory = 0.6
    values = autoregression(memory)(np.random.default_rng(6), 20000, 4)
    found = learned(values, 0.0)
    assert found is not None
    exact = np.sqrt((1 + memory) / (1 - memory))
    assert np.all(found.scale > 0.9 * exact)
    assert np.all(found.scale < 1.6 * exact)  # the largest one of several estimates


def run(innovation, cuts=(), settings=SETTINGS):
    """A monitor over pieces of a stream, and its alarms."""
    monitor, alarms = Monitor(("a", "b"), Fixed(), 0.01, settings), []
    h = history(innovation)
    edges = [0, *sorted(set(cuts)), len(innovation)]
    for begin, end in pairwise(edges):
        fields = {k: v[begin:end] if isinstance(v, np.ndarray) else v for k, v in vars(h).items()}
        alarms += monitor.take(History(**fields), np.zeros((end - begin, 1)))
    return monitor, alarms


def bits(monitor):
    stream = BytesIO()
    codec.write(stream, monitor.state, types=KEPT)
    return stream.getvalue()


def changing(seed, n=2000, change=1500, by=2.0):
    """White innovations whose mean changes in the first output."""
    e = np.random.default_rng(seed).normal(size=(n, 2))
    e[change:, 0] += by
    return e


@given(st.lists(st.integers(1, 1999), max_size=20))
@settings(max_examples=40)
def test_where_a_stream_is_cut_changes_no_bit_of_the_test(cuts):
    whole, alarms = run(changing(8))
    parts, same = run(changing(8), cuts)
    assert bits(whole) == bits(parts)
    assert alarms == same


@pytest.mark.parametrize("seed", range(5))
def test_a_change_is_found_soon_dated_and_named(seed):
    _, [alarm, *_] = run(changing(seed))
    assert 15.0 < alarm.t < 16.0
    assert 14.0 < alarm.since <= 15.2
    assert alarm.statistic.of in ("a", "", "an effect")
    assert alarm.height > 1
    assert dict(alarm.like).keys() == {"an effect"}


def test_one_outlier_is_no_change_and_one_event_is_one_alarm():
    e = changing(9, by=0.0)
    e[1700, 0] = 1e4
    assert run(e)[1] == []
    quiet = Settings(**{**vars(SETTINGS), "quiet": 100.0})
    monitor, alarms = run(changing(9), settings=quiet)
    assert len(alarms) == monitor.state.alarms == 1
    assert monitor.rejects(20.0)


def test_what_follows_a_new_beginning_is_not_tested():
    monitor, _ = run(changing(10, by=0.0))
    blocks = monitor.state.blocks
    monitor.anew()
    monitor.take(history(np.full((25, 2), 50.0), t0=20.0), np.zeros((25, 1)))
    assert monitor.state.blocks == blocks  # 0.2 s settle, then half a block
    assert len(monitor.state.nis) == 5


def test_memory_does_not_grow_while_blocks_are_too_correlated():
    monitor = Monitor(("a", "b"), Fixed(), 0.01, SETTINGS)
    wandering = np.cumsum(np.random.default_rng(11).normal(size=(20000, 2)), axis=0)
    monitor.take(history(wandering), np.zeros((20000, 1)))
    assert monitor.state.reference is None
    assert len(monitor.state.learnt) <= 8 * 50
    assert monitor.state.blocks > 8 * 50
