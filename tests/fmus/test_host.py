"""The host: restart, run and read by name, and refusals of a running FMU."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError

finite = st.floats(-1e3, 1e3)


@pytest.fixture
def drive(built):
    return built("drive")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda f: f["q_dott"], "has no variable 'q_dott'; did you mean 'q_dot'"),
        (lambda f: f.step(0.1, Force=1.0), "has no variable 'Force'"),
        (lambda f: f.restart(mass=1.0), "has no variable 'mass'"),
        (lambda f: f.read(["q", "M", "f_v"]), "has no variable 'f_v'; did you mean 'F_v'"),
        (lambda f: f.set(xyz=1.0), "has no variable 'xyz'; known are F, F_ext, F_v, M, q"),
        (lambda f: f.simulate(np.arange(3.0), {}, ["speed"], {}), "has no variable 'speed'"),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(drive, call, words):
    with Fmu(drive) as fmu:
        fmu.restart()
        with pytest.raises(BadInput, match=rf"Drive.fmu: {words}"):
            call(fmu)


@settings(max_examples=30)
@given(q=finite, q_dot=finite, F=finite, mass=st.floats(1, 1e3), t0=st.floats(-10, 1e6))
def test_restart_from_any_state_at_any_time(drive_now, q, q_dot, F, mass, t0):
    drive_now.restart(t0, q=q, q_dot=q_dot, F=F, M=mass)
    assert drive_now.read(["q", "q_dot", "F", "M"]) == [q, q_dot, F, mass]
    assert drive_now.time == t0
    assert_allclose(drive_now["q_ddot"], (F - 200 * q_dot) / mass, rtol=1e-12, atol=1e-9)
    drive_now.step(1e-3)
    assert drive_now.time == t0 + 1e-3
    drive_now.restart()
    assert drive_now.read(["q", "q_dot", "F", "M", "q_ddot"]) == [0, 0, 0, 95, 0]


@pytest.fixture(scope="module")
def drive_now(built):
    with Fmu(built("drive")) as fmu:
        yield fmu


def test_step_holds_inputs_and_keeps_time(drive):
    with Fmu(drive) as fmu:
        fmu.restart(2.0, F_v=0.0)
        for _ in range(4):
            fmu.step(0.25, F=95.0)
        assert fmu.time == pytest.approx(3.0)
        assert_allclose(fmu.read(["q", "q_dot", "q_ddot"]), [0.5, 1.0, 1.0], rtol=1e-12)


def test_an_fmu_is_closed_once_and_of_no_use_afterwards(drive):
    with Fmu(drive) as fmu:
        fmu.restart()
        fmu.close()
        fmu.close()
        with pytest.raises(FmuError, match="it is closed"):
            fmu.restart()
        with pytest.raises(FmuError, match="it is closed"):
            fmu.step(0.1)


@pytest.mark.parametrize("inputs", [{}, {"F": 1.0}, {"F": 1.0, "F_ext": -0.5}])
def test_simulate_is_step_by_step(drive, inputs):
    t = np.linspace(1.0, 2.0, 21) ** 2
    u = {name: scale * np.sin(t[:-1]) for name, scale in inputs.items()}
    names, first = ["q_ddot", "q"], {"q_dot": 0.3, "M": 50.0}
    with Fmu(drive) as fmu:
        fast = fmu.simulate(t, u, names, first)
        assert fmu.time == t[-1]
        fmu.restart(t[0], **first, **{name: values[0] for name, values in u.items()})
        slow = [fmu.read(names)]
        for k, dt in enumerate(np.diff(t)):
            fmu.time = t[k]
            fmu.step(dt, **{name: values[k] for name, values in u.items()})
            slow.append(fmu.read(names))
    assert_array_equal(fast, slow)


def test_simulate_says_where_it_stopped(drive):
    with Fmu(drive) as fmu:
        u = np.array([1.0, 1.0, np.nan, 1.0])
        with pytest.raises(FmuError, match=r"Drive.fmu: step at t = 0.2 s: .*F = nan is not a finite number"):
            fmu.simulate(np.arange(5) / 10, {"F": u}, ["q"], {})
        with pytest.raises(FmuError, match=r"step at t = 0.3 s: .*not positive"):
            fmu.simulate(np.array([0.0, 0.1, 0.3, 0.2]), {}, ["q"], {})
        assert fmu.simulate(np.arange(3.0), {}, ["q"], {}).tolist() == [[0.0]] * 3


def test_an_old_reason_is_not_given_for_a_new_failure(drive, monkeypatch):
    with Fmu(drive) as fmu:
        fmu.restart(M=np.nan)
        with pytest.raises(FmuError, match="M = nan"):
            fmu.step(0.1)
        fmu.restart()
        monkeypatch.setattr(fmu._instance, "stepper", lambda: lambda *_: 3)
        with pytest.raises(FmuError) as refused:
            fmu.step(0.1)
        assert str(refused.value) == "Drive.fmu: fmi2DoStep failed with status 3 (error)"


def failing(error):
    """A call that always fails."""

    def call(*_):
        raise error

    return call


def test_no_call_is_made_after_a_fatal_failure(drive, monkeypatch):
    """Not even to free the instance: the standard forbids it, and PythonFMU's crashes."""
    with Fmu(drive) as fmu:
        fmu.restart()
        slave = fmu._instance._slave
        monkeypatch.setattr(fmu._instance, "stepper", lambda: lambda *_: 4)
        for name in ("reset", "getReal", "setReal", "freeInstance"):
            monkeypatch.setattr(slave, name, failing(AssertionError(f"{name} was called")))
        with pytest.raises(FmuError, match="status 4"):
            fmu.step(0.1)
        for call in (fmu.restart, lambda: fmu["q"], lambda: fmu.set(F=1.0)):
            with pytest.raises(FmuError, match=r"cannot be used any more after a fatal failure \(fmi2DoStep"):
                call()
        with pytest.raises(FmuError, match="cannot be used any more"):
            fmu.simulate(np.arange(3.0), {}, ["q"], {})


def test_one_archive_serves_many_and_outlives_them(drive):
    with Archive(drive) as archive:
        for _ in range(3):
            with Fmu(archive) as fmu:
                fmu.restart()
                fmu.step(0.1)
            assert archive.folder.is_dir()
    assert not archive.folder.exists()


def test_a_library_that_is_none(drive):
    here = Path.cwd()
    with Archive(drive) as archive:
        for library in archive.folder.glob("binaries/*/*"):
            library.write_bytes(b"no library")
        with pytest.raises(FmuError, match=r"Drive\.fmu: Failed to load shared library"):
            Fmu(archive)
    assert Path.cwd() == here


def test_an_fmu_that_cannot_start_says_why(drive):
    with Archive(drive) as archive:
        resources = archive.folder / "resources"
        (resources / "entry_of_this_test.py").write_text("import a_package_that_is_not_installed\n")
        (resources / "slavemodule.txt").write_text("entry_of_this_test")
        with pytest.raises(FmuError, match="No module named 'a_package_that_is_not_installed'") as refused:
            Fmu(archive)
    assert "\n" not in str(refused.value)


def test_a_simulation_as_a_table_has_names_times_and_units(drive):
    t = np.linspace(0.0, 1.0, 11)
    force = 50 * np.sin(t)
    with Fmu(drive) as fmu:
        table = fmu.simulate_frame(t, {"F": force}, ["q_dot", "q"], {"q": 2.0})
        assert_array_equal(table.to_numpy(), fmu.simulate(t, {"F": force}, ["q_dot", "q"], {"q": 2.0}))
        assert table.index.name == "time"
        assert_array_equal(table.index, t)
        assert table.attrs["units"] == {"q_dot": "m/s", "q": "m"}
        held = fmu.simulate_frame(t, {"F": 50.0})
        assert list(held) == list(fmu.description.outputs)
        assert_array_equal(held["q"], fmu.simulate(t, {"F": np.full(11, 50.0)}, ["q"], {})[:, 0])
        with pytest.raises(BadInput, match="input 'F' has 3 samples for 11 times"):
            fmu.simulate_frame(t, {"F": force[:3]})


def test_an_fmu_says_what_it_is(drive):
    with Fmu(drive) as fmu:
        fmu.restart(1.5)
        shown = repr(fmu)
    assert "Drive.fmu), FMI 2.0: " in shown
    assert f"{len(fmu.description.outputs)} outputs" in shown
    assert shown.endswith("at 1.5 s>")
