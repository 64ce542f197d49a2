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
from fmus.export.container.coupled import build_coupled
from fmus.host.archive import describe
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu
from tests.helpers.packed import with_description

FULL = PortNames("carriage", "F_ext", "q_dot", "q")
FAST = PortNames("carriage", "F_ext", "q_dot", None)
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
