"""What an instance of a PythonFMU build keeps and refuses: no hidden state, no call that ends the host."""

import json
import re
import subprocess
import sys
import textwrap
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from fmus.drive.model import Drive
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError
from fmus.models import MODELS
from fmus.variables import Output, Parameter, State
from tests.helpers.everything import near_start
from tests.helpers.runs import (
    DT,
    every_model,
    names,
    run,
    start_of,
    stirred,
)
from tests.helpers.sizes import by_size


def wrongs(model):
    """Calls that cannot be done, with words of the reason."""
    p, y = names(model, Parameter)[0], names(model, Output)[0]
    return {
        "NaN": (lambda fmu: fmu.step(DT, **{p: np.nan}), f"{p} = nan is not a finite number"),
        "infinite": (lambda fmu: fmu.step(DT, **{p: np.inf}), f"{p} = inf is not a finite number"),
        "out of range": (lambda fmu: fmu.step(DT, **{p: -1.0}), f"{p} = -1 is outside"),
        "computed": (lambda fmu: fmu.step(DT, **{y: 1.0}), f"{y} is computed and cannot be set"),
        "backwards": (lambda fmu: fmu.step(-DT), "step size -0.0001 s is not positive"),
        "no step": (lambda fmu: fmu.step(0.0), "step size 0.0 s is not positive"),
        "endless": (lambda fmu: fmu.step(np.inf), "step size inf s is not positive and finite"),
        "wrong type": (
            lambda fmu: (fmu._instance._slave.getInteger([0]), fmu.step(DT)),
            "Real variables only",
        ),
        "wrong reference": (lambda fmu: (fmu._instance.get([9999]), fmu.step(DT)), "get_real"),
    }


@by_size
@pytest.mark.parametrize("what", wrongs(Drive()))
def test_what_cannot_be_done_is_discarded_with_its_reason(built, name, what):
    model = MODELS[name]()
    wrong, reason = wrongs(model)[what]
    rows = stirred(model, np.random.default_rng(3), 5)
    with Fmu(built(name)) as fmu:
        fmu.restart()
        expected = run(fmu, rows)
        with pytest.raises(FmuError, match=rf"{fmu.name}: .*discard.*{re.escape(reason)}"):
            wrong(fmu)
        fmu.restart()
        assert_array_equal(run(fmu, rows), expected)


def test_a_refused_value_stops_every_further_step_until_the_reset(built):
    with Fmu(built("drive")) as fmu:
        fmu.restart()
        fmu.set(M=np.nan)
        for _ in range(2):
            with pytest.raises(FmuError, match="M = nan"):
                fmu.step(DT)
        assert fmu["q"] == 0.0


def test_a_run_away_is_discarded_and_leaves_the_state(built):
    with Fmu(built("drive")) as fmu:
        fmu.restart(M=1e-3, F_v=1e200, q=0.5, q_dot=1e200)
        with pytest.raises(FmuError, match="no step is short enough"):
            fmu.step(1e-3)
        assert fmu.read(["q", "q_dot"]) == [0.5, 1e200]
        fmu.restart()
        fmu.step(1e-3)


@every_model
def test_a_saved_state_is_all_there_is(built, name):
    """Saved, restored, as bytes, into an instance that never ran: bitwise, parameters and all."""
    model, rng = MODELS[name](), np.random.default_rng(5)
    before, after = stirred(model, rng), stirred(model, rng)
    parameters = {v.name: 1.1 * v.start for v in model.of(Parameter) if not v.fixed and v.max is None}
    with Archive(built(name)) as archive, Fmu(archive) as fmu, Fmu(archive) as fresh:
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
        fresh.restart()
        other = fresh.deserialised(data)
        fresh.restore(other)
        assert fresh.serialised(other) == data
        assert_array_equal(run(fresh, after), expected)
        fmu.forget(saved)
        fresh.forget(other)


def test_a_state_of_another_fmu_is_refused(built):
    with Fmu(built("testrig")) as rig, Fmu(built("drive")) as drive:
        rig.restart()
        drive.restart()
        saved = rig.save()
        drive.restore(drive.deserialised(rig.serialised(saved)))
        with pytest.raises(FmuError, match="not one of this FMU; nothing was restored"):
            drive.step(DT)
        rig.forget(saved)


@settings(max_examples=30)
@given(where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7), cut=st.booleans())
def test_a_damaged_byte_of_a_state_is_never_taken_for_a_state(moving_drive, where, bit, cut):
    fmu, data = moving_drive
    place = int(where * len(data))
    wrong = data[:place] if cut else data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :]
    fmu.restart(q=0.5)
    fmu.restore(fmu.deserialised(wrong))
    assert "nothing was restored" in fmu.instance.messages[-1]  # said at once
    assert fmu["q"] == 0.5
    with pytest.raises(FmuError, match=r"damaged|not one of this FMU"):
        fmu.step(DT)


@pytest.fixture(scope="module")
def moving_drive(built):
    with Fmu(built("drive")) as fmu:
        fmu.restart(q=0.25, q_dot=1.0)
        fmu.step(DT)
        yield fmu, fmu.serialised(fmu.save())


@every_model
def test_an_instance_keeps_nothing_beside_its_values(built, name, tmp_path):
    """Attributes of the slave that a run changes are the values, the failure and scratch for one step."""
    with zipfile.ZipFile(built(name)) as packed:
        packed.extractall(tmp_path)
    module = (tmp_path / "resources" / "slavemodule.txt").read_text()
    script = f"""
        import json, sys
        sys.path.insert(0, {str(tmp_path / "resources")!r})
        import {module} as entry
        from array import array
        slave = entry.{MODELS[name].name}(instance_name="one", resources="")
        def picture(thing, path=""):
            for key, value in vars(thing).items():
                if hasattr(value, "__dict__") and type(value).__module__.startswith({MODELS[name].name!r}):
                    yield from picture(value, path + key + ".")
                else:
                    yield path + key, list(value) if isinstance(value, (array, memoryview)) else repr(value)
        slave.set_real([0, 1], [0.1, 0.2])
        slave.get_real([0])
        before = dict(picture(slave))
        for k in range(20):
            slave.do_step(k * 1e-3, 1e-3)
            slave.get_real([0])
        after = dict(picture(slave))
        print(json.dumps([key for key in after if after[key] != before.get(key)]))
    """
    out = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=True
    )
    changed = set(json.loads(out.stdout))
    scratch = {"stepper.x1", "stepper.h", "stepper.error", "stepper.x"}  # x is a view of the values
    assert "values" in changed
    assert changed <= {"values", "failure", "stale", *scratch}


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), middle=st.integers(1, 9))
@by_size
def test_a_run_goes_on_from_the_values_it_shows(built, name, seed, middle):
    model, rng = MODELS[name](), np.random.default_rng(seed)
    rows, start = stirred(model, rng, 10), start_of(model, near_start(model, rng))
    with Archive(built(name)) as archive, Fmu(archive) as fmu, Fmu(archive) as other:
        fmu.restart(**start)
        run(fmu, rows[:middle])
        shown = dict(zip(names(model, State), fmu.read(names(model, State)), strict=True))
        other.restart(fmu.time, **{**start, **shown})
        assert_array_equal(run(other, rows[middle:]), run(fmu, rows[middle:]))
