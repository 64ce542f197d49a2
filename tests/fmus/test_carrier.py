"""The native container of a foreign FMU takes the same steps as the container in Python."""

import re
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
from fmus.export.container.carrier import build_carrier
from fmus.export.container.coupled import build_coupled
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu, FmuError

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
