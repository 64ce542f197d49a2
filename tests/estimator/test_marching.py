"""Many samples in one call of compiled code give the bits of single steps, wherever they begin and end."""

from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from estimator.filters.bounds import Transform, bounded
from estimator.filters.estimator import Gate
from estimator.filters.history import filtered, samples
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from estimator.filters.unknown_input import NoisyInput, Shaped
from fmus.host.fmu import Fmu
from fmus.models import MODELS
from tests.helpers.native import native
from tests.helpers.runs import stirred

pytest.importorskip("numba", reason="without numba, samples are filtered one by one")
N, DT = 60, 1e-3
FIELDS = ("t", "x", "std", "innovation", "nis", "freedom", "gated", "likelihoods")


class Single(Ukf):
    """The same filter with a step of its own, so that it makes one after the other."""

    def step(self, *asked):
        """See Ukf."""
        return super().step(*asked)


class Counted(Ukf):
    """Counts the samples that are filtered by compiled code."""

    made = 0

    def many(self, *asked):
        """See Ukf."""
        done = super().many(*asked)
        self.made += done
        return done


def rig():
    """The test rig: its outputs are states that are estimated, and a known input has an error."""
    states = [UnknownState(name, start, 0.1, 1e-2) for name, start in (("omega_w", 12.0), ("omega_r", 9.2))]
    parameters = [
        UnknownParameter("mu0", 0.3, 0.1, bounded((0.0, 1.0)), 1e-2),
        UnknownParameter("N", 8000.0, 800.0, bounded((1.0, inf))),
    ]
    with Fmu(native("testrig")) as fmu:
        inputs = list(fmu.description.inputs)
    errors = [NoisyInput(inputs[0], 20.0)]
    told = native("testrig"), ["omega_r", "omega_w"], states, parameters
    return Joint(*told, inputs=inputs, dt=DT, input_noise=errors)


def vehicle():
    """The vehicle: its outputs are read from the FMU, most states are carried, and an input is unknown."""
    states = [UnknownState("z1", 0.0, 1e-3, 1e-3), UnknownState("z1_dot", 0.0, 1e-2, 1e-2)]
    parameters = [UnknownParameter("k1", 4e5, 4e4, Transform("log", 1e5, inf))]
    with Fmu(native("vehicle7dof")) as fmu:
        first, *inputs = fmu.description.inputs
        outputs = list(fmu.description.outputs[-3:])
    unknown = [Shaped(first, 1e-3, 2.0)]
    return Joint(native("vehicle7dof"), outputs, states, parameters, unknown, inputs, dt=DT)


SYSTEMS = {"rig": rig, "vehicle": vehicle}


@pytest.fixture(scope="module", params=SYSTEMS)
def joint(request):
    with SYSTEMS[request.param]() as made:
        yield made


def record(joint, rng, t, parts=1, lost=0.0, far=0.0):
    """Samples of a noisy motion, of which shares are lost or far off."""
    n, m = len(t), len(joint.outputs)
    size = np.array([10.0 if name.startswith("omega") else 1e-3 for name in joint.outputs])
    y = size * (1 + 0.01 * rng.standard_normal((n, m)))
    y[rng.random((n, m)) < far] *= 3.0
    y[rng.random((n, m)) < lost] = np.nan
    rows = stirred(MODELS[joint.archive.description.name.lower()](), rng, n)
    u = np.array([[row[name] for name in joint.inputs] for row in rows])
    return samples(t, u, y, every=parts, parts=parts)


def both(joint, s, gate=None, cls=Counted):
    """The histories by single steps and by compiled code, and the filters."""
    R = np.diag([0.01 if name.startswith("omega") else 1e-8 for name in joint.outputs])
    filters = [kind(joint, joint.start(), joint.noise, R, DT, gate) for kind in (Single, cls)]
    return [filtered(f, s) for f in filters], filters


def assert_same(histories, filters):
    one, other = histories
    for name in FIELDS:
        assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.broken == other.broken
    for name, a, b in zip(one.last._fields, one.last, other.last, strict=True):
        if name == "memory":
            assert_array_equal(a.rejected, b.rejected)
        else:
            assert_array_equal(a, b, err_msg=name)
    assert filters[1].now is other.last


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), parts=st.sampled_from([1, 2, 3]), gated=st.booleans())
def test_the_results_are_those_of_single_steps(joint, seed, parts, gated):
    rng = np.random.default_rng(seed)
    s = record(joint, rng, DT * np.arange(N * parts), parts, *rng.choice([0.0, 0.1, 0.6], 2))
    assert_same(*both(joint, s, Gate(3.0, 4) if gated else None))


def test_all_samples_are_filtered_in_calls_that_the_fmu_takes(joint):
    _, filters = both(joint, record(joint, np.random.default_rng(0), DT * np.arange(N)))
    assert filters[1].made >= N - 2  # the first needs no step, and the next one may have to open the FMU


def test_steps_of_other_lengths_are_made_one_by_one_or_in_a_call_of_their_own(joint):
    rng = np.random.default_rng(1)
    steps = np.concatenate([np.full(20, DT), np.full(20, 2 * DT), rng.uniform(DT, 2 * DT, 10)])
    histories, filters = both(joint, record(joint, rng, np.cumsum(steps)))
    assert 30 <= filters[1].made < 50
    assert_same(histories, filters)


def test_it_stops_where_single_steps_do(joint):
    """With the same reason, and the estimate before it; a filter that goes on does so from there."""
    s = record(joint, np.random.default_rng(2), DT * np.arange(N))
    s.held[37] = s.u[38] = np.nan
    histories, filters = both(joint, s)
    assert histories[0].broken
    assert len(histories[0].t) == 38
    assert_same(histories, filters)


def test_a_record_in_pieces_gives_the_same_bits(joint):
    s = record(joint, np.random.default_rng(3), DT * np.arange(N))
    [whole, _], [_, f] = both(joint, s)
    f.now = joint.start()
    cut = 23
    first = filtered(f, s.first(cut))
    rest = filtered(f, type(s)(s.t[cut - 1 :], s.u[cut - 1 :], s.held[cut - 1 :], s.y[cut - 1 :]))
    for name in FIELDS:
        found = np.concatenate([getattr(first, name), getattr(rest, name)])
        assert_array_equal(found, getattr(whole, name), err_msg=name)
