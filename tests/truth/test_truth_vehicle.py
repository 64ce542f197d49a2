"""The vehicle's truth model: its independence, its track, its laws, and records in the measured layout."""

import ast
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from tests.helpers.paths import SHARED
from tests.truth import vehicle_effects, vehicle_inputs, vehicle_motion
from tests.truth.vehicle import (
    NOISE,
    UNCERTAIN,
    Effects,
    Law,
    Vehicle,
    main,
    matrices,
    measured_rails,
    rough_rails,
    run_over,
    simulate,
    single,
    spectrum_rails,
    true_run,
    write_null_record,
    write_record,
)
from tests.truth.vehicle_effects import SUSPENSIONS, TYPICAL
from tests.truth.vehicle_inputs import HALF_WHEELBASE, LOW, SHORTEST
from tests.truth.vehicle_motion import elements

RECORDS = SHARED / "data" / "experiments"
PROFILES = [spectrum_rails, rough_rails, measured_rails]
K, B = np.full(4, 1e6), np.full(4, 2e4)


def test_it_knows_nothing_of_the_product():
    for module in (vehicle_effects, vehicle_inputs, vehicle_motion):
        tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
        nodes = [n for n in ast.walk(tree) if isinstance(n, ast.Import | ast.ImportFrom)]
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        names |= {n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)}
        roots = {name.split(".")[0] for name in names}
        assert roots <= {"numba", "numpy", "scipy", "tests"} | set(sys.stdlib_module_names)


def test_matrices_are_symmetric_and_a_rigid_lift_is_free_of_force():
    m = matrices(Vehicle())
    for square in (m.B, m.K):
        assert_allclose(square, square.T)
        assert np.linalg.eigvalsh(square).min() > 0
    lift, roll = np.array([1, 0, 0, 1, 0, 1, 0]), np.array([0, 0, 1, 0, 1, 0, 1])
    assert_allclose(m.K @ lift, m.T_k @ np.ones(4), atol=1e-6)
    assert_allclose(m.B @ roll, m.T_b @ np.array([1, -1, 1, -1]), atol=1e-6)


@pytest.mark.parametrize(
    ("location", "numbers"),
    [
        ("secondary", [0, 1, 2, 3]),
        ("primary", [4, 5, 6, 7]),
        ("secondary_fl", [0]),
        ("secondary_rl", [2]),
        ("primary_rr", [7]),
    ],
)
def test_locations_are_those_of_the_contract(location, numbers):
    assert elements(location) == numbers
    with pytest.raises(ValueError, match="not one of secondary"):
        elements(f"{location}x")


@pytest.mark.parametrize("profile", PROFILES)
def test_rails_slope_as_they_rise(profile):
    rails = profile(np.random.default_rng(1), 200.0)
    s, h = np.linspace(0.0, 200.0, 4001), 1e-4
    rise = (rails(s + h)[0] - rails(s - h)[0]) / (2 * h)
    assert_allclose(rails(s)[1], rise, atol=1e-7)
    assert_array_equal(rails(np.array([-5.0, 0.0]))[0], 0.0)


def test_rails_have_the_roughness_asked_for():
    """Half the sum of squared amplitudes is the integral of the spectrum; a long mean comes to it."""
    s = np.arange(200.0, 20000.0, 0.5)
    z = spectrum_rails(np.random.default_rng(2), s[-1], LOW)(s)[0]
    four_times = spectrum_rails(np.random.default_rng(2), s[-1], 4 * LOW)(s)[0]
    assert_allclose(four_times, 2 * z, rtol=1e-9, atol=1e-15)
    W = np.linspace(2 * np.pi / 70, 2 * np.pi / SHORTEST, 100001)
    spectrum = LOW * 0.8246**2 / ((W**2 + 0.0206**2) * (W**2 + 0.8246**2))
    assert_allclose(((z[:, 0] + z[:, 1]) / 2).var(), np.trapezoid(spectrum, W), rtol=0.05)
    cross = spectrum * W**2 / (W**2 + 0.4380**2)
    assert_allclose(((z[:, 0] - z[:, 1]) / 2).var(), np.trapezoid(cross, W), rtol=0.05)


def test_the_rear_bogie_runs_over_what_the_front_one_did():
    rails = spectrum_rails(np.random.default_rng(3), 200.0)
    track = run_over(rails, np.arange(2001) * 0.005, V=20.0, spacing=19.0)
    late = 190  # samples in (a1 + a2)/V = 0.95 s
    assert_allclose(track.u[late:, 2:], track.u[:-late, :2], atol=1e-15)
    assert_array_equal(track.u[0], 0.0)
    assert_array_equal(track.u[:late, 2:], 0.0)
    assert_allclose(np.gradient(track.u, 0.005, axis=0)[1:-1], track.u_dot[1:-1], atol=3e-3)
    straight = run_over(lambda s: (np.column_stack([s, s]), np.ones((len(s), 2))), track.t, 20.0, 19.0)
    assert_allclose(straight.u[:, 0], 20.0 * track.t - HALF_WHEELBASE)  # the mean of both axles


def test_between_samples_the_track_is_the_same_curve():
    rails = spectrum_rails(np.random.default_rng(4), 200.0)
    coarse, t = np.arange(2001) * 0.0025, np.arange(1, 2000) * 0.0025 + 0.0011
    at, exact = run_over(rails, coarse, 20.0, 19.0).interpolator(), run_over(rails, t, 20.0, 19.0)
    u, u_dot = (np.array(values) for values in zip(*map(at, t), strict=True))
    assert_allclose(u, exact.u, atol=1e-7)
    assert_allclose(u_dot, exact.u_dot, atol=2e-5)


@given(
    st.lists(st.floats(-0.05, 0.05), min_size=4, max_size=4),
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
)
def test_laws_that_resist_take_energy(d, v):
    d, v = np.array(d), np.array(v)
    for law in (Law(coulomb=800.0), Law(viscous=1e4), Law(quadratic=1e5)):
        assert (law.force(0.0, d, v, K, B) * v <= 0).all()
    for law in (Law(cubic=1e9), Law(bump_stiffness=2e6, bump_gap=4e-3)):
        assert (law.force(0.0, d, v, K, B) * d <= 0).all()
    slack = Law(play=2e-3).force(0.0, d, v, K, B) - K * d  # of the whole spring
    assert_allclose(slack, -K * np.sign(d) * np.maximum(np.abs(d) - 2e-3, 0), rtol=1e-9, atol=1e-6)


def test_a_change_comes_when_it_is_due():
    law = Law(spring=0.5, damper=0.3, change_time=10.0)
    d, v = np.full(4, 1e-3), np.full(4, 0.1)
    assert_array_equal(law.force(9.99, d, v, K, B), 0.0)
    assert_allclose(law.force(10.0, d, v, K, B), 0.5 * K * d + 0.7 * B * v)


def test_a_halved_spring_is_a_vehicle_with_half_of_it():
    rails = spectrum_rails(np.random.default_rng(5), 60.0)
    track = run_over(rails, np.arange(601) * 0.005, 20.0, 19.0)
    law = simulate(track, effects=single("stiffness_change", "secondary", spring=0.5))
    half = simulate(track, Vehicle(k1=215e3))
    assert_allclose(law.q, half.q, atol=1e-9)


@pytest.fixture(scope="module")
def sound():
    """A run without any effect."""
    return true_run(np.random.default_rng(6), duration=4.0)[1]


@pytest.mark.parametrize("kind", [k for k in TYPICAL if k != "none" and not k.startswith("sensor_")])
def test_each_effect_shows_well_above_the_noise(kind, sound):
    location = "body" if kind in ("harmonic_excitation", "constant_force", "step_force") else "secondary_rl"
    short = {"step_force": {"constant_time": 2.0}, "bump_stop": {"bump_gap": 1e-3}}
    settings = short.get(kind, {})
    _, ill = true_run(np.random.default_rng(6), duration=4.0, effects=single(kind, location, **settings))
    shows = {n: (ill.output(n) - sound.output(n)).std() / noise for n, noise in NOISE.items()}
    assert max(shows.values()) > 1.0


@pytest.mark.parametrize("location", SUSPENSIONS)
def test_nothing_is_nothing_everywhere(location):
    law = Effects(laws={location: Law()})
    a, b = (true_run(np.random.default_rng(7), duration=0.5, effects=e)[1] for e in (Effects(), law))
    assert_array_equal(a.q, b.q)


@pytest.mark.parametrize(
    ("kind", "location", "words"),
    [
        ("rust", "secondary", "'rust' is not one of none"),
        ("coulomb_friction", "body", "it can be at secondary"),
        ("harmonic_excitation", "primary", "it can be at body"),
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
    fault = single("sensor_gain", "z3_ddot", gain=1.5)
    path = write_record(tmp_path, "v", np.random.default_rng(8), duration=6.0, effects=fault)
    _, data = read(path)
    track, true = true_run(np.random.default_rng(8), duration=6.0)
    assert_allclose(data["u_rl_dot"], track.u_dot[:, 2], rtol=1e-6, atol=1e-12)
    for name, noise in NOISE.items():
        gain = 1.5 if name == "z3_ddot" else 1.0
        # 1201 samples tell a standard deviation to 2 %
        assert np.std(data[name] - gain * true.output(name)) == pytest.approx(noise, rel=0.09)


def test_a_fault_of_what_is_not_measured_is_refused(tmp_path):
    with pytest.raises(ValueError, match="z1_dot not among the outputs"):
        write_record(
            tmp_path, "v", np.random.default_rng(8), duration=0.1, effects=single("sensor_bias", "z1_dot")
        )


def test_a_seed_gives_the_same_record_again_and_another_seed_another(tmp_path):
    one, two, other = (
        write_null_record(tmp_path / n, seed, 2.0) for n, seed in (("a", 1), ("b", 1), ("c", 2))
    )
    assert [p.read_bytes() for p in one.parent.iterdir()] == [p.read_bytes() for p in two.parent.iterdir()]
    assert read(one)[1]["z1_ddot"][5] != read(other)[1]["z1_ddot"][5]
    said, _ = read(other)
    assert said["calibrate"] == {n: list(bounds) for n, bounds in UNCERTAIN.items()}


@pytest.mark.skipif(not RECORDS.is_dir(), reason="the shared records are not on this machine")
def test_the_layout_is_that_of_the_measured_records(tmp_path, capsys):
    main([str(tmp_path), "--duration", "6", "--effect", "coulomb_friction", "--name", "vehicle-a"])
    path = Path(capsys.readouterr().out.strip())
    measured = RECORDS / "vehicle-a"
    text = (measured / "experiment.toml").read_text(encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text.replace("36", "3.6").replace("60]", "6]")
    ours, theirs = read(path)[1], read(measured / "experiment.toml")[1]
    assert ours.dtype.names == theirs.dtype.names
    assert_allclose(ours["time"], theirs["time"][: len(ours)])
    for name in NOISE:  # of the same order: tracks differ
        assert 0.3 < ours[name].std() / theirs[name][: len(ours)].std() < 3
