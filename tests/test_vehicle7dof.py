"""The vehicle: modes, symmetry, energy, each corner by hand, and the independent truth."""

import tomllib
from dataclasses import fields
from pathlib import Path

import casadi as cs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares
from scipy.signal import cont2discrete

from fmus.effects import EFFECTS
from fmus.host.fmu import Fmu
from fmus.model import equations
from fmus.variables import Input, Output, Parameter, State
from fmus.vehicle7dof.model import CORNERS, FORCES, Vehicle7dof
from tests.everything import start, values
from tests.truth.vehicle import NOISE, Vehicle, matrices, run_over, simulate, single, spectrum_rails

MODEL = Vehicle7dof()
MADE = equations(MODEL)
STATES, INPUTS, PARAMETERS, OUTPUTS = (
    [v.name for v in MODEL.of(k)] for k in (State, Input, Parameter, Output)
)
P = dict(zip(PARAMETERS, start(MODEL, Parameter).tolist(), strict=True))
INERTIA = dict(zip(FORCES, ("m1", "J_y1", "J_x1", "m2", "J_x2", "m2", "J_x2"), strict=True))
VEHICLE_C = Path(__file__).parents[2] / "shared" / "data" / "experiments" / "vehicle-c"
SIDE = {"fl": 1, "fr": -1, "rl": 1, "rr": -1}  # y over its half width
END = {"fl": 1, "fr": 1, "rl": -1, "rr": -1}  # x over the distance of its bogie
BOGIE = {"fl": 2, "fr": 2, "rl": 3, "rr": 3}
each_corner = pytest.mark.parametrize("c", CORNERS)

small = st.floats(-1e-2, 1e-2)
motions = st.fixed_dictionaries(dict.fromkeys(STATES, small))
rails = st.fixed_dictionaries({f"u_{c}{end}": small for c in CORNERS for end in ("", "_dot")})
pushes = st.fixed_dictionaries({name: st.floats(-1e4, 1e4) for name in FORCES.values()})
healths = st.fixed_dictionaries(
    {f"h_{e}_{c}": st.floats(0.1, 3.0) for e in ("k1", "b1", "k2", "b2") for c in CORNERS}
)


def vectors(x, u, p):
    return (
        [x.get(n, 0.0) for n in STATES],
        [u.get(n, 0.0) for n in INPUTS],
        list((P | p).values()),
    )


def outputs(x=None, u=None, **parameters):
    """Outputs by name at states and inputs by name, those not given at 0."""
    return dict(zip(OUTPUTS, values(MADE.h, *vectors(x or {}, u or {}, parameters)), strict=True))


def accelerations(x=None, u=None, **parameters):
    """Accelerations by coordinate."""
    found = outputs(x, u, **parameters)
    return {q: found[f"{q}_ddot"] for q in FORCES}


def forces(x=None, u=None, **parameters):
    """Mass times acceleration by coordinate."""
    p = P | parameters
    return {q: a * p[INERTIA[q]] for q, a in accelerations(x, u, **parameters).items()}


def system(**parameters):
    """A, B of x' = A x + B u and C, D of the outputs."""
    x, u = (cs.SX.sym(n, len(names)) for n, names in (("x", STATES), ("u", INPUTS)))
    p = list((P | parameters).values())
    dot, y = MADE.f(x, u, p), MADE.h(x, u, p)
    parts = [cs.jacobian(of, by) for of in (dot, y) for by in (x, u)]
    return [np.array(m.full()) for m in cs.Function("parts", [x, u], parts)(0, 0)]


def settled(u, **parameters):
    """Coordinates at rest under constant inputs by name."""
    A, B, *_ = system(**parameters)
    x = np.linalg.solve(A, -B @ vectors({}, u, {})[1])
    return dict(zip(STATES, x.tolist(), strict=True))


def modes(**parameters):
    """Undamped frequency, Hz, and damping ratio of each mode, slowest first."""
    poles = np.linalg.eigvals(system(**parameters)[0])
    poles = sorted(poles[poles.imag > 0], key=abs)
    return np.array([(abs(s) / 2 / np.pi, -s.real / abs(s)) for s in poles]).T


def test_parameters_are_those_of_the_thesis_and_of_the_truth():
    assert {f.name: f.default for f in fields(Vehicle)} == {
        n: v for n, v in P.items() if not n.startswith("h_")
    }
    assert {v for n, v in P.items() if n.startswith("h_")} == {1.0}


def test_modes_with_two_springs_on_each_bogie_side():
    frequency, damping = modes()
    # references rounded at the fourth decimal
    assert_allclose(frequency, [0.8095, 1.0802, 1.3106, 7.4114, 7.4271, 9.1661, 9.1888], rtol=1e-4)
    assert_allclose(damping, [0.1014, 0.1345, 0.1625, 0.2406, 0.2367, 0.2856, 0.2816], rtol=1e-3)


def test_modes_with_one_spring_on_each_bogie_side():
    frequency, _ = modes(n_primary=1.0)
    assert_allclose(frequency, [0.7547, 1.0054, 1.2189, 5.6350, 5.6422, 6.9527, 6.9672], rtol=1e-4)


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


@given(motions, rails)
def test_n_springs_are_n_times_a_spring(x, u):
    three = accelerations(x, u, n_primary=3.0)
    stiffer = accelerations(x, u, n_primary=1.0, k2=3 * P["k2"], b2=3 * P["b2"])
    assert_allclose([*three.values()], [*stiffer.values()], rtol=1e-9, atol=1e-9)


@given(healths, st.floats(5.0, 15.0), st.floats(0.5, 1.5))
def test_a_uniform_step_is_followed_whatever_the_health(health, a1, c1):
    u = {f"u_{c}": 1e-3 for c in CORNERS}
    found = settled(u, **health, a1=a1, c1=c1)
    expected = {q: 1e-3 if q in ("z1", "z2", "z3") else 0.0 for q in STATES}
    assert_allclose([found[n] for n in STATES], [*expected.values()], atol=1e-12)


def test_a_uniform_step_settles_with_gain_one_in_the_fmu(built):
    t = np.linspace(0, 30, 1501)
    inputs = {f"u_{c}": np.full(1500, 1e-3) for c in CORNERS}
    names = [*FORCES, "d_s_fl", "d_p_rr"]
    with Fmu(built("vehicle7dof")) as fmu:
        run = fmu.simulate(t, inputs, names, {})
    # coach roll is not moved and bounce has decayed to exp(-27)
    assert_allclose(run[-1], [1e-3, 0, 0, 1e-3, 0, 1e-3, 0, 0, 0], atol=1e-10)
    assert run[:, 0].max() > 1.3e-3  # it swung


def test_cross_level_rolls_all_bodies_alike():
    found = settled({f"u_{c}": SIDE[c] * 1e-3 for c in CORNERS})
    rolls = {"phi_x1", "phi_x2", "phi_x3"}
    assert_allclose([found[q] for q in FORCES], [1e-3 if q in rolls else 0.0 for q in FORCES], atol=1e-12)


def test_a_front_that_is_higher_pitches_the_coach_upwards():
    found = settled({f"u_{c}": END[c] * 1e-3 for c in CORNERS})
    expected = {"phi_y1": -1e-3 / P["a1"], "z2": 1e-3, "z3": -1e-3}
    assert_allclose([found[q] for q in FORCES], [expected.get(q, 0.0) for q in FORCES], atol=1e-12)


def test_twist_rolls_the_bogies_against_each_other():
    found = settled({f"u_{c}": SIDE[c] * END[c] * 1e-3 for c in CORNERS})
    primary, secondary = P["n_primary"] * P["k2"] * P["c2"] ** 2, P["k1"] * P["c1"] ** 2
    phi = primary / (primary + secondary) * 1e-3 / P["c2"]  # the coach does not roll and holds it back
    expected = {"phi_x2": phi, "phi_x3": -phi}
    assert_allclose([found[q] for q in FORCES], [expected.get(q, 0.0) for q in FORCES], atol=1e-12)


@each_corner
@pytest.mark.parametrize(("what", "element"), [("", "k2"), ("_dot", "b2")])
def test_a_rail_under_a_corner_pushes_its_bogie_alone(c, what, element):
    found = forces(u={f"u_{c}{what}": 1e-3})
    push = P["n_primary"] * P[element] * 1e-3
    expected = {f"z{BOGIE[c]}": push, f"phi_x{BOGIE[c]}": SIDE[c] * P["c2"] * push}
    assert_allclose([found[q] for q in FORCES], [expected.get(q, 0.0) for q in FORCES], atol=1e-9)


@pytest.mark.parametrize(("what", "k1", "k2"), [("", "k1", "k2"), ("_dot", "b1", "b2")])
@pytest.mark.parametrize(
    ("coordinate", "expected"),  # on z1 phi_y1 phi_x1 z2 phi_x2 z3 phi_x3: times s secondary, p primary
    [
        ("z1", lambda s, p, a, c: (-4 * s, 0, 0, 2 * s, 0, 2 * s, 0)),
        ("phi_y1", lambda s, p, a, c: (0, -4 * a * a * s, 0, -2 * a * s, 0, 2 * a * s, 0)),
        ("phi_x1", lambda s, p, a, c: (0, 0, -4 * c * c * s, 0, 2 * c * c * s, 0, 2 * c * c * s)),
        ("z2", lambda s, p, a, c: (2 * s, -2 * a * s, 0, -2 * s - 2 * p, 0, 0, 0)),
        ("phi_x2", lambda s, p, a, c: (0, 0, 2 * c * c * s, 0, -2 * c * c * s - 2 * p, 0, 0)),
        ("z3", lambda s, p, a, c: (2 * s, 2 * a * s, 0, 0, 0, -2 * s - 2 * p, 0)),
        ("phi_x3", lambda s, p, a, c: (0, 0, 2 * c * c * s, 0, 0, 0, -2 * c * c * s - 2 * p)),
    ],
)
def test_each_coordinate_by_hand(coordinate, expected, what, k1, k2):
    q, c = 1e-3, 1.2  # c2 stays 1 m, so that the two widths are told apart
    found = forces({f"{coordinate}{what}": q}, c1=c)
    by_hand = expected(P[k1], P["n_primary"] * P[k2], P["a1"], c)
    assert_allclose([*found.values()], np.multiply(by_hand, q), atol=1e-9)


@each_corner
def test_deflections_are_heights_of_points_less_each_other(c):
    x = {q: 1e-3 * i for i, q in enumerate(STATES, 1)}
    u = {f"u_{c}": 0.02, f"u_{c}_dot": 0.03}
    found, i, y = outputs(x, u), BOGIE[c], SIDE[c] * P["c1"]
    for end in ("", "_dot"):
        coach = x[f"z1{end}"] - END[c] * P["a1"] * x[f"phi_y1{end}"] + y * x[f"phi_x1{end}"]
        bogie = x[f"z{i}{end}"] + y * x[f"phi_x{i}{end}"]  # c1 = c2
        assert found[f"d_s_{c}{end}"] == pytest.approx(coach - bogie, rel=1e-12)
        assert found[f"d_p_{c}{end}"] == pytest.approx(bogie - u[f"u_{c}{end}"], rel=1e-12)


def mirrored(by_name, corners, turned):
    """Values as seen in a mirror: corners changed places, some coordinates turned round."""
    found = {}
    for name, value in by_name.items():
        stem, _, c = name.removesuffix("_dot").rpartition("_")
        end = "_dot" if name.endswith("_dot") else ""
        coordinate = name.removesuffix("_dot")
        if c in corners:
            found[f"{stem}_{corners[c]}{end}"] = value
        else:
            new, sign = turned.get(coordinate, (coordinate, 1))
            found[f"{new}{end}"] = sign * value
    return found


LEFT_RIGHT = (
    {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"},
    {q: (q, -1) for q in ("phi_x1", "phi_x2", "phi_x3")},
)
FRONT_REAR = (
    {"fl": "rl", "rl": "fl", "fr": "rr", "rr": "fr"},
    {
        "phi_y1": ("phi_y1", -1),
        **{f"{q}{i}": (f"{q}{j}", 1) for q in ("z", "phi_x") for i, j in ((2, 3), (3, 2))},
    },
)


@pytest.mark.parametrize("mirror", [LEFT_RIGHT, FRONT_REAR], ids=["left-right", "front-rear"])
@given(motions, rails, healths)
def test_a_mirror_shows_the_same_vehicle(mirror, x, u, health):
    here = mirrored(accelerations(x, u, **health), *mirror)
    there = accelerations(mirrored(x, *mirror), mirrored(u, *mirror), **mirrored(health, *mirror))
    assert_allclose([there[q] for q in FORCES], [here[q] for q in FORCES], rtol=1e-9, atol=1e-9)


def power(x, u, p):
    """Rate of energy, dissipation, power of rails and of outer forces, W; and the energy, J."""
    y, p = outputs(x, u, **p), P | p
    energy = sum(p[INERTIA[q]] * x[f"{q}_dot"] ** 2 / 2 for q in FORCES)
    rate = sum(p[INERTIA[q]] * x[f"{q}_dot"] * y[f"{q}_ddot"] for q in FORCES)
    lost, rail = 0.0, 0.0
    for c in CORNERS:
        for n, k, b, d in ((1.0, "k1", "b1", f"d_s_{c}"), (p["n_primary"], "k2", "b2", f"d_p_{c}")):
            k_c, b_c = n * p[k] * p[f"h_{k}_{c}"], n * p[b] * p[f"h_{b}_{c}"]
            energy += k_c * y[d] ** 2 / 2
            rate += k_c * y[d] * y[f"{d}_dot"]
            lost += b_c * y[f"{d}_dot"] ** 2
            if d.startswith("d_p"):
                rail -= (k_c * y[d] + b_c * y[f"{d}_dot"]) * u[f"u_{c}_dot"]
    outer = sum(u.get(force, 0.0) * x[f"{q}_dot"] for q, force in FORCES.items())
    return rate, lost, rail, outer, energy


@given(motions, rails, pushes, healths)
def test_power_of_rails_and_forces_is_stored_or_dissipated(x, u, push, health):
    rate, lost, rail, outer, _ = power(x, u | push, health)
    assert lost >= 0
    # the terms cancel: to 1e-9 of their size, and of 1 W where all are small
    assert abs(rate + lost - rail - outer) <= 1e-9 * (abs(rate) + lost + abs(rail) + abs(outer) + 1)


def test_energy_of_a_run_is_the_work_done_on_it(built):
    t = np.linspace(0, 5, 5001)
    waves = {
        c: (2e-3, 2 * np.pi * f, phase) for c, f, phase in zip(CORNERS, (1, 1.7, 5, 9), range(4), strict=True)
    }
    u = {f"u_{c}": a * np.sin(w * t + phase) for c, (a, w, phase) in waves.items()}
    u |= {f"u_{c}_dot": a * w * np.cos(w * t + phase) for c, (a, w, phase) in waves.items()}
    u["F_z1_ext"] = 1e3 * np.sin(7 * t)
    with Fmu(built("vehicle7dof")) as fmu:
        run = fmu.simulate(t, {n: (v[1:] + v[:-1]) / 2 for n, v in u.items()}, STATES, {"z1": 5e-3})
    flows = np.array(
        [
            power(dict(zip(STATES, row, strict=True)), {n: float(v[k]) for n, v in u.items()}, {})
            for k, row in enumerate(run.tolist())
        ]
    )
    _, lost, rail, outer, energy = flows.T
    net = np.trapezoid(rail + outer - lost, t)
    done = np.trapezoid(np.abs(rail) + np.abs(outer) + lost, t)
    # inputs held over 1 ms and the trapezoidal rule: both of second order, (w dt)^2/12 = 3e-4 at 9 Hz
    assert abs(energy[-1] - energy[0] - net) < 3e-4 * done
    assert done > 10 * abs(energy[-1] - energy[0])


@each_corner
@pytest.mark.parametrize("element", ["k1", "b1", "k2", "b2"])
@given(x=motions, u=rails, health=st.floats(0.0, 3.0))
def test_a_health_factor_changes_its_element_alone(c, element, x, u, health):
    sound, ill = outputs(x, u), outputs(x, u, **{f"h_{element}_{c}": health})
    moved = {q: (ill[f"{q}_ddot"] - sound[f"{q}_ddot"]) * P[INERTIA[q]] for q in FORCES}
    secondary = element[1] == "1"
    d = sound[f"d_{'s' if secondary else 'p'}_{c}{'_dot' if element[0] == 'b' else ''}"]
    force = (1 - health) * P[element] * d * (1.0 if secondary else P["n_primary"])
    y, i = SIDE[c] * P["c1"], BOGIE[c]
    up = {f"z{i}": force, f"phi_x{i}": y * force}
    if secondary:
        up = {q: -f for q, f in up.items()}
        up |= {"z1": force, "phi_y1": -END[c] * P["a1"] * force, "phi_x1": y * force}
    size = 1e-12 * sum(abs(a) for a in sound.values()) * P["J_y1"]
    assert_allclose([moved[q] for q in FORCES], [up.get(q, 0.0) for q in FORCES], atol=1e-9 + size)
    same = [n for n in OUTPUTS if n.startswith("d_")]
    assert [ill[n] for n in same] == [sound[n] for n in same]


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


def linear_run(t, u, names, **parameters):
    """Outputs (N, n) of the model from rest, exact for inputs that run linearly between even samples."""
    A, B, C, D = system(**parameters)
    states, shown = {n: i for i, n in enumerate(STATES)}, {n: i for i, n in enumerate(OUTPUTS)}
    C_y = np.array([np.eye(len(STATES))[states[n]] if n in states else C[shown[n]] for n in names])
    D_y = np.array([0 * D[0] if n in states else D[shown[n]] for n in names])
    A_d, B_d, C_d, D_d, _ = cont2discrete((A, B, C_y, D_y), t[1] - t[0], "foh")
    x, driven, y = np.zeros(len(A)), u @ B_d.T, u @ D_d.T
    for k in range(len(t)):
        y[k] += C_d @ x
        x = A_d @ x + driven[k]
    return y
