"""PythonFMU builds: their numbers, and the traps of an interpreter that all FMUs share."""

import os
import shutil
import subprocess
import sys
import textwrap
from array import array
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fmus.export.builders.pythonfmu import build_python
from fmus.export.runtime.stepping import Stepper
from fmus.export.runtime.symbolic import on_memory
from fmus.host.archive import Archive
from fmus.host.fmi2 import Fmi2Instance
from fmus.host.fmu import Fmu
from fmus.host.instance import MESSAGES
from fmus.model import equations
from fmus.models import MODELS
from fmus.variables import Output, State
from tests.helpers.everything import near_start, values
from tests.helpers.runs import (
    DT,
    every_model,
    heavier,
    names,
    run,
    start_of,
    stirred,
)
from tests.helpers.sizes import by_size


def shortened(step, x, u, p):
    """States after DT by the rule for shorter steps, which has tests of its own."""
    x, u, p = (memoryview(array("d", v)) for v in (x, u, p))
    assert Stepper(partial(on_memory, step), x, u, p, DT).advance(DT)
    return np.array(x)


@every_model
@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_the_equations_step(built, name, seed):
    model, rng = MODELS[name](), np.random.default_rng(seed)
    made, (x, u, p) = equations(model), near_start(model, rng)
    with Fmu(built(name)) as fmu:
        fmu.restart(**start_of(model, (x, u, p)))
        assert_allclose(fmu.read(names(model, Output)), values(made.h, x, u, p), rtol=1e-9)
        for row in stirred(model, rng):
            u = np.array(list(row.values()))
            x1, error = made.step(x, u, p, DT)
            # a stiff contact under inputs that jump may ask for shorter steps
            x = x1.full().ravel() if float(error) <= 1 else shortened(made.step, x, u, p)
            fmu.step(DT, **row)
            assert_allclose(fmu.read(names(model, State)), x, rtol=1e-9)
            assert_allclose(fmu.read(names(model, Output)), values(made.h, x, u, p), rtol=1e-9)


@by_size
def test_effects_built_in_change_nothing_until_they_are_switched_on(built, name):
    model = MODELS[name]()
    outputs, rows = [], stirred(model, np.random.default_rng(2))
    for path in (built(name), built(name, "all")):
        with Fmu(path) as fmu:
            fmu.restart()
            own = [name in model.variables for name in fmu.description.outputs]
            outputs.append(run(fmu, rows)[:, own])
    # exact in f and h; a step solves with another order of the same operations
    assert_allclose(outputs[1], outputs[0], rtol=1e-9, atol=1e-12)


@every_model
def test_a_communication_step_is_as_good_as_its_parts(built, name):
    """One long step against ten short ones with the same inputs, both within the model's tolerance."""
    model = MODELS[name]()
    start = start_of(model, near_start(model, np.random.default_rng(8)))
    ends = []
    with Fmu(built(name)) as fmu:
        for parts in (1, 10):
            fmu.restart(**start)
            for _ in range(parts):
                fmu.step(2 * model.step_size / parts)
            ends.append(fmu.read(names(model, State)))
    nominal = np.array([v.nominal for v in model.of(State)])
    assert_allclose(np.subtract(*ends) / nominal, 0, atol=10 * model.tolerance)


def test_two_versions_of_one_fmu_keep_to_themselves(tmp_path):
    light, heavy = build_python(heavier(50.0), tmp_path / "a"), build_python(heavier(200.0), tmp_path / "b")
    assert light.name == heavy.name
    for first, second, masses in ((light, heavy, (50, 200)), (heavy, light, (200, 50))):
        with Fmu(first) as one, Fmu(second) as two:
            one.restart(F_v=0.0)
            two.restart(F_v=0.0)
            for _ in range(5):
                one.step(0.1, F=100.0)
                two.step(0.1, F=100.0)
            assert_allclose([one["q_dot"], two["q_dot"]], [0.5 * 100 / mass for mass in masses], rtol=1e-12)


def test_versions_with_and_without_an_effect_live_side_by_side(built):
    with Fmu(built("drive")) as bare, Fmu(built("drive", "constant_force@carriage")) as braked:
        bare.restart(F_v=0.0)
        braked.restart(F_v=0.0, constant_force_carriage_F_0=95.0)
        for _ in range(3):
            bare.step(0.1, F=95.0)
            braked.step(0.1, F=95.0)
        assert bare["q_dot"] == pytest.approx(0.3)
        assert braked["q_dot"] == 0.0


@every_model
def test_loaded_and_freed_again_and_again(built, name):
    rows, seen = stirred(MODELS[name](), np.random.default_rng(1), 5), []
    for _ in range(5):
        with Fmu(built(name)) as fmu:
            folder = fmu._own.folder
            fmu.restart()
            seen.append(run(fmu, rows))
        assert not folder.exists()
    assert_array_equal(seen[1:], [seen[0]] * 4)


def test_two_loads_of_one_file_at_once(built):
    rows = stirred(MODELS["testrig"](), np.random.default_rng(1), 5)
    with Archive(built("testrig")) as one, Archive(built("testrig")) as two:
        a, b = Fmu(one), Fmu(two)
        for fmu in (a, b):
            fmu.restart()
        together = [[run(fmu, [row]) for row in rows] for fmu in (a, b)]
        a.close()
        b.restart()
        assert_array_equal(run(b, rows), np.vstack(together[0]))
        b.close()
    assert_array_equal(together[0], together[1])


@every_model
def test_a_hundred_instances_do_not_meet(built, name):
    model = MODELS[name]()
    state, rng = names(model, State)[0], np.random.default_rng(0)
    starts = rng.uniform(0.1, 1, 100)
    row = stirred(model, rng, 1)[0]
    with Archive(built(name)) as archive:
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


def test_a_build_leaves_no_trace_in_the_interpreter(tmp_path):
    path, modules, here = sys.path.copy(), set(sys.modules), Path.cwd()
    build_python(heavier(61.0), tmp_path)
    assert (sys.path, Path.cwd()) == (path, here)
    assert not [name for name in set(sys.modules) - modules if name.startswith("Drive")]


def test_a_run_leaves_no_trace_in_the_path(built):
    path, here = sys.path.copy(), Path.cwd()
    with Fmu(built("drive")) as fmu:
        fmu.restart()
        fmu.step(DT)
    assert (sys.path, Path.cwd()) == (path, here)


def test_a_build_after_a_run_in_the_same_process(built, tmp_path):
    script = """
        import sys
        from fmus.host.fmu import Fmu
        with Fmu(sys.argv[1]) as fmu:
            fmu.restart()
            fmu.step(1e-3)
        from pathlib import Path
        from fmus.export.builders.pythonfmu import build_python
        from fmus.models import MODELS
        with Fmu(build_python(MODELS["testrig"](), Path(sys.argv[2]))) as fmu:
            fmu.restart()
            fmu.step(1e-3)
            print(fmu["omega_r"] > 0)
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(built("drive")), str(tmp_path)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
    assert (tmp_path / "Testrig.fmu").read_bytes() == built("testrig").read_bytes()


@by_size
def test_an_fmu_runs_where_this_repository_is_not(built, name, tmp_path):
    """Isolated, without the .pth file that makes an editable install visible, with FMPy alone."""
    script = """
        import sys
        sys.path.append(sys.argv[2])
        try:
            import fmus
        except ImportError:
            from fmpy import simulate_fmu
            result = simulate_fmu(sys.argv[1], stop_time=0.1, output_interval=0.01)
            print(len(result), all(abs(row[name]) < 1e9 for row in result for name in result.dtype.names))
    """
    site = Path(np.__file__).parents[1]
    command = [sys.executable, "-I", "-S", "-c", textwrap.dedent(script), str(built(name, "all")), str(site)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "11 True", "")


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
@pytest.mark.parametrize("ours", [True, False])
@pytest.mark.slow
def test_the_end_of_a_process_touches_no_freed_memory(built, foreign, tmp_path, ours):
    """PythonFMU 0.7 frees its interpreter twice, and now and then the host aborts."""
    script = """
        import sys
        from fmus.host.fmu import Fmu
        with Fmu(sys.argv[1]) as fmu:
            fmu.restart()
            fmu.step(1e-3)
    """
    path, log = (built("drive") if ours else foreign()), tmp_path / "log"
    check = ["valgrind", f"--log-file={log}", "--undef-value-errors=no", sys.executable, "-c"]
    surroundings = os.environ | {"PYTHONMALLOC": "malloc"}
    subprocess.run([*check, textwrap.dedent(script), str(path)], env=surroundings, check=True)
    assert "ERROR SUMMARY" in log.read_text()
    assert "finalizePythonInterpreter" not in log.read_text()


def test_instance_messages_are_forgotten_with_it(built):
    before = len(MESSAGES)
    with Archive(built("drive")) as archive:
        instance = Fmi2Instance(archive, "one")
        assert len(MESSAGES) == before + 1
        instance.close()
    assert len(MESSAGES) == before
