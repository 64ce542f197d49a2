"""The host with an FMI 3.0 FMU compiled from C: every promise that it keeps for FMI 2.0."""

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.plant import Plant
from estimator.record import Run
from fmus.errors import BadInput
from fmus.host.archive import Archive, describe, problems
from fmus.host.fmi3 import Fmi3Instance
from fmus.host.fmu import Fmu, FmuError
from fmus.host.grading.check import grade
from fmus.host.grading.trials import TRIALS
from fmus.host.instance import MESSAGES
from tests.helpers.packed import repacked, with_description
from tests.helpers.vdp import (
    ERROR,
    OUTPUTS,
    solved,
    stirred,
)


@pytest.fixture(scope="module")
def running(vdp):
    with Fmu(vdp) as fmu:
        yield fmu


@pytest.fixture
def fresh(vdp):
    with Fmu(vdp) as fmu:
        fmu.restart()
        yield fmu


def test_description(vdp):
    said = describe(vdp)
    assert (said.name, said.fmi_version, said.identifier) == ("VanDerPol", "3.0", "vdp")
    assert (said.step_size, said.saves_state, said.serialises_state) == (0.01, True, True)
    assert not said.once_per_process
    assert said.states == ["x0", "x1"]
    assert said.outputs == OUTPUTS
    assert said.inputs == ["u"]
    assert said.parameters == ["mu", "fault"]
    x0, x1, x1_dot, mu = (said.variables[n] for n in [*OUTPUTS, "mu"])
    assert (x0.unit, x0.start, x0.min, x0.nominal, x0.description) == ("m", 2.0, None, 2.0, "displacement")
    assert (x1.unit, x1.start, x1.min, x1.max, x1.nominal) == ("m/s", 0.0, -50.0, 50.0, 3.0)
    assert (x1_dot.initial, x1_dot.variability, x1_dot.start) == ("calculated", "continuous", None)
    assert (mu.variability, mu.initial, mu.start, mu.min, mu.max) == ("tunable", "exact", 1.5, 0.0, 10.0)
    assert problems(vdp) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("table", r"'table' is an array; use its elements, such as 'table\[1\]'"),
        ("scale", "'scale' is a structural parameter; use a scalar Real or Float64 one"),
        ("x1_dott", "has no variable 'x1_dott'; did you mean 'x1_dot'"),
    ],
)
def test_variables_that_cannot_be_used(fresh, name, words):
    for call in (lambda: fresh[name], lambda: fresh.set(**{name: 1.0})):
        with pytest.raises(BadInput, match=rf"VanDerPol\.fmu: {words}"):
            call()


def test_an_alias_is_read_but_is_no_second_state(fresh):
    assert fresh["position"] == fresh["x0"] == 2.0
    assert fresh.description.variables["position"].causality == "local"


@settings(max_examples=20)
@given(
    mu=st.floats(0, 3), x0=st.floats(-2, 2), x1=st.floats(-2, 2), t0=st.floats(-10, 100), even=st.booleans()
)
def test_a_run_is_the_solution(running, mu, x0, x1, t0, even):
    assume(x0 or abs(x1) > 1e-9)  # at exact rest the reference divides no error by no error
    s = np.linspace(0, 1, 41)
    t = t0 + 4 * (s if even else s**2)
    u = stirred(t)
    found = running.simulate(t, {"u": u}, OUTPUTS, {"mu": mu, "x0": x0, "x1": x1})
    assert_allclose(found, solved(t, u, mu, (x0, x1)), atol=10 * ERROR)
    assert running.time == t[-1]


def test_simulate_is_step_by_step(fresh):
    t = np.linspace(1.0, 2.0, 21) ** 2
    u = stirred(t)
    fast = fresh.simulate(t, {"u": u}, OUTPUTS, {"mu": 0.7})
    fresh.restart(t[0], mu=0.7, u=u[0])
    slow = [fresh.read(OUTPUTS)]
    for k, dt in enumerate(np.diff(t)):
        fresh.time = t[k]
        fresh.step(dt, u=u[k])
        slow.append(fresh.read(OUTPUTS))
    assert_array_equal(fast, slow)


def test_a_restart_repeats_a_run_exactly(fresh):
    t = np.linspace(0, 3, 301)
    first, other, again = (
        fresh.simulate(t, {"u": scale * stirred(t)}, OUTPUTS, {"mu": mu})
        for scale, mu in [(1, 1.5), (2, 0.1), (1, 1.5)]
    )
    assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.1


def test_a_restart_from_the_middle_goes_on(fresh):
    t = np.linspace(0, 4, 401)
    u, half = stirred(t), 200
    whole = fresh.simulate(t, {"u": u}, OUTPUTS, {})
    start = dict(zip(OUTPUTS[:2], whole[half, :2], strict=True))
    rest = fresh.simulate(t[half:], {"u": u[half:]}, OUTPUTS, start)
    assert_array_equal(rest[:, :2], whole[half:, :2])


def test_a_tunable_parameter_while_running(fresh):
    t = np.linspace(0, 1, 101)
    first = solved(t, 0 * t[:-1])
    for dt in np.diff(t):
        fresh.step(dt)
    assert_allclose(fresh.read(OUTPUTS), first[-1], atol=ERROR)
    fresh.set(mu=0.2)
    for dt in np.diff(t):
        fresh.step(dt)
    assert_allclose(fresh.read(OUTPUTS), solved(t, 0 * t[:-1], 0.2, first[-1, :2])[-1], atol=ERROR)


def test_a_saved_state_also_as_bytes(fresh):
    fresh.step(0.5, u=1.0)
    saved, then = fresh.save(), fresh.time
    data = fresh.serialised(saved)
    fresh.step(0.5)
    straight = fresh.read(OUTPUTS)
    copy = fresh.deserialised(data)
    assert isinstance(data, bytes)
    for state in (saved, copy):
        fresh.restart(x0=-1.0, mu=0.3)
        fresh.restore(state)
        fresh.time = then
        fresh.step(0.5)
        assert fresh.read(OUTPUTS) == straight
        fresh.forget(state)
    with pytest.raises(FmuError, match="a state of 3 bytes"):
        fresh.deserialised(b"abc")


def test_instances_do_not_meet(vdp):
    with Archive(vdp) as archive, Fmu(archive) as one, Fmu(archive) as two, Fmu(vdp) as three:
        for fmu, mu in ((one, 0.5), (two, 1.0), (three, 2.0)):
            fmu.restart(mu=mu)
        for _ in range(100):
            for fmu in (one, two, three):
                fmu.step(0.01)
        t = np.linspace(0, 1, 101)
        for fmu, mu in ((one, 0.5), (two, 1.0), (three, 2.0)):
            assert_allclose(fmu.read(OUTPUTS), solved(t, 0 * t[:-1], mu)[-1], atol=ERROR)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda f: f.step(0.1, u=np.nan), r"fmi3SetFloat64 failed .*: variable 5 = nan is not finite"),
        (lambda f: f.restart(mu=np.inf), r"fmi3SetFloat64 failed .*: variable 4 = inf is not finite"),
        (lambda f: f.step(-0.1), r"fmi3DoStep failed with status 3 \(error\): a step of -0.1 s is not pos"),
        (lambda f: f.set(x0=1.0), r"fmi3SetFloat64 failed .*: variable 1 cannot be set now"),
        (
            lambda f: f.simulate(np.arange(4) / 10, {"u": np.array([0, np.nan, 0])}, OUTPUTS, {}),
            r"step at t = 0\.1 s: variable 5 = nan is not finite",
        ),
        (
            lambda f: f.simulate(np.array([0, 0.2, 0.1]), {}, OUTPUTS, {}),
            r"step at t = 0\.2 s: a step of -0\.1 s is not positive",
        ),
    ],
)
def test_refusals_are_sentences_and_a_restart_mends(fresh, call, words):
    with pytest.raises(FmuError, match=rf"^VanDerPol\.fmu: {words}") as refused:
        call(fresh)
    assert "\n" not in str(refused.value)
    fresh.restart()
    fresh.step(0.1)
    assert fresh["x0"] == pytest.approx(solved(np.array([0, 0.1]), [0.0])[-1, 0], abs=ERROR)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (1, r"step at t = 0 s: it returned early, at t = 0\.05 s$"),
        (2, r"it asks to end the simulation at t = 0\.1 s: the oscillator is worn out$"),
    ],
)
def test_a_step_that_is_not_all_of_a_step_or_the_last_is_an_error(fresh, fault, words):
    for call in (
        lambda: [fresh.step(0.1) for _ in range(2)],
        lambda: fresh.simulate(np.arange(3) / 10, {}, OUTPUTS, {"fault": fault}),
    ):
        fresh.restart(fault=fault)
        with pytest.raises(FmuError, match=words):
            call()
    fresh.restart()
    fresh.step(0.1)


@pytest.mark.parametrize(
    "call",
    [lambda f: f.step(0.1), lambda f: f.simulate(np.arange(3.0), {}, OUTPUTS, {"fault": 3})],
    ids=["step", "run"],
)
def test_no_call_is_made_after_a_fatal_failure(vdp, monkeypatch, call):
    def never(*_):
        raise FMICallException("a call that must not be made", 3)

    with Fmu(vdp) as fmu:
        fmu.restart(fault=3)
        with pytest.raises(FmuError, match="broken for good"):
            call(fmu)
        for name in ("reset", "getFloat64", "setFloat64", "freeInstance"):
            monkeypatch.setattr(fmu._instance._slave, name, never)
        for later in (fmu.restart, lambda: fmu["x0"], lambda: fmu.set(u=1.0)):
            with pytest.raises(FmuError, match=r"cannot be used any more after a fatal failure .*for good"):
                later()


def test_an_fmu_that_cannot_start_says_why(vdp, tmp_path):
    path = with_description(vdp, tmp_path / "x.fmu", b"vdp-of-the-tests", b"another")
    before = len(MESSAGES)
    with pytest.raises(
        FmuError, match=r"x\.fmu: Failed to instantiate FMU: the instantiation token is '{another}'"
    ):
        Fmu(path)
    assert len(MESSAGES) == before


def test_messages_are_forgotten_with_their_instance(vdp):
    before = len(MESSAGES)
    with Archive(vdp) as archive:
        instance = Fmi3Instance(archive, "one")
        assert len(MESSAGES) == before + 1
        instance.close()
    assert len(MESSAGES) == before


def test_no_binary_for_this_platform(vdp, tmp_path):
    path = repacked(vdp, tmp_path / "x.fmu", lambda n, d: (n.replace("binaries/", "binaries/sparc-"), d))
    with pytest.raises(BadInput, match=r"has no binary for this platform \(\w+-\w+\); it holds sparc-"):
        Fmu(path)


def test_the_grade_is_clean(vdp):
    found = grade(vdp)
    assert [(c.title, c.passed) for c in found.checks] == [(title, True) for title in TRIALS]


def test_a_plant(vdp):
    t = np.linspace(0, 2, 201)
    u = np.sin(t)[:, None]
    with Fmu(vdp) as fmu:
        plant = Plant(fmu, ["u"], ["x0", "x1_dot"])
        assert plant.states == ("x0", "x1")
        every = np.ones(len(t), dtype=bool)
        run = Run(t, u, np.empty((len(t), 2)), fit=every, choose=~every, test=~every)
        found = plant.simulate(run, {"mu": 0.8}, ["x1"])
        held = (u[1:, 0] + u[:-1, 0]) / 2
        assert_allclose(found, solved(t, held, 0.8, seen=u[:, 0])[:, [0, 2, 1]], atol=ERROR)
        [x], [y] = plant.responses([{"x0": 1.0, "x1": -0.5, "u": 0.3, "mu": 0.8}], 0.01)
        before, after = solved(np.array([0, 0.01]), [0.3], 0.8, (1.0, -0.5))
        assert_allclose([*x, *y], [*after[:2], *before[[0, 2]]], atol=ERROR)
