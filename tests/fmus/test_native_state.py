"""What an instance of a native FMU keeps and refuses: errors with a sentence, nothing changed by them."""

import re
from contextlib import contextmanager

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Model,
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from fmpy.fmi3 import FMU3Model, FMU3Slave
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError
from fmus.host.instance import CallFailed
from fmus.models import MODELS
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from tests.helpers.everything import near_start
from tests.helpers.native import every_version, native
from tests.helpers.runs import (
    DT,
    names,
    run,
    start_of,
    stirred,
)
from tests.helpers.sizes import by_size


def wrongs(model):
    """Calls that cannot be done on a running instance, with words of the reason."""
    p, y, x, u = (names(model, k)[0] for k in (Parameter, Output, State, Input))
    fixed = [v.name for v in model.of(Parameter) if v.fixed]
    found = {
        "NaN": (lambda fmu: fmu.set(**{p: np.nan}), f"{p} = nan is not a finite number"),
        "infinite": (lambda fmu: fmu.set(**{u: np.inf}), f"{u} = inf is not a finite number"),
        "out of range": (lambda fmu: fmu.set(**{p: -1.0}), f"{p} = -1 is outside"),
        "second of two": (lambda fmu: fmu.set(**{u: 1.0, p: -1.0}), f"{p} = -1 is outside"),
        "computed": (lambda fmu: fmu.set(**{y: 1.0}), "is computed and cannot be set"),
        "state": (lambda fmu: fmu.set(**{x: 1.0}), f"state {x} cannot be set while running; reset"),
        "backwards": (lambda fmu: fmu._instance.step(fmu.time - DT, DT), "but the instance is at"),
        "ahead": (lambda fmu: fmu._instance.step(fmu.time + DT, DT), "but the instance is at"),
        "no time": (lambda fmu: fmu._instance.step(np.nan, DT), "time nan s is not finite"),
        "no step": (lambda fmu: fmu.step(0.0), "step size 0 s is not positive"),
        "step back": (lambda fmu: fmu.step(-DT), "step size -0.0001 s is not positive"),
        "endless": (lambda fmu: fmu.step(np.inf), "step size inf s is not positive and finite"),
        "unknown state": (lambda fmu: fmu.deserialised(b"nonsense"), "not one of this FMU"),
        "unknown to set": (
            lambda fmu: fmu._instance.set([9999], [0.0]),
            "no variable has the reference 9999",
        ),
        "unknown to get": (lambda fmu: fmu._instance.get([9999]), "no variable has the reference 9999"),
        "initialised twice": (
            lambda fmu: fmu._instance._call(fmu._instance._slave.exitInitializationMode),
            "not allowed now, the instance is in this state: step mode",
        ),
    }
    if fixed:
        found["fixed"] = (lambda fmu: fmu.set(**{fixed[0]: 1.0}), f"parameter {fixed[0]} is fixed; reset")
    return found


@by_size
@every_version
def test_what_cannot_be_done_is_refused_with_its_reason_and_changes_nothing(name, fmi):
    model = MODELS[name]()
    rows = stirred(model, np.random.default_rng(3), 6)
    with Archive(native(name, fmi=fmi)) as archive, Fmu(archive) as fmu, Fmu(archive) as other:
        for what, (wrong, reason) in wrongs(model).items():
            for instance in (fmu, other):
                instance.restart()
                run(instance, rows[:3])
            time = fmu.time
            with pytest.raises((FmuError, CallFailed), match=re.escape(reason)) as caught:
                wrong(fmu)
            assert "error" in str(caught.value), what
            fmu.time = time
            assert_array_equal(run(fmu, rows[3:]), run(other, rows[3:]), err_msg=what)


@every_version
def test_a_run_away_is_discarded_and_leaves_the_state(fmi):
    with Fmu(native("drive", fmi=fmi)) as fmu:
        fmu.restart(M=1e-3, F_v=1e200, q=0.5, q_dot=1e200)
        with pytest.raises(FmuError, match=r"discard.*no step is short enough after t = 0 s"):
            fmu.step(1e-3)
        assert fmu.read(["q", "q_dot"]) == [0.5, 1e200]
        fmu.set(F_v=0.0)
        fmu.step(1e-3)
        fmu.restart()
        fmu.step(1e-3)


@by_size
@every_version
def test_a_saved_state_is_all_there_is(name, fmi):
    """Saved, restored, as bytes, into an instance that never ran: bitwise, parameters and all."""
    model, rng = MODELS[name](), np.random.default_rng(5)
    before, after = stirred(model, rng), stirred(model, rng)
    parameters = {v.name: 1.1 * v.start for v in model.of(Parameter) if not v.fixed and v.max is None}
    with Archive(native(name, fmi=fmi)) as archive, Fmu(archive) as fmu, Fmu(archive) as fresh:
        fmu.restart(**parameters)
        run(fmu, before)
        saved = fmu.save()
        data = fmu.serialised(saved)
        expected = run(fmu, after)
        fmu.set(**{p: v.start for p, v in model.variables.items() if p in parameters})
        run(fmu, before)
        fmu.restore(saved)
        assert_array_equal(fmu.read(list(parameters)), list(parameters.values()))
        assert_array_equal(run(fmu, after), expected)
        other = fresh.deserialised(data)
        fresh.restore(other)
        assert fresh.serialised(other) == data
        assert_array_equal(run(fresh, after), expected)
        fmu.forget(saved)
        fresh.forget(other)


@every_version
def test_a_damaged_or_foreign_state_is_refused(fmi):
    with Fmu(native("drive", fmi=fmi)) as drive, Fmu(native("testrig", fmi=fmi)) as rig:
        for fmu in (drive, rig):
            fmu.restart()
            run(fmu, [{}] * 3)
        data = drive.serialised(drive.save())
        wrong = [data[:-1], b"", data[:-4] + b"\x03\0\0\0", data[:40] + b"\xff" * 8 + data[48:], data[::-1]]
        for broken in (*wrong, rig.serialised(rig.save())):
            with pytest.raises(FmuError, match=r"not one of this FMU|null pointer"):
                drive.deserialised(broken)
        drive.restore(drive.deserialised(data))
        run(drive, [{}])


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), middle=st.integers(1, 9))
@by_size
@every_version
def test_a_run_goes_on_from_the_values_it_shows(name, fmi, seed, middle):
    model, rng = MODELS[name](), np.random.default_rng(seed)
    rows, begin = stirred(model, rng, 10), start_of(model, near_start(model, rng))
    with Archive(native(name, fmi=fmi)) as archive, Fmu(archive) as fmu, Fmu(archive) as other:
        fmu.restart(**begin)
        run(fmu, rows[:middle])
        shown = dict(zip(names(model, State), fmu.read(names(model, State)), strict=True))
        other.restart(fmu.time, **{**begin, **shown})
        assert_array_equal(run(other, rows[middle:]), run(fmu, rows[middle:]))


@by_size
@every_version
def test_a_hundred_instances_do_not_meet(name, fmi):
    model = MODELS[name]()
    state, rng = names(model, State)[0], np.random.default_rng(0)
    starts, row = rng.uniform(0.1, 1, 100), stirred(model, rng, 1)[0]
    with Archive(native(name, fmi=fmi)) as archive:
        with Fmu(archive) as fmu:
            alone = []
            for x in starts:
                fmu.restart(**{state: x})
                alone.append(run(fmu, [row] * 2)[-1])
        many = [Fmu(archive) for _ in starts]
        for fmu, x in zip(many, starts, strict=True):
            fmu.restart(**{state: x})
        for _ in range(2):
            together = [run(fmu, [row])[0] for fmu in many]
        for fmu in many:
            fmu.close()
    assert_array_equal(together, alone)


@contextmanager
def made(fmi, exchange, said, token=None, name="one", **more):
    """An instance by FMPy; what it says goes into `said`."""
    kinds = {(2, False): FMU2Slave, (2, True): FMU2Model, (3, False): FMU3Slave, (3, True): FMU3Model}
    with Archive(native("drive", fmi=fmi)) as archive:
        d = archive.description
        fmu = kinds[fmi, exchange](
            guid=token or d.guid,
            unzipDirectory=str(archive.folder),
            modelIdentifier=d.identifier,
            instanceName=name,
        )
        if fmi == 2:
            fmu.instantiate(callbacks=_heard(said))
        else:
            fmu.instantiate(logMessage=lambda *a: said.append(a[-1].decode()), **more)
        yield fmu
        fmu.freeInstance()


def _heard(said):
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: said.append(a[4].decode()))
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    return callbacks


@every_version
@pytest.mark.parametrize("exchange", [False, True])
@pytest.mark.parametrize(
    ("wrong", "words"), [({"token": "{x}"}, "the token given is not"), ({"name": ""}, "no name")]
)
def test_no_instance_without_the_right_token_and_a_name(fmi, exchange, wrong, words):
    said = []
    with pytest.raises(Exception, match=r"(?i)instantiate"), made(fmi, exchange, said, **wrong):
        pass
    assert words in said[-1]


@every_version
def test_order_of_calls_is_kept(fmi):
    said = []
    with made(fmi, True, said) as fmu:
        early = [fmu.enterContinuousTimeMode, fmu.exitInitializationMode, fmu.terminate]
        for call in early:
            with pytest.raises(FMICallException, match=r"status 3"):
                call()
            assert "the instance is in this state: instantiated" in said[-1]
        fmu.enterInitializationMode()
        with pytest.raises(FMICallException):
            fmu.enterInitializationMode()
        assert "initialization mode" in said[-1]
        fmu.exitInitializationMode()
        with pytest.raises(FMICallException):
            fmu.setTime(np.nan)
        assert "time nan s is not finite" in said[-1]
        put = fmu.setReal if fmi == 2 else fmu.setFloat64
        put([4], [90.0])  # M, in event mode
        fmu.enterContinuousTimeMode()
        with pytest.raises(FMICallException):
            put([4], [95.0])
        assert said[-1].endswith("parameter M can change in event mode only")
        put([2], [10.0])  # F
        fmu.terminate()
        with pytest.raises(FMICallException):
            put([2], [10.0])
        fmu.reset()
        fmu.enterInitializationMode()


@every_version
def test_logging_by_category(fmi):
    said = []
    with made(fmi, False, said) as fmu:
        for on, heard in ((False, 0), (True, 1)):
            fmu.setDebugLogging(on, ["logStatusError"])
            with pytest.raises(FMICallException):
                fmu.exitInitializationMode()
            assert len(said) == heard
        with pytest.raises(FMICallException):
            fmu.setDebugLogging(True, ["50 %s"])
        # the logger of FMI 2.0 formats what it gets
        assert said[-1].endswith("unknown category '50 %%s'" if fmi == 2 else "unknown category '50 %s'")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"eventModeUsed": True}, "no event mode"),
        ({"requiredIntermediateVariables": [0]}, "no intermediate updates"),
    ],
)
def test_what_fmi3_can_ask_for_beyond_is_refused(more, words):
    said = []
    with pytest.raises(Exception, match=r"(?i)instantiate"), made(3, False, said, **more):
        pass
    assert words in said[-1]
