"""The vehicle against the independent truth: its matrices, effects built in, a measured record."""

import tomllib
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares

from fmus.effects import EFFECTS
from fmus.host.fmu import Fmu
from fmus.model import equations
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from fmus.vehicle7dof.model import CORNERS, FORCES, Vehicle7dof
from tests.helpers.everything import values
from tests.helpers.paths import SHARED
from tests.helpers.vehicle_equations import (
    INPUTS,
    MADE,
    STATES,
    P,
    linear_run,
    system,
    vectors,
)
from tests.truth.vehicle import (
    NOISE,
    Vehicle,
    matrices,
    run_over,
    simulate,
    single,
    spectrum_rails,
)

VEHICLE_C = SHARED / "data" / "experiments" / "vehicle-c"
sizes = st.fixed_dictionaries(
    {f.name: st.floats(0.5, 2.0).map(lambda x, at=f.default: x * at) for f in fields(Vehicle)}
)


@given(sizes)
def test_matrices_are_those_assembled_from_incidence_vectors(size):
    A, B, *_ = system(**size)
    m, u = matrices(Vehicle(**size)), len(CORNERS)
    for found, expected in (
        (A[7:, :7], -m.K),
        (A[7:, 7:], -m.B),
        (B[7:, :u], m.T_k),
        (B[7:, u : 2 * u], m.T_b),
        (B[7:, 2 * u :], np.eye(7)),
    ):
        assert_allclose(m.M @ found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert_array_equal(A[:7], np.eye(14)[7:])
    assert not B[:7].any()


LAWS = {
    "coulomb_friction": {"F_c": 800.0},
    "bump_stop": {"k": 2e6, "gap": 2e-3},
    "cubic_stiffness": {"k_3": 1e10},
    "hysteresis": {"F_h": 500.0},
    "stiffness_change": {"change": -0.5},
}


@pytest.mark.parametrize("suspension", ["secondary", "primary"])
@pytest.mark.parametrize("kind", LAWS)
def test_a_law_at_a_suspension_is_the_same_law_at_its_four_corners(suspension, kind):
    effect, rng = EFFECTS[kind], np.random.default_rng(8)
    own = {p.name: p.start for p in effect.parameters("translation")} | LAWS[kind]
    corners = [f"{suspension}_{c}" for c in CORNERS]
    for _ in range(5):
        x = {n: rng.uniform(-1e-2, 1e-2) for n in STATES}
        u = {n: rng.uniform(-1e-2, 1e-2) for n in INPUTS if n.startswith("u_")}
        found = []
        for places in ([suspension], corners):
            model = Vehicle7dof([(effect, place) for place in places])
            p = P | {effect.name_at(place, n): value for place in places for n, value in own.items()}
            # states that the effect brought (a clock, memories) are at the same value everywhere
            point = [x.get(v.name, 100.0) for v in model.of(State)], [u.get(n, 0.0) for n in INPUTS]
            dot = values(equations(model).f, *point, [p[v.name] for v in model.of(Parameter)])
            found.append(dot[: len(STATES)])
        assert_allclose(*found, rtol=1e-9, atol=1e-9)
        sound = values(MADE.f, *vectors(x, u, {}))
        assert np.abs(found[0] - sound).max() > 1e-3


def test_the_probe_of_a_suspension_pushes_at_all_corners_and_shows_their_mean():
    probed = Vehicle7dof(probes=True)
    made, p = equations(probed), [P[v.name] for v in probed.of(Parameter)]
    x = dict(zip(STATES, np.random.default_rng(9).uniform(-1e-2, 1e-2, 14).tolist(), strict=True))

    def at(**u):
        inputs = [u.get(v.name, 0.0) for v in probed.of(Input)]
        names = [v.name for v in probed.of(Output)]
        return dict(zip(names, values(made.h, [*x.values()], inputs, p), strict=True))

    together = at(secondary_force=500.0)
    apart = at(**{f"secondary_{c}_force": 500.0 for c in CORNERS})
    for q in FORCES:
        assert together[f"{q}_ddot"] == pytest.approx(apart[f"{q}_ddot"], rel=1e-12)
    for what, end in (("displacement", ""), ("velocity", "_dot")):
        mean = np.mean([together[f"d_s_{c}{end}"] for c in CORNERS])
        assert together[f"secondary_{what}"] == pytest.approx(mean, rel=1e-12)


RATES = [f"{q}_dot" for q in FORCES]


def over(track, fmu, start_values):
    """Rates of the coordinates (N, 7) in a free run of an FMU over a track."""
    names = [f"u_{c}{end}" for end in ("", "_dot") for c in CORNERS]
    u = np.hstack([track.u, track.u_dot])
    held = dict(zip(names, ((u[1:] + u[:-1]) / 2).T, strict=True))
    with Fmu(fmu) as vehicle:
        return vehicle.simulate(track.t, held, RATES, start_values)


def truly(track, effects):
    true = simulate(track, effects=effects)
    return np.column_stack([true.output(n) for n in RATES])


@pytest.fixture(scope="module")
def track_and_sound():
    """Four seconds of track at 20 m/s, and what the true vehicle without any effect does there."""
    t = np.arange(3201) * 1.25e-3
    track = run_over(spectrum_rails(np.random.default_rng(3), 80.0), t, 20.0, 19.0)
    return track, truly(track, single("none", ""))


@pytest.mark.parametrize(
    ("kind", "location", "settings", "start_values"),
    [
        ("none", "", {}, {}),
        ("coulomb_friction", "secondary", {}, {"F_c": 800.0, "v_s": 1e-3}),
        ("bump_stop", "secondary_fl", {"bump_gap": 1.5e-3}, {"k": 2e6, "gap": 1.5e-3}),
        ("free_play", "primary_rr", {}, {"k": 2 * 1220e3, "gap": 5e-4}),
        ("quadratic_damping", "primary", {}, {"c": 3e5}),
        ("stiffness_change", "secondary_rl", {}, {"change": -0.5}),
    ],
)
def test_an_effect_moves_the_fmu_as_it_moves_the_independent_truth(
    built, track_and_sound, kind, location, settings, start_values
):
    track, sound = track_and_sound
    true = truly(track, single(kind, location, **settings)) if location else sound
    chosen = (f"{kind}@{location}",) if location else ()
    own = {f"{kind}_{location}_{n}": v for n, v in start_values.items()}
    run = over(track, built("vehicle7dof", *chosen), own)
    # inputs held over 1.25 ms are off by (w dt)^2/12 = 6e-4 at 11 Hz
    assert ((run - true).std(axis=0) < 1e-3 * run.std(axis=0)).all()
    if location:
        assert ((true - sound).std(axis=0) > 2e-2 * sound.std(axis=0)).any()


@pytest.mark.skipif(not VEHICLE_C.is_dir(), reason="the shared records are not on this machine")
def test_a_record_without_discrepancy_is_explained_by_calibration_alone():
    said = tomllib.loads((VEHICLE_C / "experiment.toml").read_text(encoding="utf-8"))
    data = np.genfromtxt(VEHICLE_C / "data.csv", delimiter=",", names=True)
    u = np.column_stack([data[n] if n in said["inputs"] else np.zeros_like(data["time"]) for n in INPUTS])
    y = np.column_stack([data[n] for n in NOISE])
    noise = np.array([said["outputs"][n]["noise_std"] for n in NOISE])
    fit = data["time"] < said["split"]["test"][0]
    declared = {n: said["parameters"][n] for n in said["calibrate"]}

    def residual(factors):
        """Measured minus simulated over noise, inputs linear between samples."""
        theta = {n: f * p for f, (n, p) in zip(factors, declared.items(), strict=True)}
        return (y - linear_run(data["time"], u, NOISE, **(said["parameters"] | theta))) / noise

    found = least_squares(lambda f: residual(f)[fit].ravel(), np.ones(4), diff_step=1e-4)
    for factor, (low, high), p in zip(found.x, said["calibrate"].values(), declared.values(), strict=True):
        assert low < factor * p < high
    left = np.sqrt(np.mean(residual(found.x)[~fit] ** 2, axis=0))
    # 4800 samples tell a standard deviation to 1 %; four times that
    assert_allclose(left, 1.0, atol=0.04)
    # and the record can tell: springs a few percent off show
    assert np.sqrt(np.mean(residual(np.ones(4))[~fit] ** 2, axis=0)).max() > 3
