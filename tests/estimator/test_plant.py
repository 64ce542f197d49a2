"""A simulation that was made is not made again, and a changed one never gets the result of another."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.kept import KEPT, KEY, OF_ALL, Kept
from estimator.plant import PLANTS, USUAL, Plant, Plants, Steps
from estimator.record import Run
from fmus.export.builders.hypotheses import ModelBuilder
from fmus.host.fmu import Fmu
from fmus.models import MODELS
from fmus.variables import Input
from tests.helpers.carriage import coulomb, problem, record, to_and_fro
from tests.helpers.native import native
from tests.helpers.runs import names, stirred
from tests.helpers.sizes import by_size

N = 40  # samples of a run


class Counted(Fmu):
    """Counts the simulations that are really made."""

    made = 0

    def simulate_rows(self, t, inputs, outputs, starts, joined=False, every=1):
        """See Fmu."""
        self.made += len(starts)
        return super().simulate_rows(t, inputs, outputs, starts, joined, every)


class OneByOne(Counted):
    """The same FMU without the call for many rows, as foreign ones are."""

    at_once = 1

    def simulate_rows(self, t, inputs, outputs, starts, joined=False, every=1):
        """See Fmu."""
        return

    def simulate(self, t, inputs, outputs, start, every=1):
        """See Fmu."""
        self.made += 1
        return super().simulate(t, inputs, outputs, start, every)


def driven(name, seed=0, dt=1e-3):
    """A run of a model with inputs that move."""
    model = MODELS[name]()
    rows = stirred(model, np.random.default_rng(seed), N)
    u = np.array([list(row.values()) for row in rows]).reshape(N, -1)
    none = np.zeros(N, bool)
    return Run(np.arange(N) * dt, u, np.zeros((N, 1)), ~none, none, none)


def plant_of(fmu, name="testrig", kept=None, outputs=None):
    """The FMU with three of its outputs, which keeps nothing by default."""
    return Plant(fmu, names(MODELS[name](), Input), outputs or fmu.description.outputs[:3], kept)


@pytest.fixture(params=[Counted, OneByOne])
def fmu(request):
    with request.param(native("testrig")) as opened:
        yield opened


@pytest.fixture
def plant(fmu):
    """The test rig with room for what was simulated."""
    return plant_of(fmu, kept=Kept())


START = {"omega_w": 12.0, "omega_r": 9.2, "mu0": 0.3}


def alone(fmu, run, start, more=(), steps=USUAL):
    """The outputs by a plant that keeps nothing."""
    return plant_of(fmu).simulate(run, start, more, steps=steps)


def test_the_same_simulation_is_made_once(plant, fmu):
    run = driven("testrig")
    first = plant.simulate(run, START)
    before = fmu.made
    again = plant.simulate(run, dict(START))
    assert fmu.made == before
    assert_array_equal(again, first)
    assert_array_equal(again, alone(fmu, run, START))


def test_a_copy_of_the_run_is_the_same_run(plant, fmu):
    run = driven("testrig")
    plant.simulate(run, START)
    before = fmu.made
    plant.simulate(replace(run, t=run.t.copy(), u=np.asfortranarray(run.u), y=run.y + 1), START)
    assert fmu.made == before


def next_up(x):
    return float(np.nextafter(x, np.inf))


def moved(run, what):
    """The run with one bit of a time or an input changed."""
    samples = getattr(run, what).copy()
    samples[-1] = np.nextafter(samples[-1], np.inf)
    return replace(run, **{what: samples})


CHANGED = {
    "a parameter": lambda run: (run, START | {"mu0": next_up(0.3)}, {}),
    "a state": lambda run: (run, START | {"omega_w": next_up(12.0)}, {}),
    "one parameter more": lambda run: (run, START | {"k_A": 0.7}, {}),
    "one less": lambda run: (run, {n: x for n, x in START.items() if n != "mu0"}, {}),
    "an input": lambda run: (moved(run, "u"), START, {}),
    "a time": lambda run: (moved(run, "t"), START, {}),
    "fewer samples": lambda run: (run.part(0, N - 1), START, {}),
    "later samples": lambda run: (run.part(1, N), START, {}),
    "finer steps": lambda run: (run, START, {"steps": Steps(2)}),
    "another variable": lambda run: (run, START, {"more": ("T_A",)}),
}


@pytest.mark.parametrize("what", CHANGED)
def test_what_differs_by_a_bit_is_simulated(what, plant, fmu):
    run = driven("testrig")
    plant.simulate(run, START)
    before = fmu.made
    other, start, more = CHANGED[what](run)
    found = plant.simulate(other, start, **more)
    assert fmu.made > before
    assert_array_equal(found, alone(fmu, other, start, **more))


def test_another_fmu_and_other_outputs_are_simulated():
    run, kept = driven("drive"), Kept()
    with Counted(native("drive")) as one, Counted(native("drive")) as other:
        some = one.description.outputs[:1]
        results = [plant_of(f, "drive", kept, o).simulate(run, {}) for f, o in ((one, None), (other, some))]
        assert (one.made, other.made) == (1, 1)
    assert_array_equal(results[0][:, :1], results[1])


def test_a_push_is_simulated_and_not_kept(plant, fmu):
    run = driven("testrig")
    free = plant.simulate(run, START)
    pushed = [plant.simulate(run, START, push={"T_P": np.full(N, x)}) for x in (1.0, 2.0)]
    assert not np.array_equal(*pushed)
    assert_array_equal(plant.simulate(run, START), free)


def test_variables_of_a_kept_simulation_are_read_from_it(plant, fmu):
    run = driven("testrig")
    whole = plant.simulate(run, START, ("omega_w", "omega_r"))
    before, n = fmu.made, len(plant.outputs)
    assert_array_equal(plant.simulate(run, START), whole[:, :n])
    assert_array_equal(plant.simulate(run, START, ("omega_r",))[:, n], whole[:, n + 1])
    assert fmu.made == before


def test_a_result_may_be_overwritten_by_whoever_asked(plant, fmu):
    run = driven("testrig")
    expected = alone(fmu, run, START)
    for _ in range(3):
        found = plant.simulate(run, START)
        assert_array_equal(found, expected)
        found[:] = np.nan
    [row] = plant.simulate_rows(run, [START])
    row[:] = np.nan
    assert_array_equal(plant.simulate(run, START), expected)


def test_of_many_rows_only_the_new_ones_are_simulated():
    run = driven("testrig")
    with Counted(native("testrig")) as fmu:
        plant = plant_of(fmu, kept=Kept())
        starts = [START | {"mu0": 0.2 + 0.01 * i} for i in range(11)]
        plant.simulate_rows(run, starts[3:6])
        found = plant.simulate_rows(run, starts)
        assert fmu.made == len(starts)
        plant.simulate_rows(run, starts[::-1])
        assert fmu.made == len(starts)
        for start, y in zip(starts, found, strict=True):
            assert_array_equal(y, alone(fmu, run, start))
        refused = [*starts, START | {"mu0": -1.0}]
        assert plant.simulate_rows(run, refused) is None


@by_size
def test_starts_in_turn_give_what_each_gives_alone(name):
    run = driven(name, dt=MODELS[name]().step_size)
    with Fmu(native(name)) as fmu:
        plant, known = plant_of(fmu, name), fmu.description.variables
        tried = [n for n in fmu.description.parameters if known[n].start and known[n].max is None][:9]
        starts = [{}, *({n: (known[n].start or 0.0) * 1.0001} for n in tried)]
        states = fmu.description.states[:2]
        for start, y in zip(starts, plant.simulate_in_turn(run, starts, states), strict=True):
            assert_array_equal(y, plant.simulate(run, start, states))


@by_size
def test_responses_over_a_step_are_those_of_restarts(name):
    """From any state and with any inputs, all at once or one by one."""
    dt = MODELS[name]().step_size
    run = driven(name, dt=dt)
    with Fmu(native(name)) as many, OneByOne(native(name)) as one:
        plants = [plant_of(fmu, name) for fmu in (many, one)]
        way = plants[1].simulate(run, {}, plants[1].states)[::9, len(plants[1].outputs) :]
        starts = [
            dict(zip((*plants[0].states, *plants[0].inputs), (*x, *u), strict=True))
            for x, u in zip(way.tolist(), run.u[::9].tolist(), strict=True)
        ]
        for found, expected in zip(*(plant.responses(starts, dt) for plant in plants), strict=True):
            assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


def test_what_is_simulated_ahead_is_not_simulated_when_it_is_asked_for():
    """Starts may name different variables, in which another instance has its start values."""
    runs = [driven("testrig", seed) for seed in range(2)]
    starts = [START, {"omega_w": 11.0, "k_A": 0.9}, {}]
    with Counted(native("testrig")) as fmu:
        plant = plant_of(fmu, kept=Kept())
        plant.simulate_ahead(runs, [starts] * 2, USUAL)
        before = fmu.made
        assert before == 6
        found = [plant.simulate(run, start) for run in runs for start in starts]
        assert fmu.made == before
        expected = [alone(fmu, run, start) for run in runs for start in starts]
        assert_array_equal(found, expected)


@pytest.mark.parametrize("kind", [Counted, OneByOne])
def test_nothing_is_simulated_ahead_that_would_be_simulated_again(kind):
    """Neither what is too much to be kept, nor what takes as long as one by one."""
    run, size = driven("testrig"), 3 * 8 * N + KEY
    with kind(native("testrig")) as fmu:
        fmu.made = 0
        for most, starts in ((OF_ALL * size - 1, 3), (OF_ALL * size, OF_ALL + 1), (OF_ALL * size, OF_ALL)):
            kept = Kept(most)
            asked = [START | {"mu0": 0.2 + 0.01 * i} for i in range(starts)]
            plant_of(fmu, kept=kept).simulate_ahead([run], [asked], USUAL)
            made = OF_ALL if starts == OF_ALL and fmu.at_once > 1 else 0
            assert (fmu.made, kept.size) == (made, made * size)


def hypotheses_of(folder, jobs, kept):
    """Fits of the effects of a carriage, and how many simulations of its FMUs they took."""
    asked = problem(ModelBuilder("drive", folder), record(to_and_fro(), coulomb(20.0), 1))
    base = calibrate(asked)[1:]
    baseline = Baseline(asked, *base)
    kinds = ("viscous_damping", "coulomb_friction", "quadratic_damping", "parameter_offset")
    offered = [(kind, at) for kind, at in asked.builder.offers if kind in kinds]
    forces = missing_forces(asked, base[0].fit.theta, base[1].std)
    candidates = physical_candidates(asked, offered, forces)
    promises = [Promise((c,), 0.0, {u.name: u.start for u in c.unknowns}) for c in candidates]
    PLANTS.kept.most = kept
    return Fitter(baseline, jobs).fitted(promises, 2)


def test_hypotheses_that_are_simulated_together_are_those_of_each_alone(tmp_path, monkeypatch):
    calls = []
    rows = Fmu.simulate_rows
    monkeypatch.setattr(Fmu, "simulate_rows", lambda *a: (calls.append(len(a[4])), rows(*a))[1])
    monkeypatch.setattr(PLANTS, "kept", Kept())
    found = {}
    for kept in (KEPT, 0):
        PLANTS.close()
        calls.clear()
        found[kept] = hypotheses_of(tmp_path, 1, kept), len(calls)
    PLANTS.close()
    (together, few), (apart, many) = found[KEPT], found[0]
    assert few < many
    assert len(together) == len(apart) >= 4
    for one, other in zip(together, apart, strict=True):
        assert one.key == other.key
        assert one.theta == other.theta
        assert_array_equal(one.residuals, other.residuals)
        assert_array_equal(one.fit.covariance, other.fit.covariance)


def test_closed_plants_leave_nothing_behind():
    plants, run = Plants(), driven("testrig")
    inputs = tuple(names(MODELS["testrig"](), Input))
    plant = plants.get(native("testrig"), inputs, ("omega_w",))
    plant.simulate(run, START)
    assert plants.kept.size == 8 * N + KEY
    plants.close()
    assert plants.kept.size == 0
