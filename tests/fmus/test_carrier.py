"""The native container of a foreign FMU takes the same steps as the container in Python."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

from fmus.drive.model import Drive
from fmus.errors import BadInput
from fmus.export.builders import hypotheses
from fmus.export.builders.hypotheses import ForeignBuilder
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container import carrier
from fmus.export.container.carrier import build_carrier
from fmus.export.container.coupled import build_coupled
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu, FmuError
from tests.helpers.native import DEFINED, STRICT, compiler, native
from tests.helpers.packed import alone, repacked
from tests.helpers.paths import ROOT

PORT = PortNames("carriage", "F_ext", "q_dot", "q")
BASES = {
    "native, FMI 2": lambda path: build_native(Drive(), path),
    "native, FMI 3": lambda path: build_native(Drive(), path, fmi=3),
    "PythonFMU": lambda path: build_python(Drive(), path),
}
EFFECTS = {
    "none": ((), {}),
    "laws at a port": (
        (("coulomb_friction", "carriage"), ("hysteresis", "carriage")),
        {"coulomb_friction_carriage_F_c": 20.0, "hysteresis_carriage_F_h": 35.0},
    ),
    "an input": ((("input_delay", "F"),), {"input_delay_F_share": 1.0, "input_delay_F_T": 0.05}),
    "a parameter": ((("parameter_drift", "F_v"),), {"parameter_drift_F_v_rate": 3.0}),
}
T = np.arange(801) * 2.5e-3  # s, more than one coupling step


@pytest.fixture(scope="module", params=BASES)
def base(request, tmp_path_factory):
    return BASES[request.param](tmp_path_factory.mktemp("base") / "drive.fmu")


def motion(path: Path, values: dict[str, float], force: np.ndarray | None = None) -> np.ndarray:
    """Outputs of two runs of one instance, one after the other."""
    force = 100 * np.sin(2 * T) + 30 * np.sin(25 * T) if force is None else force
    with Fmu(path) as fmu:
        known = {n: v for n, v in values.items() if n in fmu.description.variables}
        assert known == values
        names = fmu.description.outputs
        start = {"q": 0.01, "M": 90.0, **values}
        return np.vstack([fmu.simulate(T, {"F": force}, names, start) for _ in range(2)])


@pytest.mark.parametrize("kind", EFFECTS)
def test_both_containers_move_alike(base, kind, tmp_path):
    effects, values = EFFECTS[kind]
    native = build_carrier(base, (PORT,), effects, tmp_path / "native.fmu")
    python = build_coupled(base, (PORT,), effects, tmp_path / "python.fmu")
    found, expected = motion(native, values), motion(python, values)
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert np.array_equal(found[: len(T)], found[len(T) :])
    if values:
        off = motion(native, {})
        assert np.max(np.abs(off[:, 0] - found[:, 0])) > 1e-4  # the effect acts


@pytest.mark.parametrize("step", [1e-4, 2e-2])
def test_both_containers_read_the_ports_as_often_as_asked_for(base, step, tmp_path):
    effects, values = EFFECTS["laws at a port"]
    native = build_carrier(base, (PORT,), effects, tmp_path / "native.fmu", step)
    python = build_coupled(base, (PORT,), effects, tmp_path / "python.fmu", step=step)
    found = motion(native, values)
    assert found == pytest.approx(motion(python, values), rel=1e-12, abs=1e-15)
    usual = motion(build_carrier(base, (PORT,), effects, tmp_path / "usual.fmu"), values)
    assert 0 < np.max(np.abs(found - usual)) < 0.05 * np.max(np.abs(usual))


def test_a_short_step_leaves_the_coupling_as_accurate_as_it_was(base, tmp_path):
    """Steps of 20 ms, with and without a last thousandth of its own, against readings every 0.1 ms."""
    effects, damping = (("viscous_damping", "carriage"),), {"viscous_damping_carriage_c": 300.0}
    t, start = np.arange(0.0, 2.0, 0.02), {"q": 0.01, "M": 90.0, **damping}
    short = np.append(np.column_stack([t[:-1], t[1:] - 2e-5]).ravel(), t[-1])

    def moved(path: Path, times: np.ndarray) -> np.ndarray:
        force = np.interp(times, t, 100 * np.sin(4 * t))
        with Fmu(path) as fmu:
            return fmu.simulate(times, {"F": force}, ("q", "q_dot"), start)

    exact = moved(build_carrier(base, (PORT,), effects, tmp_path / "fine.fmu", 1e-4), t)
    native = build_carrier(base, (PORT,), effects, tmp_path / "native.fmu", 1.0)
    python = build_coupled(base, (PORT,), effects, tmp_path / "python.fmu", step=1.0)
    even, uneven = moved(native, t), moved(native, short)[::2]
    assert np.all(np.abs(uneven - exact).max(axis=0) < 1.5 * np.abs(even - exact).max(axis=0))
    assert np.all(np.abs(even - exact).max(axis=0) < 0.02 * np.abs(exact).max(axis=0))
    assert moved(python, short) == pytest.approx(moved(native, short), rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("velocity", ["q_dot", "q_ddot"])
def test_a_motion_that_an_input_changes_at_once_is_read_after_it(base, velocity, tmp_path):
    """The carrier reads the motion once a step only where no input acts on it directly."""
    port, effects = PortNames("carriage", "F_ext", velocity, "q"), EFFECTS["laws at a port"][0]
    values = {"hysteresis_carriage_F_h": 35.0}
    native = build_carrier(base, (port,), effects, tmp_path / "native.fmu")
    python = build_coupled(base, (port,), effects, tmp_path / "python.fmu")
    assert motion(native, values) == pytest.approx(motion(python, values), rel=1e-12, abs=1e-15)


def test_both_containers_have_the_same_variables(base, tmp_path):
    effects = EFFECTS["laws at a port"][0]
    native = build_carrier(base, (PORT,), effects, tmp_path / "native.fmu")
    python = build_coupled(base, (PORT,), effects, tmp_path / "python.fmu")
    with Fmu(native) as one, Fmu(python) as other:
        assert one.description.variables == other.description.variables
        assert one.description.states == other.description.states


def test_one_instance_does_not_disturb_another(base, tmp_path):
    effects, values = EFFECTS["laws at a port"]
    path = build_carrier(base, (PORT,), effects, tmp_path / "native.fmu")
    alone = motion(path, values)[:100]
    with Fmu(path) as one, Fmu(path) as other:
        one.restart(0.0, q=0.01, M=90.0, **values)
        other.restart(0.0, q=-0.5)
        force = 100 * np.sin(2 * T) + 30 * np.sin(25 * T)
        names = one.description.outputs
        for k in range(99):
            other.step(1e-3, F=-50.0)
            one.step(T[k + 1] - T[k], F=(force[k] + force[k + 1]) / 2)
            one.set(F=force[k + 1])
            assert one.read(names) == pytest.approx(alone[k + 1], rel=1e-12, abs=1e-15)


def test_what_cannot_be_set_or_stepped_is_refused(base, tmp_path):
    path = build_carrier(base, (PORT,), EFFECTS["laws at a port"][0], tmp_path / "native.fmu")
    with Fmu(path) as fmu:
        fmu.restart()
        with pytest.raises(FmuError, match="is computed and cannot be set"):
            fmu.set(q_ddot=1.0)
        with pytest.raises(FmuError, match="F_c = nan is outside"):
            fmu.set(coulomb_friction_carriage_F_c=np.nan)
        with pytest.raises(FmuError, match="step size -1 s is not positive"):
            fmu.step(-1.0)


def test_without_a_compiler_the_container_is_a_pythonfmu(tmp_path, monkeypatch):
    def none(*_args):
        raise BadInput("no compiler")

    monkeypatch.setattr(hypotheses, "build_carrier", none)
    drive = build_native(Drive(), tmp_path)
    builder = ForeignBuilder(drive, (PORT,), tmp_path / "work")
    with Fmu(builder(())) as fmu:
        assert fmu.description.identifier != "Carrier"
        fmu.restart()
        fmu.step(1e-3, F=10.0)
        assert fmu["q_dot"] > 0


def test_names_may_hold_any_character(tmp_path):
    odd = 'a "b" \\n ??/ */ %s ä'
    base = build_native(Drive(), tmp_path / "drive.fmu")
    renamed = tmp_path / "odd.fmu"
    with zipfile.ZipFile(base) as old, zipfile.ZipFile(renamed, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                data = data.replace(b'name="F_v"', f"name={quoteattr(odd)}".encode())
            new.writestr(name, data)
    carrier = build_carrier(renamed, (PORT,), (), tmp_path / "carrier.fmu")
    with Fmu(carrier) as fmu:
        fmu.restart(**{odd: 123.0})
        assert fmu[odd] == 123.0
        with pytest.raises(FmuError, match=re.escape(f"{odd} = nan is outside")):
            fmu.set(**{odd: np.nan})


@pytest.mark.parametrize("build", [build_carrier, build_coupled], ids=["native", "Python"])
def test_a_motion_that_is_no_longer_finite_is_refused(vdp, build, tmp_path):
    path = build(vdp, (PortNames("mass", "u", "x1", "x0"),), (), tmp_path / "container.fmu")
    with Fmu(path) as fmu:
        t = np.arange(5) * 1e-3
        with pytest.raises(
            FmuError, match="step at t = 0 s: the carried FMU is no longer finite after t = 0 s"
        ):
            fmu.simulate(t, {}, ["x0", "x1"], {"x0": 1e200})
        assert np.isfinite(fmu.simulate(t, {}, ["x0", "x1"], {})).all()


def test_a_variable_may_be_set_and_asked_for_more_than_once(base, tmp_path):
    path = build_carrier(base, (PORT,), (), tmp_path / "native.fmu")
    with Fmu(path) as fmu:
        fmu.restart(q=0.1)
        many = 3 * len(fmu.description.variables)
        (force,) = fmu.references(["F"])
        fmu.instance.set([force] * many, [float(k) for k in range(many)])
        assert fmu.read(["q", "F"] * many) == [0.1, many - 1.0] * many


CARRIED = """
import sys
import numpy as np
from fmus.host.fmu import Fmu, FmuError
t = np.arange(400) * 2.5e-3
for _ in range(3):
    with Fmu(sys.argv[1]) as fmu, Fmu(sys.argv[1]) as other:
        first = fmu.simulate(t, {"F": np.sin(9 * t)}, ["q"], {"M": 90.0})
        other.restart(M=50.0)
        other.step(1e-3, F=3.0)
        assert np.array_equal(first, fmu.simulate(t, {"F": np.sin(9 * t)}, ["q"], {"M": 90.0}))
        try:
            fmu.step(float("nan"))
        except FmuError:
            pass
print("lived")
"""


@pytest.fixture(params=["co-simulation", "model exchange, FMI 2", "model exchange, FMI 3"])
def sources(request, tmp_path, monkeypatch) -> Path:
    """The C files of a carrier with effects of every kind, in a folder, and its FMU without a library."""
    made = tmp_path / "sources"
    made.mkdir()

    def kept(code, main, linked=()):
        for name, data in code.items():
            (made / name).write_bytes(data)
        return b"no library"

    monkeypatch.setattr(carrier, "library", kept)
    effects = [effect for some, _ in EFFECTS.values() for effect in some]
    base = native("drive", fmi=3 if "FMI 3" in request.param else 2)
    if request.param != "co-simulation":
        base = alone(base, tmp_path / "alone.fmu")
    build_carrier(base, (PORT,), effects, tmp_path / "bare.fmu")
    return made


def compiled(sources: Path, *flags: str) -> bytes:
    """The carrier's library, made without a warning."""
    strict = [flag for flag in STRICT if flag != "-pedantic"]  # it forbids functions of loaded libraries
    strict += [*DEFINED, "-g", "-fPIC", "-shared", "-fvisibility=hidden", *flags]
    files = ["carrier.c", "-o", "made.so", "-lm", "-ldl"]
    subprocess.run([compiler(), *strict, *files], cwd=sources, check=True)
    return (sources / "made.so").read_bytes()


def test_the_carrier_compiles_without_a_warning(sources):
    assert compiled(sources)


@pytest.mark.slow
def test_sanitizers_find_nothing_in_the_carrier(sources, tmp_path):
    """In a process of Python in which the address sanitizer is loaded first; leaks are Python's own too."""
    runtime = subprocess.run(
        [compiler(), "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    if not Path(runtime).is_absolute():
        pytest.skip("the C compiler here has no address sanitizer")
    # what the sanitizers add makes the compiler guess that values may not be set
    flags = ("-O1", "-Wno-maybe-uninitialized", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    made = compiled(sources, *flags)

    def exchanged(name, data):
        return (name, made) if data == b"no library" else (name, data)

    fmu = repacked(tmp_path / "bare.fmu", tmp_path / "carried.fmu", exchanged)
    watched = os.environ | {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run(
        [sys.executable, "-c", CARRIED, str(fmu)], cwd=ROOT, env=watched, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (0, "lived\n"), done.stderr
    assert "runtime error" not in done.stderr
