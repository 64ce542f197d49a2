"""The wheelset's truth model: its independence, its contact, its effects, and records in the layout."""

import ast
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.helpers.paths import SHARED
from tests.truth import (
    bogie,
    bogie_linear,
    wheelset_contact,
    wheelset_effects,
    wheelset_motion,
    wheelset_track,
)
from tests.truth import contact as other_contact
from tests.truth.wheelset import (
    NOISE,
    main,
    true_run,
    write_null_record,
    write_record,
)
from tests.truth.wheelset_contact import (
    contacts,
    hertz,
    kalker,
    penetrated,
    wheel,
)
from tests.truth.wheelset_effects import (
    BODIES,
    CONDITIONS,
    FRICTION,
    SUSPENSIONS,
    Effects,
    single,
)
from tests.truth.wheelset_motion import (
    COORDINATES,
    DECLARED,
    OTHER,
    creep,
    rates,
    simulate,
)
from tests.truth.wheelset_track import random_alignment

RECORDS = SHARED / "data" / "experiments"
MEASURED = np.array([NOISE.get(name, np.nan) for name in COORDINATES])[:4]


def shows(a, b):
    """Scatter of the difference of two motions over the usual noise, the largest of the outputs."""
    return float(((a - b)[:, :4].std(axis=0) / MEASURED).max())


def test_it_knows_nothing_of_the_product():
    for module in (bogie, bogie_linear, wheelset_contact, wheelset_effects, wheelset_motion, wheelset_track):
        tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
        nodes = [n for n in ast.walk(tree) if isinstance(n, ast.Import | ast.ImportFrom)]
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        names |= {n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)}
        roots = {name.split(".")[0] for name in names}
        assert roots <= {"numba", "numpy", "scipy", "tests"} | set(sys.stdlib_module_names)


def test_the_wheel_has_no_steps_but_those_of_its_standard():
    eta = np.arange(-41.0, 45.0, 1e-3)
    growth, slope, second = wheel(eta)
    assert np.abs(np.diff(growth) - 1e-3 * (slope[1:] + slope[:-1]) / 2).max() < 2e-4  # mm, EN 13715's digits
    bends = np.gradient(slope, eta)[1:-1]
    off = np.abs(bends - second[1:-1]) > 1e-3 + 1e-3 * np.abs(bends)
    assert off.sum() < 20  # places: those next to the four ends of sections, where curvature jumps


def test_hertz_is_that_of_the_textbook_for_a_sphere():
    a, b = hertz(np.array([1.5]), np.array([1.5]))
    R, E = 1 / 3.0, wheelset_contact.G / (1 - wheelset_contact.NU)
    assert_allclose([a[0], b[0]], np.cbrt(3 * 55e3 * R / (4 * E)), rtol=1e-6)


def test_virtual_penetration_of_a_sphere_is_a_larger_circle_than_hertzs():
    """By a² = R delta of Hertz and a² = 0.55 delta 2 R of the thesis' eq. 3.43."""
    A = np.array([1.5])
    assert_allclose(penetrated(A, A)[0] / hertz(A, A)[0], np.sqrt(1.1), rtol=1e-6)
    a, b = penetrated(np.array([1.0]), np.array([4.0]))
    assert_allclose(a / b, 2.0, rtol=1e-9)


def test_kalkers_coefficients_at_their_own_poisson_ratio_are_the_table():
    one = other_contact.Patch(6e-3, 4e-3, 55e3, 0.3, 8e10)
    assert_allclose(kalker(np.array([1.5]), 0.25)[:, 0], one.kalker(), rtol=1e-12)


def test_contact_is_the_one_of_s1002_on_60e1():
    """Conicity by Klingel's quotient of radius difference and shift; EN 15302's integral gives 0.164."""
    c = contacts()
    difference = c.growth - c.growth[::-1]
    at = np.abs(c.y - 3e-3).argmin()
    assert 0.1 < difference[at] / (2 * c.y[at]) < 0.2
    assert_allclose(c.phi, -c.phi[::-1], atol=1e-9)
    assert c.delta[np.abs(c.y) < 5e-3].max() < 0.3 < 1.0 < c.delta.max()  # flange contact from 6 to 6.5 mm


def test_forces_of_creep_are_those_of_the_other_truth():
    patch = other_contact.Patch(6e-3, 4e-3, 55e3, 0.3, 8e10)
    for slips in ((1e-3, 2e-3, 0.3), (-2e-4, 1e-4, -0.8), (0.0, 1e-3, 0.0), (3e-3, 0.0, 0.1)):
        found = creep((6e-3, 4e-3, *patch.kalker()), 55e3, 0.3, 0.8, 0.3, slips, 1.0)
        assert_allclose(found[:2], other_contact.polach(patch, *slips, 0.8, 0.3), rtol=1e-9)


def test_the_alignment_is_what_it_was_asked_to_be():
    t = np.arange(20001) * 1e-3
    run = random_alignment(np.random.default_rng(1), t, 40.0, deviation=0.5e-3)
    assert run.y_irr.std() == pytest.approx(0.5e-3)
    assert run.y_irr[0] == 0.0
    slope = np.gradient(run.y_irr, 0.5e-3)
    assert_allclose(run.y_irr_dot[1:-1], slope[1:-1], atol=2e-5)
    limited = random_alignment(np.random.default_rng(1), t, 40.0, largest=1e-3)
    assert np.abs(limited.y_irr).max() == pytest.approx(1e-3)


def test_mirror_images_move_as_mirror_images():
    dot = rates(DECLARED, Effects(), OTHER, 30.0)
    x = (2e-3, 1e-4, 0.01, 0.02, -1e-3, 0.03)
    there, here = dot(0.0, 1e-3, 0.02, x), dot(0.0, -1e-3, -0.02, tuple(-v for v in x))
    assert_allclose(there, [-v for v in here], rtol=1e-9, atol=1e-9)


def test_shorter_steps_change_nothing():
    rng = np.random.default_rng(2)
    fine = random_alignment(rng, np.arange(8001) * 2.5e-4)
    coarse = wheelset_track.Run(
        40.0, fine.t[::4], fine.y_irr[::8].repeat(2)[:-1], fine.y_irr_dot[::8].repeat(2)[:-1]
    )
    middle = slice(1, None, 2)
    coarse.y_irr[middle], coarse.y_irr_dot[middle] = fine.y_irr[4::8], fine.y_irr_dot[4::8]
    assert shows(simulate(fine)[::4], simulate(coarse)) < 0.02


@pytest.fixture(scope="module")
def sound():
    """A run without any effect."""
    return true_run(np.random.default_rng(6), duration=4.0)[1]


CASES = [(kind, place) for kind in ("coulomb_friction", "stiffness_change") for place in SUSPENSIONS]
CASES += [(kind, "primary_yaw") for kind in ("viscous_damping", "quadratic_damping", "cubic_stiffness")]
CASES += [(kind, "primary_lateral") for kind in ("damping_change", "free_play", "viscous_damping")]
CASES += [(kind, place) for kind in ("constant_force", "harmonic_excitation") for place in BODIES]
CASES += [(kind, "mu0") for kind in ("parameter_offset", "parameter_step", "parameter_drift")]
CASES += [("friction_condition", "friction_condition")]


@pytest.mark.parametrize(("kind", "location"), CASES)
def test_each_effect_shows_above_the_noise(kind, location, sound):
    early = {"parameter_step": {"t0": 1.0}, "friction_condition": {"condition_time": 1.0}}
    early["parameter_drift"] = {"rate": -0.08}  # a tenth of the usual run
    effects = single(kind, location, **early.get(kind, {}))
    _, ill = true_run(np.random.default_rng(6), duration=4.0, effects=effects)
    assert shows(ill, sound) > 0.5


def test_nothing_is_nothing_everywhere(sound):
    laws = {place: wheelset_effects.Law() for place in SUSPENSIONS}
    pushes = {place: wheelset_effects.Push() for place in BODIES}
    changes = {name: wheelset_effects.Change() for name in FRICTION}
    _, same = true_run(
        np.random.default_rng(6), duration=0.5, effects=Effects(laws, pushes, changes), deviation=8.1e-4
    )
    _, plain = true_run(np.random.default_rng(6), duration=0.5, deviation=8.1e-4)
    assert_array_equal(same, plain)


def test_a_weaker_spring_is_a_wheelset_with_it(sound):
    run, law = true_run(
        np.random.default_rng(6), duration=1.0, effects=single("stiffness_change", "primary_yaw")
    )
    weaker = wheelset_motion.Wheelset(k_x=0.6 * DECLARED.k_x)
    assert_allclose(simulate(run, weaker), law, atol=1e-12)


def test_friction_changes_when_it_is_due():
    declared = CONDITIONS["dry"]
    step = single("parameter_step", "mu0", delta=-0.3, t0=5.0)
    assert step.friction(4.99, declared) == declared
    assert step.friction(5.0, declared) == pytest.approx((0.2, *declared[1:]))
    assert single("parameter_drift", "k_S", rate=-0.01).friction(10.0, declared)[4] == pytest.approx(0.3)
    wet = single("friction_condition", "", condition="wet", condition_time=3.0)
    assert wet.friction(3.0, declared) == CONDITIONS["wet"]


def test_another_form_is_a_small_difference(sound):
    _, other = true_run(np.random.default_rng(6), duration=4.0, form=OTHER)
    assert 0.5 < shows(other, sound) < 40
    assert (other - sound)[:, :4].std(axis=0).max() < 0.1 * sound[:, :4].std(axis=0).max()


@pytest.mark.parametrize(
    ("kind", "location", "words"),
    [
        ("rust", "primary_yaw", "'rust' is not one of none"),
        ("coulomb_friction", "suspended_mass", "it can be at primary_lateral"),
        ("parameter_step", "k_y", "it can be at mu0"),
    ],
)
def test_an_effect_that_cannot_be_is_refused(kind, location, words):
    with pytest.raises(ValueError, match=words):
        single(kind, location)


def read(path):
    """Declaration and columns by name of a record."""
    data = np.genfromtxt(path.with_name("data.csv"), delimiter=",", names=True)
    return tomllib.loads(path.read_text(encoding="utf-8")), data


def test_a_record_holds_the_truth_and_noise_of_the_declared_size(tmp_path):
    fault = single("sensor_gain", "psi", gain=1.5)
    path = write_record(tmp_path, "w", np.random.default_rng(8), duration=2.0, effects=fault)
    _, data = read(path)
    run, true = true_run(np.random.default_rng(8), duration=2.0)
    assert_allclose(data["y_irr"], run.y_irr[::2], rtol=1e-6, atol=1e-12)
    for i, (name, noise) in enumerate(NOISE.items()):
        gain = 1.5 if name == "psi" else 1.0
        # 2001 samples tell a standard deviation to 1.6 %
        assert np.std(data[name] - gain * true[:, i]) == pytest.approx(noise, rel=0.08)


def test_a_fault_of_what_is_not_measured_is_refused(tmp_path):
    with pytest.raises(ValueError, match="y_m not among the outputs"):
        write_record(
            tmp_path, "w", np.random.default_rng(8), duration=0.1, effects=single("sensor_bias", "y_m")
        )


def test_a_seed_gives_the_same_record_again_and_another_seed_another(tmp_path):
    one, two, other = (
        write_null_record(tmp_path / n, seed, 0.5) for n, seed in (("a", 1), ("b", 1), ("c", 2))
    )
    assert [p.read_bytes() for p in one.parent.iterdir()] == [p.read_bytes() for p in two.parent.iterdir()]
    assert read(one)[1]["y"][5] != read(other)[1]["y"][5]
    assert read(other)[0]["calibrate"]["k_S"] == [0.2, 0.8]


@pytest.mark.skipif(not RECORDS.is_dir(), reason="the shared records are not on this machine")
def test_the_layout_is_that_of_the_measured_records(tmp_path, capsys):
    main([str(tmp_path), "--duration", "4", "--effect", "coulomb_friction", "--name", "wheelset-a"])
    path = Path(capsys.readouterr().out.strip())
    measured = RECORDS / "wheelset-a"
    text = (measured / "experiment.toml").read_text(encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text.replace("24]", "2.4]").replace("24, 40]", "2.4, 4]")
    ours, theirs = read(path)[1], read(measured / "experiment.toml")[1]
    assert ours.dtype.names == theirs.dtype.names
    for name in ("y_irr", "y_irr_dot", *NOISE):  # of the same order: tracks differ
        assert 0.4 < ours[name].std() / theirs[name][: len(ours)].std() < 2.5
