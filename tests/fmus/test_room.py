"""FMUs in a process of their own: the same numbers, every end told, and nothing that comes back can run."""

import contextlib
import copyreg
import math
import operator
import pickle
import socket
import time
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from estimator.access.copies import Copies
from estimator.access.probe import probe
from estimator.access.recipe import Way
from fmus.errors import BadInput
from fmus.export.builders.hypotheses import ModelBuilder
from fmus.host.apart.channel import Channel, Garbled
from fmus.host.apart.free_run import FreeRun, simulate_apart
from fmus.host.apart.isolation import ISOLATED, FmuEnded, Isolation
from fmus.host.apart.memory import Memory
from fmus.host.apart.room import Room, room_of
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError
from fmus.host.master.master import Master
from fmus.host.watch import PAGE, STEPPING, WHAT, Page
from tests.fmus.test_codec import Harmful
from tests.helpers.foreign import GOOD

T = np.linspace(0.0, 1.0, 1001)
WAVE = 0.3 * np.sin(7 * T)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return ModelBuilder("drive", tmp_path_factory.mktemp("drive"))(())


@pytest.fixture(scope="module")
def every(drive, foreign, vdp):
    """FMUs in C and in Python, of ours and of others: file, input, outputs, start."""
    return {
        "drive": (drive, {"F": 50 * WAVE}, ["q", "q_dot"], {"q": 0.1, "M": 90.0}),
        "Python": (foreign(), {"u": WAVE}, ["x"], {"x": 0.3, "k": 1.0}),
        "FMI 3.0": (vdp, {"u": WAVE}, ["x0", "x1_dot"], {"x0": 1.0, "mu": 0.7}),
    }


KINDS = ("drive", "Python", "FMI 3.0")


@pytest.mark.parametrize("kind", KINDS)
def test_a_simulation_apart_is_that_of_this_process_to_the_bit(every, kind):
    path, inputs, outputs, start = every[kind]
    with Fmu(path) as here, Fmu(path, ISOLATED) as there:
        for n in (1001, 200, 1001):  # with the compiled loop and without it
            part = {name: u[:n] for name, u in inputs.items()}
            runs = [fmu.simulate(T[:n], part, outputs, start) for fmu in (here, there, there)]
            np.testing.assert_array_equal(runs[1], runs[0], strict=True)
            np.testing.assert_array_equal(runs[2], runs[0], strict=True)
        held = {name: u[:-1] for name, u in inputs.items()}
        runs = [fmu.simulate(T, held, outputs, start) for fmu in (here, there)]
        np.testing.assert_array_equal(runs[1], runs[0], strict=True)
        for fmu in (here, there):
            fmu.restart(0.5, **start)
            fmu.step(1e-3, **dict.fromkeys(inputs, 0.25))
        assert here.read(outputs) == there.read(outputs)
        assert here.time == there.time


@pytest.mark.parametrize("kind", KINDS)
def test_a_coupled_run_apart_is_that_of_this_process_to_the_bit(every, kind):
    path, [name] = every[kind][:2]
    wave = {f"a.{name}": lambda t: 0.2 * np.sin(9 * t)}
    found, told = [], []
    for isolation in (None, ISOLATED):
        with (
            Archive(path, isolation) as archive,
            Master({"a": archive}, step=1e-3, inputs=wave, record_step=2e-3) as master,
        ):
            found.append(master.run(0.3, lambda *progress: told.append(progress)))
    assert found[1].data.equals(found[0].data)
    assert found[1].units == found[0].units
    assert found[1].interrupted_at is None
    assert len(found[1].data) == 151
    assert told[-1][0] == pytest.approx(0.3)


@pytest.mark.parametrize("way", [Way.SET, Way.RESTART])
def test_steps_from_any_state_apart_are_those_of_this_process_to_the_bit(foreign, way):
    path, rows = foreign(), np.array([[1.0, 0.5, 0.1], [0.2, 1.3, 0.4]])
    put, get, start = ["x", "k", "u"], ["x"], {"x": 1.0, "k": 2.0, "u": 0.3}
    found, ways = [], []
    for isolation in (None, ISOLATED):
        with Archive(path, isolation) as archive:
            access = archive.called(probe, put, get, {}, start, 0.0, 0.01)
            ways.append((access.free_time, access.late, sorted(access.refused)))
            with archive.made(Copies, way, put, get, {}) as copies:
                assert list(copies.get) == get
                found.append([copies.advance(rows, 0.0, 0.01), copies.evaluate(rows, 0.01)])
    np.testing.assert_array_equal(found[1], found[0])
    assert ways[1] == ways[0]


def test_free_runs_apart(drive):
    run = FreeRun(T, {"F": 50 * WAVE}, {"q": 0.1, "M": 90.0})
    found = simulate_apart(drive, [run, run], ["q", "q_dot"])
    with Fmu(drive) as fmu:
        expected = fmu.simulate(run.t, run.inputs, ["q", "q_dot"], run.start)
    assert len(found) == 2
    for y in found:
        np.testing.assert_array_equal(y, expected, strict=True)


def test_a_refusal_comes_back_as_what_it_was(foreign, tmp_path):
    run = FreeRun(T[:9], {}, {"x": 1.0})
    with pytest.raises(BadInput, match="no such FMU file"):
        simulate_apart(tmp_path / "gone.fmu", [run], ["x"])
    with pytest.raises(FmuError, match="step at t = 0 s"):
        simulate_apart(foreign("return False"), [run], ["x"])


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("os.abort()", r"fmi2DoStep at t = 0\.002 s ended the process that runs it \(Aborted\)"),
        ("os._exit(0)", r"fmi2DoStep at t = 0\.002 s ended the process that runs it \(exit code 0\)"),
        ("time.sleep(99)", r"fmi2DoStep at t = 0\.002 s did not come back within 1 s \(--call-limit\)"),
        ("print('no root found', flush=True)\n    os.abort()", "its last words: no root found"),
    ],
)
def test_the_end_of_a_process_is_told_with_call_and_time(foreign, body, words):
    path = foreign(f"if t > 1.5e-3:\n    {body}\n{GOOD}")
    with Fmu(path, Isolation(call=1.0)) as fmu:
        with pytest.raises(FmuEnded, match=words) as ended:
            fmu.simulate(T[:9], {"u": WAVE[:9]}, ["x"], {"x": 1.0})
        assert path.name in str(ended.value)
        assert "\n" not in str(ended.value)
        with pytest.raises(FmuEnded):  # it stays ended
            fmu.restart()
    with Fmu(foreign(), Isolation(call=1.0)) as fmu:  # the next FMU gets a process that lives
        fmu.restart(x=0.5)
        assert fmu["x"] == 0.5


def test_a_simulation_that_only_creeps_has_its_limit(foreign):
    with Fmu(foreign("time.sleep(0.05)\n" + GOOD), Isolation(run=4.0)) as fmu:
        fmu.restart(x=1.0)
        words = r"fmi2DoStep at t = \S+ s was only reached after 4 s, .* \(--run-limit\)"
        with pytest.raises(FmuEnded, match=words):
            fmu.simulate(T, {"u": WAVE}, ["x"], {"x": 1.0})


def report_on(function):
    while True:
        time.sleep(0.05)
        function(1.0)


def test_progress_that_is_told_does_not_renew_the_limit_of_a_simulation():
    with Room(Isolation(run=1.0)) as room, pytest.raises(FmuEnded, match="after 1 s"):
        room.call(report_on, room.function(lambda _: None))


def test_an_interrupt_ends_the_process_at_once():
    def interrupt(*_):
        raise KeyboardInterrupt

    with Room(ISOLATED) as room:
        with pytest.raises(KeyboardInterrupt):
            room.call(map_once, room.function(interrupt))
        assert room.ended
        with pytest.raises(FmuEnded, match="interrupted"):
            room.call(operator.neg, 1)


def map_once(function):
    return function(1.0)


def test_functions_of_this_process_are_called_from_there():
    with Room(ISOLATED) as room:
        assert room.call(map_once, room.function(lambda x: x + 1)) == 2.0
        with pytest.raises(BadInput, match="not today"):
            room.call(map_once, room.function(refuse))
        assert not room._functions  # nothing of a call is kept


def refuse(_):
    raise BadInput("not today")


def test_objects_there_go_with_what_stands_for_them():
    with Room(ISOLATED) as room:
        before = room.call(kept)
        away = room.make(dict, a=1)
        assert room.call(kept) == before + 1
        del away
        room.call(kept)
        assert room.call(kept) == before


def kept():
    from fmus.host.apart import serving

    return len(serving.KEPT)


def test_a_room_is_shared_until_it_ends():
    room = room_of(ISOLATED)
    assert room_of(Isolation()) is room
    room.close()
    assert room_of(ISOLATED) is not room


@contextmanager
def ends():
    """Both ends of a channel in one process, of which the first does not believe the second."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    memory = Memory(64)
    with here, there:
        yield Channel(here, memory, False), Channel(there, Memory(name=memory.name), True)


NUMBERS = st.floats(allow_nan=True) | st.integers() | st.booleans() | st.text() | st.none()
VALUES = st.recursive(
    NUMBERS | arrays(np.float64, st.tuples(st.integers(0, 40), st.integers(0, 5))),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def same(a, b):
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and np.array_equal(a, b, equal_nan=True)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b))


@settings(max_examples=60)
@given(VALUES)
def test_values_come_through_as_they_are(value):
    with ends() as (here, there):
        there.send(value)
        assert same(value, here.receive())
        here.send(value)
        assert same(value, there.receive())


def test_exceptions_come_through_whatever_a_library_has_registered_for_them():
    """Dask's tblib does so for every class of exception that is there when it is imported."""
    copyreg.pickle(BadInput, lambda error: (print, error.args))
    try:
        with ends() as (here, there):
            there.send(BadInput("not today"))
            found = here.receive()
    finally:
        del copyreg.dispatch_table[BadInput]
    assert isinstance(found, BadInput)
    assert found.args == ("not today",)


@pytest.mark.parametrize("planted", ["harmful", print, np.load], ids=["harmful", "print", "load"])
def test_what_comes_from_there_runs_nothing(tmp_path, planted):
    mark = tmp_path / "ran"
    with ends() as (here, there):
        there.send(Harmful(mark) if planted == "harmful" else planted)
        with pytest.raises(Garbled):
            here.receive()
    assert not mark.exists()


@given(st.binary(max_size=300))
def test_damage_from_there_is_told_as_such(data):
    with ends() as (here, there), contextlib.suppress(Garbled):
        there._memory.reserve(1024)
        there._memory.map[: len(data)] = data
        there.connection.send(np.array([len(there._memory.map), len(data)], dtype="<u8").tobytes())
        assert not callable(here.receive())


def test_a_process_that_is_damaged_is_ended(monkeypatch):
    with Room(ISOLATED) as room:
        monkeypatch.setattr(room._channel, "_loads", lambda *_, **__: pickle.loads(b"nothing"))
        with pytest.raises(FmuEnded, match="damaged the process that runs it"):
            room.call(operator.neg, 1)


def test_the_page_says_what_is_done():
    page = Page()
    page.idle()
    assert page.doing() is None
    who = page.enrolled("one.fmu", fmi3=True)
    page.stepping(who, 0.25)
    assert str(page.doing()) == "one.fmu: fmi3DoStep at t = 0.25 s"
    page.calling(page.enrolled("two.fmu", fmi3=False), "fmi2Reset")
    assert str(page.doing()).startswith("two.fmu: fmi2Reset")
    before = page.progress()
    page.stepping(who, 0.25)
    assert page.progress() != before
    for i in range(20):
        page.heard(f"line {i} " + "x" * 1000)
    assert [line[:8].strip() for line in page.lines()] == [f"line {i}" for i in range(12, 20)]


def test_every_step_here_is_noted_too(foreign):
    with Fmu(foreign()) as fmu:
        fmu.simulate(T[:5], {"u": WAVE[:5]}, ["x"], {"x": 1.0})
        assert PAGE.time[0] == T[3]
        assert PAGE.cells[WHAT] % 8 != STEPPING  # it read outputs last


def test_a_child_of_an_fmu_does_not_keep_it_waiting(foreign):
    step = f"if t > 1.5e-3:\n    if os.fork() == 0:\n        time.sleep(60)\n    os._exit(0)\n{GOOD}"
    begun = time.monotonic()
    with Fmu(foreign(step), ISOLATED) as fmu, pytest.raises(FmuEnded, match="exit code 0"):
        fmu.simulate(T[:9], {"u": WAVE[:9]}, ["x"], {"x": 1.0})
    assert time.monotonic() - begun < 30  # its own 60 s
