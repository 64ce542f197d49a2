"""Filters through FMUs: from C, from PythonFMU, from another hand; their bands, states carried, restarts."""

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.testing import assert_allclose, assert_array_equal

from estimator.access.recipe import Way
from estimator.filters.bounds import Transform, bounded
from estimator.filters.consistency import mean_band, squares
from estimator.filters.derivatives import differentiated
from estimator.filters.dual import Dual
from estimator.filters.ekf import Ekf
from estimator.filters.estimator import Diverged
from estimator.filters.history import filtered, samples
from estimator.filters.kf import Kf
from estimator.filters.linear import linearised
from estimator.filters.smoother import smoothed
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from estimator.filters.unknown_input import Shaped, Wandering
from fmus.drive.model import Drive
from fmus.errors import BadInput
from fmus.host.fmu import Fmu
from tests.estimator.test_access import LATE
from tests.helpers.vdp import solved

VDP_DT, VDP_NOISE = 0.05, 0.05
PYTHON_VDP = """
n = 20
for _ in range(n):
    x, v, h = self.x, self.h, dt / n
    def f(x, v):
        return v, self.k * (1 - x * x) * v - x + self.u
    a = f(x, v); b = f(x + h / 2 * a[0], v + h / 2 * a[1])
    c = f(x + h / 2 * b[0], v + h / 2 * b[1]); d = f(x + h * c[0], v + h * c[1])
    self.x = x + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
    self.h = v + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
"""
SHOW_SPEED = """def register_variable(self, variable, *more, **named):
    super().register_variable(variable, *more, **named)
    if variable.name == "x":
        super().register_variable(Real("h", causality=Fmi2Causality.output, initial=Fmi2Initial.exact))
"""


def vdp_record(mu=0.8, n=400, seed=1):
    rng = np.random.default_rng(seed)
    t = VDP_DT * np.arange(n)
    u = np.sin(0.7 * t)[:, None]
    truth = solved(t, (u[1:, 0] + u[:-1, 0]) / 2, mu)
    return samples(t, u, truth[:, :1] + VDP_NOISE * rng.standard_normal((n, 1))), truth


def vdp_joint(fmu, names=("x0", "x1", "mu"), outputs=None, **more):
    x0, x1, mu = names
    states = [UnknownState(x0, 2.0, 0.1, 1e-3), UnknownState(x1, 0.0, 0.1, 1e-3)]
    unknown = [UnknownParameter(mu, 1.5, 0.5, bounded((0.0, 10.0)))]
    return Joint(fmu, outputs or [x0], states, unknown, inputs=["u"], dt=VDP_DT, **more)


@pytest.mark.parametrize("made_by", ["c", "python"])
def test_a_system_that_is_driven_by_other_noise_is_a_new_one_to_the_bit(made_by, vdp, foreign):
    """So that one is enough for all noise levels that are tried."""
    s, _ = vdp_record(n=60)
    path = vdp if made_by == "c" else foreign(PYTHON_VDP, SHOW_SPEED)
    names, levels = ("x0", "x1", "mu") if made_by == "c" else ("x", "h", "k"), (1e-3, 1e-1, 1e-3)

    def run(joint, level):
        joint.set_noise((level, level))
        return filtered(Ukf(joint, joint.start(), joint.noise, np.array([[VDP_NOISE**2]]), VDP_DT), s)

    with vdp_joint(path, names) as one:
        again = [run(one, level) for level in levels]
    for level, found in zip(levels, again, strict=True):
        with vdp_joint(path, names) as new:
            assert_array_equal(run(new, level).x, found.x)
    assert not np.array_equal(again[0].x, again[1].x)


@pytest.mark.parametrize("kind", [Ukf, Ekf])
@pytest.mark.parametrize("made_by", ["c", "python"])
def test_the_damping_of_the_oscillator_is_found(kind, made_by, vdp, foreign):
    s, truth = vdp_record()
    path = vdp if made_by == "c" else foreign(PYTHON_VDP, SHOW_SPEED)
    with vdp_joint(path, ("x0", "x1", "mu") if made_by == "c" else ("x", "h", "k")) as joint:
        filter = kind(joint, joint.start(), joint.noise, np.array([[VDP_NOISE**2]]), VDP_DT)
        found = filtered(filter, s)
        value, std = joint.values(found.x[-1:], found.std[-1:])
    assert not found.broken
    assert value[0, 2] == pytest.approx(0.8, abs=3 * std[0, 2])
    assert std[0, 2] < 0.02
    assert_allclose(value[0, :2], truth[-1, :2], atol=0.06)


def test_the_dual_filter_finds_it_where_both_states_are_measured(vdp):
    s, truth = vdp_record()
    y = truth[:, :2] + VDP_NOISE * np.random.default_rng(2).standard_normal((len(truth), 2))
    R = VDP_NOISE**2 * np.eye(2)
    with vdp_joint(vdp, outputs=["x0", "x1"]) as joint:
        found = filtered(Dual(joint, 2, joint.start(), joint.noise, R, VDP_DT), samples(s.t, s.u, y))
        value, std = joint.values(found.x[-1:], found.std[-1:])
    assert value[0, 2] == pytest.approx(0.8, abs=3 * std[0, 2])
    assert std[0, 2] < 0.05


def rig_joint(path, states, **more):
    rig = [UnknownState(n, v, 0.05, 0.01) for n, v in states.items()]
    unknown = [
        UnknownParameter("mu0", 0.35, 0.03, bounded((0.05, 0.8))),
        UnknownParameter("r_w", 0.348, 0.0005, bounded((0.3, 0.4))),
    ]
    return Joint(path, ["omega_w", "omega_r"], rig, unknown, inputs=["T_P"], **more)


@pytest.fixture(scope="module")
def torque():
    t = 0.02 * np.arange(120)
    return t, (350 * np.sin(4 * t) + 350)[:, None]


@pytest.mark.slow
def test_nees_of_the_rig_lies_within_its_band_over_50_seeds(built, torque):
    """Truth drawn from the system that the filter believes in; 300 seeds give 3.8 in a band of 3.7 to 4.3."""
    t, u = torque
    R, last, inside = 0.002**2 * np.eye(2), [], []
    with rig_joint(built("testrig"), {"omega_w": 12.16, "omega_r": 9.36}, dt=0.02) as joint:
        start, Q = joint.start(), joint.noise(0.02)
        start = Kf(identity(joint), start, Q, R, 0.02).now
        for seed in range(50):
            rng = np.random.default_rng(seed)
            x = rng.multivariate_normal(start.x, start.P)
            filter = Ukf(joint, start, joint.noise, R, 0.02)
            carried = start.carried
            for k in range(len(t)):
                if k:
                    moved, carried = joint.f(x[None], (u[k] + u[k - 1]) / 2, t[k - 1], 0.02, carried)
                    x = rng.multivariate_normal(moved[0], Q)
                e = filter.step(u[k], x[:2] + 0.002 * rng.standard_normal(2))
            last.append(squares(e.x - x, e.P))
            inside.append(np.abs(e.x - x) < 1.96 * np.sqrt(np.diag(e.P)))
    assert mean_band(np.array(last), np.full(50, 4.0)).within
    assert 0.86 < np.mean(np.array(inside)[:, 2]) <= 1.0  # friction: 95 % give or take three deviations
    assert 0.86 < np.mean(np.array(inside)[:, 3]) <= 1.0


def identity(joint):
    from estimator.filters.linear import Linear

    n = len(joint.names)
    return Linear(np.eye(n), np.zeros((n, 1)), np.eye(n)[:2], np.zeros((2, 1)), joint.names, joint.outputs)


def test_with_an_fmu_it_is_filterpys_unscented_filter_to_the_ninth_digit(built):
    """The wheelset with its friction and the alignment behind a shaping filter, as in the friction row."""
    rng, dt, outputs = np.random.default_rng(8), 1e-3, ["y", "psi", "y_dot", "psi_dot"]
    spreads = {"y": 1e-3, "psi": 1e-3, "y_dot": 1e-2, "psi_dot": 1e-2, "y_m": 1e-3, "y_m_dot": 1e-2}
    states = [UnknownState(n, 0.1 * std, std, 1e-3 * std) for n, std in spreads.items()]
    friction = [UnknownParameter("mu0", 0.4, 0.1, bounded((0.01, 0.6)), 0.005)]
    alignment = [Shaped("y_irr", 0.8e-3, 1.5, "y_irr_dot", 1.0)]
    R = np.diag([1e-4, 1e-5, 1e-3, 1e-3]) ** 2
    with Joint(
        built("wheelset"), outputs, states, friction, alignment, constants={"V": 40.0}, dt=dt
    ) as joint:
        start = joint.start()
        ours = Ukf(joint, start, joint.noise, R, dt)
        ours.step(np.empty(0), np.full(4, np.nan))

        def move(x, dt):
            return joint.f(x[None], np.empty(0), 0.0, dt, start.carried)[0][0]

        points = MerweScaledSigmaPoints(9, 1.0, 2.0, 0.0)
        theirs = UnscentedKalmanFilter(9, 4, dt, lambda x: x[:4], move, points)
        theirs.x, theirs.P, theirs.Q, theirs.R = start.x, start.P, joint.noise(dt), R
        for _ in range(40):
            y = rng.standard_normal(4) * [2e-4, 2e-5, 2e-3, 2e-3]
            theirs.predict()
            theirs.update(y)
            found = ours.step(np.empty(0), y)
            size = np.sqrt(np.diag(found.P))
            assert_allclose(found.x / size, theirs.x / size, atol=1e-9)
            assert_allclose(found.P / np.outer(size, size), theirs.P / np.outer(size, size), atol=1e-9)
            assert found.log_likelihood == pytest.approx(theirs.log_likelihood, abs=1e-8)


def test_the_oscillators_filter_believes_what_it_should_over_50_seeds(vdp):
    """Truth drawn from what is believed: then errors scatter as the covariance says."""
    R, last = np.array([[VDP_NOISE**2]]), []
    t = VDP_DT * np.arange(400)
    u = np.sin(0.7 * t)[:, None]
    with vdp_joint(vdp) as joint:
        start, Q = joint.start(), joint.noise(VDP_DT)
        for seed in range(50):
            rng = np.random.default_rng(1000 + seed)
            x, carried = rng.multivariate_normal(start.x, start.P), start.carried
            filter = Ukf(joint, start, joint.noise, R, VDP_DT)
            for k in range(len(t)):
                if k:
                    held = (u[k] + u[k - 1]) / 2
                    x = rng.multivariate_normal(joint.f(x[None], held, t[k - 1], VDP_DT, carried)[0][0], Q)
                e = filter.step(u[k], x[:1] + VDP_NOISE * rng.standard_normal(1))
            last.append(((e.x[2] - x[2]) / np.sqrt(e.P[2, 2])) ** 2)
    assert mean_band(np.array(last), np.ones(50)).within


def test_states_that_are_not_estimated_move_with_the_mean(built, torque):
    _, u = torque
    path = built("testrig")
    with rig_joint(path, {"omega_w": 12.16, "omega_r": 9.36}, dt=0.02) as joint:
        assert joint.others == ("theta_w", "theta_r")
        filter = Ukf(joint, joint.start(), joint.noise, 0.002**2 * np.eye(2), 0.02)
        blind = np.full(2, np.nan)
        e = filter.step(u[0], blind)
        with Fmu(path) as fmu:
            for k in range(1, 20):
                start = dict(zip(("omega_w", "omega_r"), e.x[:2], strict=True))
                parameters = dict(
                    zip(("mu0", "r_w"), joint.values(e.x[None], e.x[None])[0][0, 2:], strict=True)
                )
                angles = dict(zip(joint.others, e.carried, strict=True))
                held = float((u[k, 0] + u[k - 1, 0]) / 2)
                fmu.restart(
                    0.0, T_P=held, **{n: float(v) for n, v in {**start, **parameters, **angles}.items()}
                )
                fmu.step(0.02)
                e = filter.step(u[k], blind)
                assert_array_equal(e.carried, fmu.read(joint.others))


def test_a_filter_on_an_fmu_goes_on_exactly_from_a_saved_estimate(vdp):
    s, _ = vdp_record(n=120)
    R = np.array([[VDP_NOISE**2]])
    with vdp_joint(vdp) as joint:
        whole = filtered(Ukf(joint, joint.start(), joint.noise, R, VDP_DT), s, keep=True)
    saved = whole.estimates[59]
    with vdp_joint(vdp) as joint:
        filter = Ukf(joint, saved, joint.noise, R, VDP_DT)
        for k in range(60, 120):
            e = filter.step(s.u[k], s.y[k], float(s.steps[k - 1]), s.held[k - 1])
            assert_array_equal(e.x, whole.estimates[k].x)
            assert_array_equal(e.P, whole.estimates[k].P)


def test_smoothing_makes_it_better(vdp):
    s, truth = vdp_record(n=300)
    with vdp_joint(vdp) as joint:
        kept = filtered(
            Ukf(joint, joint.start(), joint.noise, np.array([[VDP_NOISE**2]]), VDP_DT), s, keep=True
        )
    whole = smoothed(kept.estimates)
    error = [np.sqrt(np.mean((x[:, :2] - truth[:, :2]) ** 2)) for x in (kept.x, whole.x)]
    assert error[1] < 0.7 * error[0]
    assert np.all(np.diagonal(whole.P, axis1=1, axis2=2) <= kept.std**2 * (1 + 1e-6))


@pytest.mark.parametrize("kind", ["shaped", "walk"])
def test_an_unknown_force_on_the_drive_is_recovered(kind, built):
    rng, dt = np.random.default_rng(3), 0.01
    t = dt * np.arange(800)
    force = 40 * np.sin(2 * np.pi * 0.5 * t) + 10 * np.sin(2 * np.pi * 0.31 * t)
    held = (force[1:] + force[:-1]) / 2
    with Fmu(built("drive")) as fmu:
        y = fmu.simulate(t, {"F": np.zeros(799), "F_ext": held}, ["q", "q_dot"], {"M": 20.0, "F_v": 30.0})
    y = y + rng.standard_normal(y.shape) * [1e-4, 1e-3]
    unknown = Shaped("F_ext", 30.0, 0.5) if kind == "shaped" else Wandering("F_ext", 150.0, 30.0)
    states = [UnknownState("q", 0.0, 1e-3, 1e-6), UnknownState("q_dot", 0.0, 1e-2, 1e-5)]
    constants = {"M": 20.0, "F_v": 30.0}
    with Joint(
        built("drive"), ["q", "q_dot"], states, unknown=[unknown], inputs=["F"], constants=constants, dt=dt
    ) as joint:
        assert joint.names[:3] == ("q", "q_dot", "F_ext")
        filter = Ukf(joint, joint.start(), joint.noise, np.diag([1e-8, 1e-6]), dt)
        found = filtered(filter, samples(t, np.zeros((800, 1)), y), keep=True)
    whole = smoothed(found.estimates)
    assert np.sqrt(np.mean((found.x[50:, 2] - force[50:]) ** 2)) < 0.12 * np.sqrt(np.mean(force**2))
    error = whole.x[20:-20, 2] - force[20:-20]
    # a walk knows of no rhythm, so that more of the noise stays
    best = 0.06 if kind == "shaped" else 0.1
    assert np.sqrt(np.mean(error**2)) < best * np.sqrt(np.mean(force**2))
    assert np.mean(np.abs(error) < 1.96 * np.sqrt(whole.P[20:-20, 2, 2])) > 0.85


def test_the_linear_filter_of_a_linear_fmu_is_the_unscented_one(built):
    rng, dt = np.random.default_rng(4), 0.01
    states = [UnknownState("q", 0.1, 0.05, 1e-3), UnknownState("q_dot", 0.0, 0.1, 1e-2)]
    with Joint(built("drive"), ["q", "q_ddot"], states, inputs=["F"], dt=dt) as joint:
        start, R = joint.start(), np.diag([1e-6, 1e-2])
        line = linearised(joint, start.x, np.array([50.0]), dt, np.ones(2))
        assert line.H[1] == pytest.approx([0.0, -200.0 / 95.0], abs=1e-9)
        assert line.D[1] == pytest.approx(1 / 95.0)
        one, other = Ukf(joint, start, joint.noise, R, dt), Kf(line, start, joint.noise, R, dt)
        for _ in range(100):
            u, y = rng.standard_normal(1) * 100, rng.standard_normal(2)
            a, b = one.step(u, y), other.step(u, y)
            assert_allclose(a.x, b.x, atol=1e-9)
            assert_allclose(a.P, b.P, atol=1e-9)


def test_clipping_is_offered_for_comparison(vdp):
    s, _ = vdp_record(mu=0.3, n=200)
    states = [UnknownState("x0", 2.0, 0.1, 1e-3), UnknownState("x1", 0.0, 0.1, 1e-3)]
    unknown = [UnknownParameter("mu", 0.6, 0.3, Transform("clip", 0.5, 2.0))]
    with Joint(vdp, ["x0"], states, unknown, inputs=["u"], dt=VDP_DT) as joint:
        found = filtered(Ukf(joint, joint.start(), joint.noise, np.array([[VDP_NOISE**2]]), VDP_DT), s)
    assert found.x[:, 2].min() >= 0.5
    assert found.x[-1, 2] == pytest.approx(0.5, abs=0.02)  # as near to the truth as it may


def test_an_fmu_that_refuses_ends_the_filter_with_what_it_has(foreign):
    step = "if self.x > 2.0:\n    return False\nself.x += dt * (self.u - self.k * self.x)"
    t = 0.1 * np.arange(60)
    y = np.linspace(0.5, 4.0, 60)[:, None]
    with Joint(foreign(step), ["x"], [UnknownState("x", 0.5, 0.05, 1.0)], inputs=["u"], dt=0.1) as joint:
        found = filtered(
            Ukf(joint, joint.start(), joint.noise, np.array([[1e-4]]), 0.1), samples(t, 0 * y, y)
        )
    assert "a step at t" in found.broken
    assert 0 < len(found.t) < 60
    with (
        pytest.raises(Diverged),
        Joint(foreign(step), ["x"], [UnknownState("x", 0.5, 1e-3)], dt=0.1) as joint,
    ):
        joint.f(np.array([[3.0]]), np.empty(0), 0.0, 0.1, np.empty(0))


@pytest.mark.parametrize(
    ("states", "outputs", "words"),
    [
        (["x0", "x1"], ["x0", "x7"], "has no variable 'x7'"),
        (["x0", "x1", "u"], ["x0"], "'u' is named twice"),
    ],
)
def test_names_that_do_not_fit(vdp, states, outputs, words):
    with pytest.raises(BadInput, match=words):
        Joint(vdp, outputs, [UnknownState(n, 0.0, 1.0) for n in states], inputs=["u"])


def test_an_output_that_is_no_function_of_the_state_is_refused(foreign):
    late = foreign("self.y = 3 * self.x\nself.x += dt * (self.u - self.k * self.x)", LATE)
    with pytest.raises(BadInput, match=r"output 'y' is computed in steps only, not from the states, and a"):
        Joint(late, ["y"], [UnknownState("x", 1.0, 1.0)], inputs=["u"], dt=0.01)


def test_an_output_that_is_computed_in_steps_is_seen_with_the_input_of_its_sample(foreign):
    """h' = -k h + sin 3t from rest, and h + 0.5 sin 3t is measured; a late input would show as a bias."""
    k, w, dt, noise = 2.0, 3.0, 0.02, 1e-3
    t = np.arange(0.0, 10.0, dt)
    u = np.sin(w * t)
    h = (k * u - w * np.cos(w * t) + w * np.exp(-k * t)) / (k**2 + w**2)
    y = h + 0.5 * u + noise * np.random.default_rng(3).standard_normal(len(t))
    exact = (
        "away = self.x - self.u / self.k\nself.x = self.u / self.k + away * math.exp(-self.k * dt)\n"
        "self.y = self.x + 0.5 * self.u"
    )
    unknowns = [UnknownState("x", 0.0, 1e-3)], [UnknownParameter("k", 1.5, 0.5, bounded((0.0, 9.0)))]
    with Joint(foreign(exact, LATE), ["y"], *unknowns, inputs=["u"], dt=dt) as joint:
        s = samples(t, u[:, None], y[:, None], 1)
        found = filtered(Ukf(joint, joint.start(), joint.noise, np.array([[noise**2]]), dt), s)
        value, std = joint.values(found.x, found.std)
    assert abs(value[-1, 1] - k) < 3 * std[-1, 1] < 3e-3


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    """The drive as a native FMU, for co-simulation and model exchange."""
    build = pytest.importorskip("fmus.export.builders.native.build", reason="native FMUs are not built here")
    return build.build_native(Drive(), tmp_path_factory.mktemp("native"))


def drive_joint(path, **more):
    states = [UnknownState("q", 0.0, 0.01, 1e-4), UnknownState("q_dot", 0.1, 0.05, 1e-3)]
    unknown = [UnknownParameter("F_v", 150.0, 50.0, bounded((0.0, float("inf"))))]
    force = [Shaped("F_ext", 30.0, 0.5)]
    return Joint(path, ["q", "q_ddot"], states, unknown, force, inputs=["F"], dt=0.01, **more)


@pytest.mark.slow
@pytest.mark.parametrize("way", [Way.RESUME, Way.EXCHANGE])
def test_the_fmus_own_derivatives_and_differences_make_the_same_extended_filter(native, way):
    rng = np.random.default_rng(6)
    with drive_joint(native, way=way) as joint:
        assert joint.names == ("q", "q_dot", "F_v", "F_ext", "F_ext_rate")
        own = differentiated(joint, np.array([20.0]), 0.0, 0.01)
        assert own is not None
        start, R = joint.start(), np.diag([1e-6, 1e-2])
        filters = [Ekf(system, start, joint.noise, R, 0.01) for system in (own, joint)]
        for _ in range(60):
            u, y = 50 * rng.standard_normal(1), rng.standard_normal(2) * [1e-3, 0.1]
            one, other = (f.step(u, y) for f in filters)
        deviation = np.sqrt(np.diag(other.P))
        assert_allclose((one.x - other.x) / deviation, 0.0, atol=1e-3)
        assert_allclose(np.diag(one.P), np.diag(other.P), rtol=1e-3)


def test_an_fmu_without_derivatives_is_differenced(vdp):
    with vdp_joint(vdp) as joint:
        assert differentiated(joint, np.zeros(1), 0.0, VDP_DT) is None
