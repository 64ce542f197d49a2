"""The README's promises: each of these is one new file, in the package or in a folder of RAILFMI_PATH."""

import os
from textwrap import dedent

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fmus.host.fmu import Fmu
from tests.helpers.further import Further

PENDULUM = '''
"""Pendulum: one angle."""

import casadi as cs

from fmus.model import Model
from fmus.port import Port
from fmus.variables import Input, Parameter, State, rate


class Pendulum(Model):
    """Pendulum with a torque at its pivot."""

    name = "Pendulum"
    step_size = 1e-3

    phi = State("rad", 0.1, doc="angle", nominal=0.1)
    phi_dot = State("rad/s", doc="angular velocity", nominal=0.1)
    M_ext = Input("N.m", doc="port: torque at the pivot")
    J = Parameter("kg.m2", 1.0, min=1e-3, doc="inertia", source="this example")
    k = Parameter("N.m", 9.81, min=0.0, doc="weight times length", source="this example")
    phi_ddot = rate(phi_dot, "rad/s2", "angular acceleration")

    def derivatives(m):
        """See Model.derivatives."""
        return {"phi": m.phi_dot, "phi_dot": (-m.k * cs.sin(m.phi) + m.M_ext) / m.J}

    def ports(m):
        """The pivot."""
        return {"pivot": Port(m.phi, m.phi_dot, {"M_ext": 1.0}, "rotation")}
'''
OFFER = """    build_options = (BuildOption("length", float, "m", "length of the rod", 2.0),)

    phi = State"""
SIZED = (  # the same, of a length that is chosen when it is built
    PENDULUM.replace("    phi = State", OFFER)
    .replace("from fmus.port", "from fmus.option import BuildOption\nfrom fmus.port")
    .replace("-m.k * cs.sin", '-m.k * m.options["length"] * cs.sin')
)
LAW = '''
"""Half of Kalker's linear forces."""

from fmus.contact.forces.laws.law import CreepLaw
from fmus.contact.forces.laws.linear import linear_forces


class Half(CreepLaw):
    """Half of each linear force."""

    name = "half"
    code = {code}
    title = "half of linear"

    def forces(self, c):
        """See CreepLaw.forces."""
        return tuple(0.5 * force for force in linear_forces(c))
'''
HEUN = '''
"""Heun's method."""

from fmus.integrators.integrator import Integrator


class Heun(Integrator):
    """The mean of the rates at the start and at the end that these lead to."""

    name = "heun"
    order = 2

    def advance(self, f, x, dt, tolerated):
        """See Integrator.advance."""
        rate = f(x)
        return x + dt / 2 * (rate + f(x + dt * rate)), 0.0
'''
FIFTH = '''
"""Stiffness that rises with the fourth power: a rubber stop that is far in.

In data: a residual that is there at the ends of a motion alone.
"""

from fmus.effects.force_law import ForceLaw
from fmus.variables import Parameter


class FifthStiffness(ForceLaw):
    """F = -k_5 q^5."""

    kind = "fifth_stiffness"
    over = "displacement"
    source = "this example"
    places = ("rests",)
    amplitudes = ("k_5",)
    k_5 = Parameter("{F}/{q}5", doc="stiffness of fifth order")

    def force(self, q, v):
        """See ForceLaw.force."""
        return -self.k_5 * q**5
'''


@pytest.fixture
def mine(tmp_path):
    return Further(tmp_path)


@pytest.mark.parametrize(
    "package",
    [
        pytest.param(True, marks=pytest.mark.slow, id="with __init__"),
        pytest.param(False, id="without __init__"),
    ],
)
def test_a_model_is_one_file_with_or_without_a_package_around_it(mine, package):
    mine.write("fmus/pendulum/model.py", PENDULUM)
    if package:
        mine.write("fmus/pendulum/__init__.py", "")
    mine.railfmi("build", "pendulum", "--effect", "viscous_damping@pivot", "--out", "out")
    assert "passed" in mine.railfmi("check", "out/Pendulum.fmu")
    with Fmu(mine.work / "out" / "Pendulum.fmu") as pendulum:
        pendulum.restart(phi=0.01, phi_dot=0.0)
        for _ in range(100):
            pendulum.step(1e-2)
        # 1e-5: of the linear solution, whose error grows with the square of the angle
        assert pendulum["phi"] == pytest.approx(0.01 * np.cos(np.sqrt(9.81)), abs=1e-5)


@pytest.mark.slow
def test_a_model_gets_the_contract_tests_for_free(mine):
    mine.write("fmus/pendulum/model.py", PENDULUM)
    assert mine.passes("tests/contracts/test_models.py", "-k", "pendulum") >= 3


def test_what_a_model_offers_to_choose_is_an_option_of_the_build(mine):
    mine.write("fmus/pendulum/model.py", SIZED)
    mine.railfmi("build", "pendulum", "--length", "3/2", "--out", "out")
    with Fmu(mine.work / "out" / "Pendulum.fmu") as pendulum:
        pendulum.restart(phi=0.3)
        assert pendulum["phi_ddot"] == pytest.approx(-9.81 * 1.5 * np.sin(0.3), rel=1e-12)


def test_what_a_model_offers_to_choose_is_in_the_help_and_in_python(mine):
    mine.write("fmus/pendulum/model.py", SIZED)
    said = """
        from typer.testing import CliRunner
        from fmus.models import model_with
        from scenarios.cli.app import loaded
        for given in ({}, {"length": "3/2"}, {"length": 4}):
            print(model_with("pendulum", options=given).options["length"])
        print(CliRunner().invoke(loaded(["build"]), ["build", "--help"]).output)
    """
    words = mine.says(said).split()
    assert words[:3] == ["2.0", "1.5", "4.0"]
    assert "of pendulum: length of the rod in m, by default 2" in " ".join(words)


ON_TRACK = (  # the same, of a pivot that follows the track 2 m behind the ride
    PENDULUM.replace("Input, Parameter", "Input, OnTrack, Parameter")
    .replace(
        "    J =",
        """    z = Input("m", doc="height of the pivot", on_track=OnTrack("level", behind=("x",)))
    V = Input("m/s", doc="speed", on_track=OnTrack("speed"))
    x = Parameter("m", 2.0, doc="distance behind", source="this example")
    J =""",
    )
    .replace("cs.sin(m.phi) + m.M_ext)", "cs.sin(m.phi) + m.M_ext + m.z + 0 * m.V)")
)
RIDE = """
    id = "pendulum"
    question = "Does a pendulum of one's own feel the track?"
    duration = 1.0
    step = 0.01
    fmus.pendulum = {model = "pendulum", initial = {phi = 0.0}}
    track = {kind = "defect", shape = "step", position = 6.0, height = 1.0}
    ride = {V = 10.0, on.pendulum = {}}
    record = {names = ["pendulum.phi", "pendulum.phi_ddot"]}

    [[expect]]
    that = "max(abs(between(pendulum.phi, 0.0, 0.79))) < 1e-12"
    because = "at 10 m/s the step at 6 m is met 2 m later, after 0.8 s"

    [[expect]]
    that = "0.9 < max(between(pendulum.phi_ddot, 0.8, 0.85)) < 1.1"
    because = "its torque is 1 N.m over 1 kg.m2"
"""


def test_a_model_is_driven_over_a_track_by_what_its_inputs_say(mine):
    mine.write("fmus/pendulum/model.py", ON_TRACK)
    file = mine.work / "ride.toml"
    file.write_text(dedent(RIDE), encoding="utf-8")
    mine.railfmi("run", str(file), "--out", "out")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"level"', '"leval"', "input 'z' is 'leval', which no track has; did you mean 'level'?"),
        ('("x",)', '("w",)', "input 'z' is behind by 'w', no parameter; known are J, k, x"),
    ],
)
def test_an_input_that_no_track_gives_is_refused(mine, old, new, words):
    mine.write("fmus/pendulum/model.py", ON_TRACK.replace(old, new))
    file = mine.work / "ride.toml"
    file.write_text(dedent(RIDE), encoding="utf-8")
    assert words in mine.refused("run", str(file), "--out", "out")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("pendulum", "--cant", "1/20"), "pendulum has no build option 'cant'; it offers length"),
        (("drive", "--length", "1.5"), "drive has no build option 'length'; it offers none; leave it out"),
        (("pendulum", "--length", "long"), "length = 'long' is no number; give m, such as 2"),
    ],
)
def test_an_option_that_a_model_does_not_have_is_refused_with_what_it_offers(mine, given, words):
    mine.write("fmus/pendulum/model.py", SIZED)
    assert words in mine.refused("build", *given, "--out", "out")
    assert not (mine.work / "out").exists()


def test_a_build_option_that_every_build_has_is_refused(mine):
    mine.write("fmus/pendulum/model.py", SIZED.replace('"length"', '"kind"'))
    assert "model 'pendulum': build option 'kind' is an option of every build" in mine.refused("build")


@pytest.mark.parametrize(
    ("path", "text", "words"),
    [
        ("fmus/pendulum/modell.py", PENDULUM, "holds no model.py"),
        ("fmus/testrig/model.py", PENDULUM, "is also the name of"),
        ("fmus/pendulum/model.py", PENDULUM.replace("Pendulum", "Testrig"), "'Testrig' is also in"),
        ("fmus/pendulum/model.py", PENDULUM.replace("    name =", "    nam ="), "has no 'name'"),
        ("fmus/pendulum/model.py", PENDULUM.replace("def deriv", "def driv"), "lacks derivatives"),
        ("fmus/pendulum/model.py", '"""Nothing."""', "holds no class of Model"),
        ("fmus/pendulum/model.py", "import nowhere", "No module named 'nowhere'"),
        ("estimated/pendulum.py", PENDULUM, "holds none of the folders fmus, estimator, scenarios"),
    ],
)
def test_a_further_file_that_cannot_be_used_is_refused_in_one_line(mine, path, text, words):
    mine.write(path, text)
    said = mine.refused("build", "pendulum", "--out", "out")
    assert words in said
    assert str(mine.folder) in said


@pytest.mark.slow
def test_a_creep_law_is_one_file(mine):
    mine.write("fmus/contact/forces/laws/half.py", LAW.format(code=5))
    mine.railfmi("build", "wheelset", "--out", "out")
    with Fmu(mine.work / "out" / "Wheelset.fmu") as wheelset:
        law = wheelset.description.variables["creep_law"]
        assert (law.start, law.max) == (4.0, 5.0)
        assert "5 half of linear" in law.description
        forces = []
        for code in (0.0, 5.0):
            wheelset.restart(psi=1e-3, creep_law=code)
            forces.append(wheelset["F_y_left"])
        assert forces[0] != 0.0
        assert_allclose(forces[1], forces[0] / 2, rtol=1e-12)
    said = """
        from fmus.contact import creep_forces
        given = (6e-3, 4e-3, 8e4, 0.3, 8e10, 0.28, 1e-3, 0.0, 0.0)
        print(creep_forces("half", *given)[0] / creep_forces("linear", *given)[0])
    """
    assert float(mine.says(said)) == pytest.approx(0.5, rel=1e-12)


def test_a_creep_law_whose_code_leaves_a_gap_is_refused(mine):
    mine.write("fmus/contact/forces/laws/half.py", LAW.format(code=7))
    assert "has code 7, where the next free one is 5" in mine.refused("build", "wheelset")


@pytest.mark.slow
def test_an_integrator_is_one_file(mine):
    mine.write("fmus/integrators/heun.py", HEUN)
    mine.write(
        "fmus/pendulum/model.py", PENDULUM.replace("    step_size", '    method = "heun"\n    step_size')
    )
    mine.railfmi("build", "pendulum", "--out", "out")
    with Fmu(mine.work / "out" / "Pendulum.fmu") as pendulum:
        pendulum.restart(phi=0.1, phi_dot=0.0)
        pendulum.step(1e-3)
        by_hand = -9.81 * 1e-3 / 2 * 2 * np.sin(0.1)
        assert pendulum["phi_dot"] == pytest.approx(by_hand, rel=1e-12)
        assert pendulum["phi"] == pytest.approx(0.1 - 9.81 * 1e-6 / 2 * np.sin(0.1), rel=1e-14)
    assert mine.passes("tests/fmus/test_integrators.py", "-k", "heun") == 3


def test_an_effect_is_one_file(mine):
    mine.write("fmus/effects/fifth_stiffness.py", FIFTH)
    mine.railfmi("build", "vehicle7dof", "--effect", "fifth_stiffness@body", "--out", "out")
    assert "passed" in mine.railfmi("check", "out/Vehicle7dof.fmu")
    with Fmu(mine.work / "out" / "Vehicle7dof.fmu") as vehicle:
        found = []
        for k_5 in (0.0, 1e9):
            vehicle.restart(z1=0.1, fifth_stiffness_body_k_5=k_5)
            found.append(vehicle["z1_ddot"] * vehicle["m1"])
    assert found[1] - found[0] == pytest.approx(-1e9 * 0.1**5, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "least"),
    [("effects_laws", 8), ("effects", 5), ("effects_guesses", 2), ("effects_builds", 4)],
)
def test_an_effect_gets_the_contract_tests_for_free(mine, file, least):
    mine.write("fmus/effects/fifth_stiffness.py", FIFTH)
    # those of this effect, and those that go through all of them
    chosen = "fifth_stiffness or contracts or documentation or offer"
    assert mine.passes(f"tests/fmus/test_{file}.py", "-k", chosen) >= least


def test_a_model_whose_integrator_is_not_known_is_refused(mine):
    mine.write("fmus/integrators/heun.py", HEUN)
    mine.write(
        "fmus/pendulum/model.py", PENDULUM.replace("    step_size", '    method = "hein"\n    step_size')
    )
    said = mine.refused("build", "pendulum", "--out", "out")
    assert "model 'Pendulum': method 'hein' is not known; did you mean 'heun'?" in said


def test_an_exact_profile_is_one_file(mine):
    mine.write(
        "fmus/contact/geometry/profiles/Cone20.toml",
        """
        kind = "wheel"
        unit = "m"
        z = "up"

        [[section]]
        y = [-0.06, 0.06]
        polynomial = [0.0, 0.05]
        """,
    )
    table = (
        "from fmus.contact import contact_table; print(contact_table('Cone20', '60E1')['delta_left'].max())"
    )
    assert float(mine.says(table)) == pytest.approx(np.arctan(0.05), rel=1e-3)
    mine.railfmi("build", "wheelset", "--wheel", "Cone20", "--out", "out")
    assert (mine.work / "out" / "Wheelset.fmu").exists()


def test_an_exact_profile_that_is_not_sound_is_refused(mine):
    file = mine.write("fmus/contact/geometry/profiles/Cone20.toml", 'kind = "wheel"\nunit = "m"\n')
    said = mine.refused("build", "wheelset", "--wheel", "Cone20")
    assert str(file) in said
    assert "key 'z'" in said


def test_several_folders_may_be_named(mine, tmp_path, monkeypatch):
    mine.write("fmus/pendulum/model.py", PENDULUM)
    other = Further(tmp_path / "other")
    other.write("fmus/swing/model.py", PENDULUM.replace("Pendulum", "Swing"))
    mine.folder = f"{mine.folder}{os.pathsep}{other.folder}"
    found = mine.says("from fmus.models import MODELS; print(*MODELS)").split()
    assert {"pendulum", "swing", "wheelset"} <= set(found)
