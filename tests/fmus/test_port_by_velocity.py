"""A port whose FMU gives a velocity alone: laws over velocity and time act there, all else stays."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from estimator.closeloop.screening.missing_force import motion_of
from fmus.drive.model import Drive
from fmus.effects import EFFECTS, offers
from fmus.effects.force_law import ForceLaw
from fmus.errors import BadInput
from fmus.export.around.outside import Outside
from fmus.export.builders.pythonfmu import build_python
from fmus.export.container.carrier import build_carrier
from fmus.export.container.coupled import build_coupled
from fmus.host.archive import describe
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu
from tests.helpers.packed import with_description

FULL = PortNames("carriage", "F_ext", "q_dot", "q")
FAST = PortNames("carriage", "F_ext", "q_dot", None)
INTEGRATED = PortNames("carriage", "F_ext", "q_dot", None, integrated=True)
LAWS = [kind for kind, effect in EFFECTS.items() if issubclass(effect, ForceLaw)]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return build_python(Drive(), tmp_path_factory.mktemp("drive") / "drive.fmu")


def kinds(fmu, port):
    return {kind for kind, at in offers(Outside(describe(fmu), [port])) if at == "carriage"}


def test_only_laws_over_the_displacement_are_not_offered(drive):
    lost = kinds(drive, FULL) - kinds(drive, FAST)
    assert {"cubic_stiffness", "bump_stop", "periodic_force"} <= lost
    assert {"coulomb_friction", "viscous_damping", "step_force", "hysteresis", "flexible_mode"} <= kinds(
        drive, FAST
    )


@pytest.mark.parametrize("kind", LAWS)
def test_a_law_needs_the_displacement_if_its_force_changes_with_it(kind):
    """Against the equations evaluated: along the same velocity, another displacement changes the force."""
    law = EFFECTS[kind]
    rng = np.random.default_rng(1)
    t = np.linspace(0, 1, 50)
    v = rng.normal(size=50)
    values = dict(zip(law.amplitudes, rng.uniform(1, 2, len(law.amplitudes)), strict=True))
    shape = next(iter(law.guesses(t, np.cumsum(v), v, rng.normal(size=50))), {})
    one, other = (law.along({**shape, **values}, t, q, v) for q in (rng.normal(size=50), rng.normal(size=50)))
    if not law.needs_displacement():
        assert_allclose(one, other, rtol=1e-12)
    else:
        assert not np.allclose(one, other)


def test_a_law_over_the_displacement_is_refused_there(drive):
    with pytest.raises(
        BadInput, match=r"cubic_stiffness at 'carriage' depends on the displacement.*displacement ="
    ):
        Outside(describe(drive), [FAST]).build([(EFFECTS["cubic_stiffness"], "carriage")])


@pytest.mark.parametrize("kind", ["coulomb_friction", "step_force", "hysteresis"])
def test_the_motion_is_that_with_a_displacement(drive, tmp_path, kind):
    amplitude = EFFECTS[kind].amplitudes[0]
    t = np.arange(400) * 2e-3
    found = []
    for port in (FULL, FAST):
        path = build_coupled(drive, (port,), ((kind, "carriage"),), tmp_path / f"{port.displacement}.fmu")
        with Fmu(path) as fmu:
            start = {f"{kind}_carriage_{amplitude}": 30.0}
            found.append(fmu.simulate(t, {"F": 100 * np.sin(9 * t)}, ["q", "q_dot"], start))
    assert_allclose(found[1], found[0], rtol=1e-12, atol=1e-15)


def test_with_an_integrated_displacement_all_laws_are_offered(drive):
    assert kinds(drive, INTEGRATED) == kinds(drive, FULL)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("cubic_stiffness", {"k_3": 6e6}),
        ("bump_stop", {"k": 3e4, "gap": 0.005}),
        ("coulomb_friction", {"F_c": 30}),
    ],
)
def test_the_motion_is_that_with_the_displacement_of_the_fmu(drive, tmp_path, kind, values):
    t = np.arange(400) * 2e-3
    found = []
    for port in (FULL, INTEGRATED):
        path = build_coupled(drive, (port,), ((kind, "carriage"),), tmp_path / f"{port.integrated}.fmu")
        with Fmu(path) as fmu:
            states = [n for n in fmu.description.states if n == "carriage_displacement"]
            assert len(states) == (port.integrated and kind != "coulomb_friction")
            start = {f"{kind}_carriage_{name}": value for name, value in values.items()}
            found.append(fmu.simulate(t, {"F": 100 * np.sin(9 * t)}, ["q", "q_dot", *states], start))
            without = fmu.simulate(t, {"F": 100 * np.sin(9 * t)}, ["q", "q_dot"], {})
    assert_allclose(found[1][:, :2], found[0], rtol=1e-5, atol=2e-6)  # trapezoids of 1 ms
    assert np.abs(found[0] - without).max() > 1e-3  # the law matters
    if found[1].shape[1] == 3:
        assert_allclose(found[1][:, 2], found[1][:, 0], atol=2e-7)


def test_a_native_carrier_integrates_as_the_python_one_does(drive, tmp_path):
    t, effects = np.arange(200) * 2e-3, (("cubic_stiffness", "carriage"),)
    found = []
    for build in (build_coupled, build_carrier):
        with Fmu(build(drive, (INTEGRATED,), effects, tmp_path / f"{build.__name__}.fmu")) as fmu:
            start = {"cubic_stiffness_carriage_k_3": 6e6}
            names = ["q", "q_dot", "carriage_displacement"]
            found.append(fmu.simulate(t, {"F": 100 * np.sin(9 * t)}, names, start))
    assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-14)


def test_a_displacement_that_nobody_gives_is_the_integral_of_the_velocity():
    t = np.linspace(0, 1, 1001)
    motion = np.column_stack([np.cos(t), np.cos(t)])
    q, v = motion_of(FAST, 0, t, motion)
    assert_allclose(q, np.sin(t), atol=1e-6)
    assert_allclose(v, np.cos(t))
    assert motion_of(FULL, 0, t, motion)[0] is not q


@pytest.mark.parametrize(
    ("unit", "declared", "turns"),
    [
        ("rad/s", None, True),
        ("m/s", None, False),
        (None, "rad/s", True),
        (None, "rpm", True),
        (None, None, False),
    ],
)
def test_a_port_turns_by_the_unit_of_its_velocity(drive, tmp_path, unit, declared, turns):
    stated = b"" if unit is None else f' unit="{unit}"'.encode()
    path = with_description(drive, tmp_path / "d.fmu", rb' unit="m/s"', stated)
    site = Outside(describe(path), [PortNames("carriage", "F_ext", "q_dot", None, declared)])
    assert site.ports()["carriage"].motion == ("rotation" if turns else "translation")


def test_a_parameter_that_says_nothing_of_its_variability_is_fixed(drive, tmp_path):
    """PythonFMU writes so by default; without a word it is continuous, which no parameter may be."""
    silent = rb' variability="(?:tunable|fixed)"| initial="exact"'
    path = with_description(drive, tmp_path / "d.fmu", silent, b"")
    d = describe(path)
    assert d.parameters == describe(drive).parameters
    assert {d.variables[name].variability for name in d.parameters} == {"fixed"}
    with Fmu(path) as fmu:
        fmu.restart(M=50.0)
        assert fmu["M"] == 50.0
