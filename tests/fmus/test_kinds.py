"""Arrays, whole numbers and truths in FMUs of others: set, read, stepped, connected, graded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.access.exchange import continuous_states
from fmus.errors import BadInput
from fmus.host import loop
from fmus.host.apart.isolation import Isolation
from fmus.host.archive import Archive, describe, problems
from fmus.host.fmu import Fmu, FmuError, SimulationEnds
from fmus.host.grading.check import grade
from fmus.host.master.connections import Connection
from fmus.host.master.master import Master
from fmus.host.places import LIMITS
from tests.helpers.packed import with_description

A = np.arange(1.0, 7.0).reshape(2, 3)
X = [f"x[{i}]" for i in (1, 2, 3)]
U = [f"u[{i}]" for i in (1, 2, 3)]
Y = ["y[1]", "y[2]"]
WHOLE = {"n": "Int8", "big": "UInt64", "mode": "Enumeration", "on": "Boolean", "count": "Int32"}
small = st.floats(-1e3, 1e3)


@pytest.fixture(scope="module")
def running(kinds):
    with Fmu(kinds[3]) as fmu:
        yield fmu


def test_the_fmus_are_valid(kinds):
    assert [problems(kinds[fmi]) for fmi in (2, 3)] == [[], []]


def test_a_description_has_arrays_by_their_elements(kinds):
    said = describe(kinds[3])
    assert said.outputs == said.inputs == said.states == []  # nothing from which estimates can be made
    wide = said.widened
    assert wide.inputs == [*U, "n", "on", "f", "big"]
    assert wide.states == [*X, "count"]
    assert wide.outputs == [*X, *Y, "m", "count", "g"]
    assert wide.unused == {
        "columns": "a structural parameter", "label": "of type String",
        **dict.fromkeys(("A", "u", "x", "y"), "an array"),
    }  # fmt: skip
    assert [wide.variables[f"A[{i},{j}]"].start for i in (1, 2) for j in (1, 2, 3)] == [*A.flat]
    assert (wide.variables["x[2]"].start, wide.variables["x[2]"].unit) == (10.0, "m")
    assert (wide.variables["on"].min, wide.variables["on"].max) == (0.0, 1.0)
    assert (wide.variables["mode"].min, wide.variables["mode"].max) == (1.0, 3.0)
    assert wide.dependencies["y[2]"] == ()
    assert wide.dependencies["m"] == ("n",)


@given(
    start=st.dictionaries(st.sampled_from([*X, *U]), small),
    later=st.dictionaries(st.sampled_from(U), small),
    dt=st.floats(0.01, 1),
)
def test_elements_are_set_alone_and_the_others_stay(running, start, later, dt):
    x = np.array([start.get(n, v) for n, v in zip(X, (0.0, 10.0, 0.0), strict=True)])
    u = np.array([start.get(n, v) for n, v in zip(U, (1.0, 0.0, 0.0), strict=True)])
    running.restart(**start)
    assert_array_equal(running.read([*X, *U]), [*x, *u])
    running.step(dt, **later)
    u = np.array([later.get(n, v) for n, v in zip(U, u, strict=True)])
    assert_allclose(running.read(X), x + dt * u, rtol=1e-15)
    assert_allclose(running.read(Y), A @ (x + dt * u), rtol=1e-12, atol=1e-9)


def test_a_restored_state_is_not_mixed_with_what_was_set_since(running):
    running.restart(**{"u[2]": 5.0})
    saved = running.save()
    running.step(0.5, **{"u[1]": -1.0, "u[2]": 7.0})
    running.restore(saved)
    running.set(**{"u[3]": 9.0})
    assert running.read(U) == [1.0, 5.0, 9.0]
    running.forget(saved)


@pytest.mark.parametrize("name", WHOLE)
@given(data=st.data())
def test_whole_numbers_go_in_and_out_or_are_refused(running, name, data):
    kind = "Int64" if WHOLE[name] == "Enumeration" else WHOLE[name]
    low, high = (max(LIMITS[kind][0], -(2**53)), min(LIMITS[kind][1], 2**53))
    value = data.draw(st.integers(low, high))
    running.restart(**{name: float(value)})
    assert running[name] == value
    outside = data.draw(st.sampled_from([2.0 * LIMITS[kind][1] + 2, LIMITS[kind][0] - 2.0**60, np.nan]))
    with pytest.raises(FmuError, match=rf"Set{kind} failed .*: .* does not fit into .* type {kind}"):
        running.restart(**{name: outside})


def test_short_reals_are_rounded_as_the_type_does(running):
    running.restart(f=0.1, on=1.0)
    assert running["g"] == np.float32(0.1)
    running.step(0.1, on=0.0)
    assert running["g"] == 0


@pytest.mark.parametrize("steps", [5, loop.LONG + 5])
def test_a_simulation_with_every_kind_at_once(kinds, steps):
    t = 0.125 * np.arange(steps + 1)
    u, n, on = np.sin(t), np.arange(steps + 1) % 7.0, (np.arange(steps + 1) // 3) % 2.0
    with Fmu(kinds[3]) as fmu:
        found = fmu.simulate(
            t, {"u[2]": u, "n": n, "on": on}, ["x[2]", "m", "count", "y[1]"], {"x[2]": 1.0, "mode": 3.0}
        )
    x = 1.0 + np.concatenate([[0], np.cumsum(0.125 * (u[1:] + u[:-1]) / 2)])
    assert_allclose(found[:, 0], x, rtol=1e-12, atol=1e-12)
    assert_array_equal(found[:, 1], 2 * n + 3)
    assert_array_equal(found[:, 2], np.concatenate([[0], np.cumsum(on[:-1])]))  # held, no mean of two
    assert_allclose(found[:, 3], t + 2 * x, rtol=1e-12)


def test_a_value_reference_belongs_to_its_type(kinds):
    with Fmu(kinds[2]) as fmu:
        fmu.restart(x=1.5, n=4, mode=2, count=7)
        assert fmu.read(["x", "n", "count", "mode", "product", "on", "odd"]) == [1.5, 4, 7, 2, 8, 1, 0]
        fmu.step(0.5, n=3)
        assert fmu.read(["x", "count", "product", "odd"]) == [3.0, 8, 6, 1]
        fmu.step(0.5, on=0)
        assert fmu["x"] == 3.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_may_end_the_simulation(kinds, fmi):
    t = 0.125 * np.arange(11)
    with Fmu(kinds[fmi]) as fmu:
        whole = fmu.simulate(t[:9], {}, ["count"], {"end": 1.0, "on": 1.0})
        assert whole[-1, 0] == 8  # the last step may be that with which it ends
        with pytest.raises(SimulationEnds, match="asks to end the simulation at t = 1 s"):
            fmu.step(0.125)
        with pytest.raises(SimulationEnds, match="asks to end the simulation at t = 1 s"):
            fmu.simulate(t, {}, ["count"], {"end": 1.0})
        fmu.restart()
        fmu.step(0.125)


def test_a_step_that_is_cut_short_is_none(kinds):
    with Fmu(kinds[2]) as fmu:
        fmu.restart(end=0.3)
        fmu.step(0.2)
        with pytest.raises(SimulationEnds, match=r"asks to end the simulation at t = 0\.3 s"):
            fmu.step(0.2)
        assert fmu["x"] == pytest.approx(0.5 + 2 * 0.3)


@pytest.mark.parametrize("apart", [False, True], ids=["here", "apart"])
def test_a_coupled_run_of_whole_numbers_truths_and_elements(kinds, apart):
    wires = [
        Connection("three.m", "two.n", gain=2.0, offset=-1.0),
        Connection("two.odd", "three.on"),  # a truth into a truth
        Connection("two.x", "three.u[3]", delayed=True),
    ]
    files = {"three": kinds[3], "two": kinds[2]}
    if apart:
        files = {name: Archive(path, Isolation()) for name, path in files.items()}
    inputs = {"three.n": ([0.0, 1.0], [1.0, 2.0]), "three.u[1]": "sin(t)"}
    with Master(files, wires, step=0.125, inputs=inputs, initial={"three.x[2]": 0.0}) as master:
        found = master.run(1.0)
    assert found.ended == ""
    data = found.data
    n = np.where(data["time"] < 1, 1, 2)  # an entry of a table is kept until the next one
    assert_array_equal(data["three.m"], 2 * n + 1)
    assert_array_equal(data["two.product"], 2 * data["three.m"] - 1)
    assert_array_equal(data["three.count"], np.arange(9))
    assert_allclose(data["two.x"].diff()[1:], 0.125 * data["two.product"][:-1])
    assert_allclose(data["three.y[1]"], data[[f"three.{x}" for x in X]] @ A[0])
    if apart:
        for archive in files.values():
            archive.close()


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("end", [1.0, 1.05])
def test_a_coupled_run_ends_where_an_fmu_wants_it(kinds, fmi, end):
    with Master({"it": kinds[fmi]}, step=0.1, parameters={"it.end": end}, record=["it.count"]) as master:
        found = master.run(2.0)
    cut = fmi == 2 and end > 1  # this one makes half a step, which others could not join
    assert found.data["time"].iloc[-1] == pytest.approx(1.0 if end == 1.0 or cut else 1.1)
    assert found.interrupted_at is None
    assert found.ended.startswith(f"'it' ({kinds[fmi].name}): it asks to end the simulation at t = 1")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"connections": [("two.x", "two.n")]}, "'two.x' is real, and 'two.n' takes whole numbers"),
        ({"parameters": {"three.mode": 1.5}}, "1.5 is no whole number, and the variable is of type Enum"),
        ({"parameters": {"three.mode": 4}}, "4 is outside 1 to 3"),
        ({"inputs": {"three.u": 1.0}}, r"'u' is an array; use its elements, such as 'u\[1\]'"),
        ({"inputs": {"three.on": 2}}, "2 is outside 0 to 1"),
        ({"parameters": {"three.label": 1}}, "'label' is of type String"),
        ({"record": ["three.columns"]}, "'columns' is a structural parameter"),
    ],
)
def test_what_does_not_fit_is_said(kinds, options, words):
    with pytest.raises(BadInput, match=words):
        Master({"three": kinds[3], "two": kinds[2]}, step=0.1, **options)


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_grade_is_clean(kinds, fmi):
    found = {c.title: c for c in grade(kinds[fmi]).checks}
    assert [c for c in found.values() if c.passed is False] == []
    assert found["restart"].passed
    assert found["repeatable"].passed
    assert ("x[1], x[2], x[3], count" if fmi == 3 else "x, count") in found["restart"].sentence


def test_an_fmu_that_ends_early_is_graded_on_what_it_does(kinds, tmp_path):
    path = with_description(kinds[3], tmp_path / "short.fmu", b'start="1e9"', b'start="2"')
    found = grade(path)
    assert [c.title for c in found.checks if c.passed is False] == []


def test_states_in_arrays_are_no_states_to_estimate(kinds, tmp_path):
    array = b'<Float64 name="x_dot" valueReference="20" derivative="3"><Dimension start="3"/></Float64>'
    end, unknown = b'<Float64 name="end"', b'<InitialUnknown valueReference="4"/>'
    changes = {
        b"<CoSimulation": b'<ModelExchange modelIdentifier="kinds_fmi3"/><CoSimulation',
        end: array + end,
        unknown: b'<ContinuousStateDerivative valueReference="20"/>' + unknown,
    }
    path = kinds[3]
    for i, (old, new) in enumerate(changes.items()):
        path = with_description(path, tmp_path / f"{i}.fmu", old, new)
    with Archive(path) as archive, pytest.raises(BadInput, match="its state 'x' is no scalar real"):
        continuous_states(archive)
