"""The parts of the chain against what statistics and mechanics say they must give."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.closeloop.decision.model_form import gap_closed
from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.fitting.resolution import in_long_steps
from estimator.closeloop.hypotheses.fitted import sandwich
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.levers import Course, shifts
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.closeloop.screening.pushes import pushed
from estimator.closeloop.screening.screen import screen
from estimator.noise import correlation_time, noise_floor
from estimator.plant import Steps
from estimator.record import Record, Run
from estimator.sensor_faults import FAULTS, faulty
from estimator.weighting import Weighting
from fmus.drive.model import Drive
from fmus.effects.spectrum import orders
from fmus.export.around.outside import around
from fmus.export.builders.hypotheses import ForeignBuilder, ModelBuilder
from fmus.export.builders.pythonfmu import build_python
from fmus.host.description import PortNames
from tests.helpers.baselines import fit_with

CARRIAGE = PortNames("carriage", "F_ext", "q_dot", "q")
DT, SAMPLES = 0.01, 1500
NOISE = np.array([1e-5, 1e-4])  # m, m/s


def drive_motion(force: np.ndarray, M: float = 95.0, F_v: float = 200.0) -> np.ndarray:
    """Position and velocity of a mass with viscous friction, force linear between samples; exact."""
    q, v, motion = 0.0, 0.0, []
    decay = F_v / M
    for f0, f1 in zip(force, [*force[1:], force[-1]], strict=True):
        motion.append((q, v))
        f = (f0 + f1) / 2
        steady = f / F_v
        left = np.exp(-decay * DT)
        q += steady * DT + (v - steady) * (1 - left) / decay
        v = steady + (v - steady) * left
    return np.array(motion)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> ForeignBuilder:
    """The drive as a foreign FMU with its port."""
    folder = tmp_path_factory.mktemp("drive")
    return ForeignBuilder(build_python(Drive(), folder), (CARRIAGE,), folder)


def problem(drive: ForeignBuilder, missing: np.ndarray, rng: np.random.Generator) -> Problem:
    """A record of a drive on which a force acts that its FMU does not know, and the question to it."""
    t = np.arange(SAMPLES) * DT
    F = 60 * np.sin(2 * np.pi * t / 4) + 20 * np.sin(2 * np.pi * t / 0.7)
    y = drive_motion(F + missing) + NOISE * rng.standard_normal((SAMPLES, 2))
    run = Run(t, F[:, None], y, t < 10, t >= 10, t >= 10)
    record = Record((run,), ("F",), ("q", "q_dot"), NOISE)
    declared = {"M": 95.0, "F_v": 200.0, "q": 0.0, "q_dot": 0.0}
    return Problem(drive, record, declared, {"M": (80.0, 110.0)}, (), (CARRIAGE,))


@pytest.mark.parametrize("several", [1, 3, 6])
def test_several_simulations_are_each_as_one(drive: ForeignBuilder, tmp_path: Path, several: int) -> None:
    rng = np.random.default_rng(3)
    asked = problem(drive, np.zeros(SAMPLES), rng)
    thetas = [{"M": 85.0 + 4 * i, "q_dot_bias": 0.01 * i} for i in range(several)]
    for builder in (drive, ModelBuilder("drive", tmp_path)):
        here = replace(asked, builder=builder)
        for found, theta in zip(here.several_residuals(thetas), thetas, strict=True):
            assert_allclose(found, here.residuals(theta), rtol=1e-12, atol=1e-15)


def test_a_foreign_fmu_that_is_coupled_rarely_moves_alone_as_before_and_with_an_effect_nearly_so(
    drive,
) -> None:
    asked = problem(drive, np.zeros(SAMPLES), np.random.default_rng(3))
    damped = asked.with_effects([("viscous_damping", "carriage")])
    rare = in_long_steps(asked).steps
    assert rare == Steps(coupled=pytest.approx(DT / asked.policy.candidates.readings))
    [alone], [now] = asked.simulate({}), asked.in_steps(rare).simulate({})
    assert_allclose(now, alone, rtol=1e-9, atol=1e-12)
    theta = {"viscous_damping_carriage_c": 200.0}  # as much as the drive has itself
    [often], [now] = damped.simulate(theta), damped.in_steps(rare).simulate(theta)
    assert 0 < np.max(np.abs(now - often)) < 1e-4 * np.max(np.abs(often - alone))


def test_the_missing_force_is_recovered_within_its_own_error(drive: ForeignBuilder) -> None:
    t = np.arange(SAMPLES) * DT
    truth = 5 + 4 * np.sin(2 * np.pi * t / 3)
    asked = problem(drive, truth, np.random.default_rng(1))
    [found] = missing_forces(asked, {}, NOISE)
    inner = slice(50, -50)  # the ends are known from one side only
    error = found.force[inner] - np.interp(found.t[inner], t, truth)
    assert np.sqrt(np.mean(error**2)) < 0.3  # N, of 5.8 N rms
    assert np.mean(np.abs(error) < 3 * found.std[inner]) > 0.95
    assert_allclose(found.velocity[inner], np.gradient(found.displacement, found.t)[inner], atol=2e-3)


def test_pushes_recover_the_missing_force_without_any_state(drive: ForeignBuilder) -> None:
    t = np.arange(SAMPLES) * DT
    truth = 5 + 4 * np.sin(2 * np.pi * t / 6)
    asked = problem(drive, truth, np.random.default_rng(6))
    [base] = asked.simulate({})
    n = int(asked.record.runs[0].fit.sum())
    force, std = pushed(asked, {}, CARRIAGE, (asked.record.runs[0].y - base)[:n], NOISE)
    inner = slice(50, -50)
    error = (force - truth[:n])[inner]
    assert np.sqrt(np.mean(error**2)) < 0.3  # N; what a line through 24 points leaves of a sine
    assert np.all(std > 0)


def test_samples_before_the_split_do_not_count_as_a_missing_force(drive: ForeignBuilder) -> None:
    """An FMU whose states nobody can set starts otherwise than the machine that was moving before."""
    t = np.arange(SAMPLES) * DT
    truth = 5 + 4 * np.sin(2 * np.pi * t / 6)
    asked = problem(drive, truth, np.random.default_rng(6))
    [base] = asked.simulate({})
    run = asked.record.runs[0]
    n, first = int(run.fit.sum()), int(1.5 / DT)
    residual = (run.y - base)[:n]
    residual[:first] += [0.05, 1.0] * np.exp(-t[:first, None] / 0.3)
    error = [pushed(asked, {}, CARRIAGE, residual, NOISE, k)[0] - truth[:n] for k in (first, 0)]
    kept, spoiled = (np.sqrt(np.mean(e[first + 50 : -50] ** 2)) for e in error)
    assert kept < 0.3
    assert spoiled > 2 * kept


def test_calibration_finds_the_mass_within_its_standard_error(drive: ForeignBuilder) -> None:
    asked = problem(drive, np.zeros(SAMPLES), np.random.default_rng(2))
    found = fit(asked, [Unknown("M", 90.0, 80.0, 110.0, 3.0)], Weighting.white(NOISE))
    assert abs(found.theta["M"] - 95.0) < 4 * found.std["M"]
    assert found.std["M"] < 0.1
    assert_allclose(np.mean(found.residual**2), 1.0, atol=0.1)


def test_a_fit_stays_within_bounds_and_says_so_by_its_value(drive: ForeignBuilder) -> None:
    asked = problem(drive, np.zeros(SAMPLES), np.random.default_rng(3))
    found = fit(asked, [Unknown("M", 85.0, 80.0, 90.0, 1.0)], Weighting.white(NOISE))
    assert 89.9 < found.theta["M"] <= 90.0


def test_a_builder_makes_an_fmu_once_and_offers_every_effect(drive: ForeignBuilder) -> None:
    first = drive((("constant_force", "carriage"),))
    stamp = first.stat().st_mtime_ns
    assert drive((("constant_force", "carriage"),)).stat().st_mtime_ns == stamp
    assert ForeignBuilder(drive.fmu, (), drive.folder)(()) == drive.fmu
    assert ("coulomb_friction", "carriage") in drive.offers


def test_a_final_fmu_starts_with_what_was_found(drive: ForeignBuilder, tmp_path: Path) -> None:
    from fmus.host.archive import describe

    starts = {"M": 97.0, "constant_force_carriage_F_0": -3.0}
    made = drive.final((("constant_force", "carriage"),), starts, tmp_path)
    known = describe(made).variables
    assert {name: known[name].start for name in starts} == starts


@given(st.floats(-0.9, 0.95), st.integers(0, 99))
@settings(max_examples=15)
def test_correlation_time_of_an_autoregression(phi: float, seed: int) -> None:
    n = 40000
    e = np.random.default_rng(seed).standard_normal(n)
    x = np.empty(n)
    x[0] = e[0]
    for k in range(1, n):
        x[k] = phi * x[k - 1] + e[k]
    theory = max((1 + phi) / (1 - phi), 1.0)
    assert_allclose(correlation_time(x), theory, rtol=0.35)


@pytest.mark.parametrize("width", [np.inf, 40.0])
def test_what_has_no_influence_is_not_certain(width: float) -> None:
    """Of two unknowns one does nothing: its error is that of its bounds, the other's that of the data."""
    rng = np.random.default_rng(3)
    j = np.column_stack([rng.standard_normal(3000), np.zeros(3000)])
    scale, wide = np.array([0.5, 2.0]), np.array([np.inf, width])
    errors = np.sqrt(np.diag(sandwich(rng.standard_normal(3000), j, scale, wide)))
    assert errors[0] == pytest.approx(1 / np.linalg.norm(j[:, 0]), rel=0.6)
    assert errors[1] == pytest.approx(min(width, 1e3 * scale[1]) / np.sqrt(12), rel=1e-6)


def test_noise_floor_is_what_was_declared_or_what_the_data_show() -> None:
    rng = np.random.default_rng(4)
    t = np.arange(5000) * 0.01
    y = np.column_stack([np.sin(t), np.cos(t)]) + [0.01, 0.02] * rng.standard_normal((5000, 2))
    run = Run(t, np.empty((5000, 0)), y, t < 30, t >= 30, t >= 30)
    found = noise_floor(Record((run,), (), ("a", "b"), np.array([0.5, np.nan])))
    assert found[0] == 0.5
    assert_allclose(found[1], 0.02, rtol=0.05)


@given(st.integers(0, 50))
@settings(max_examples=10)
def test_standard_errors_cover_the_truth_also_in_coloured_noise(seed: int) -> None:
    rng, n, tau = np.random.default_rng(seed), 3000, 20
    estimates, errors = [], []
    for _ in range(60):
        noise = np.convolve(rng.standard_normal(n + tau), np.ones(tau) / np.sqrt(tau), "valid")[:n]
        column = np.sin(np.arange(n) / 300)[:, None]
        estimates.append(float(column[:, 0] @ noise / np.sum(column**2)))
        errors.append(float(np.sqrt(sandwich(noise, column, np.ones(1), np.full(1, np.inf))[0, 0])))
    assert 0.5 < np.median(errors) / np.std(estimates) < 1.6


@given(st.floats(1.0, 12.0), st.floats(0.5, 3.0), st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_the_line_of_a_force_locked_to_an_angle_is_found(order: float, size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 40, 4000)
    v = 3 + np.sin(t / 5)
    q = np.concatenate([[0], np.cumsum((v[1:] + v[:-1]) / 2 * np.diff(t))])
    force = size * np.sin(order * q + 0.4) + 2.0 + 0.5 * v + 0.3 * size * rng.standard_normal(len(t))
    found = orders(q, v, force)
    assert min(abs(o - order) for o in found) < np.pi / np.ptp(q)


def test_no_line_is_looked_for_where_nothing_turns() -> None:
    t = np.linspace(0, 1, 100)
    assert orders(np.zeros_like(t), np.zeros_like(t), np.sin(t)) == []


@given(st.floats(-1, 1), st.floats(-0.5, 0.5), st.floats(0, 0.2), st.floats(-0.1, 0.1))
def test_a_healthy_sensor_changes_nothing_and_faults_do_what_they_say(
    bias: float, gain: float, delay: float, drift: float
) -> None:
    t = np.linspace(0, 10, 1001)
    y = np.column_stack([3 * t, np.ones_like(t)])
    names = [f"sensor_{name}_a" for name in ("bias", "gain", "delay", "drift")]
    assert [fault.name_at("a") for fault in FAULTS.values()] == [*names, "sensor_rectification_a"]
    assert np.array_equal(faulty(y, t, ("a", "b"), dict.fromkeys(names, 0.0)), y)
    shown = faulty(y, t, ("a", "b"), dict(zip(names, (bias, gain, delay, drift), strict=True)))
    late = 3 * np.maximum(t - delay, 0)
    assert_allclose(shown[:, 0], (1 + gain) * late + bias + drift * t, atol=1e-12)
    assert np.array_equal(shown[:, 1], y[:, 1])


@given(st.floats(1e-3, 10), st.floats(1e-3, 10), st.floats(1e-4, 1e-3))
def test_gap_closed_is_one_at_the_noise_and_zero_without_gain(a: float, b: float, noise: float) -> None:
    before = np.array([a + noise, b + noise])
    assert_allclose(gap_closed(before, np.array([noise, noise]), np.array([noise, noise])), 1.0)
    assert_allclose(gap_closed(before, before, np.array([noise, noise])), 0.0)


def test_screening_projects_out_what_calibration_can_explain() -> None:
    from estimator.closeloop.hypotheses.candidate import Candidate

    rng = np.random.default_rng(5)
    shared, own = rng.standard_normal((2, 400))
    u = Unknown("p", 1.0, -np.inf, np.inf, 1.0)
    base = fit_with((u,), np.ones(1), np.eye(1), 3 * own + 0.01 * rng.standard_normal(400), shared[:, None])
    alike, other = (
        Candidate("constant_force", place, (Unknown(place, 0.0, -np.inf, np.inf, 1.0),)) for place in "ab"
    )
    ranked = screen(base, [((alike,), shared[:, None]), ((other,), own[:, None] + shared[:, None])])
    assert ranked[0].candidates == (other,)
    assert_allclose(ranked[0].start["b"], -3.0, rtol=0.01)
    assert_allclose(ranked[1].gain, 0.0, atol=1e-6)


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0])
def test_a_short_delay_is_followed_at_any_sampling_rate(drive: ForeignBuilder, rate: float) -> None:
    made = around(drive.outside(), [("input_delay", "F")])
    t = np.arange(500) / rate
    given = np.zeros((len(t), len(made.given)))
    given[:, made.given.index("F")] = np.sin(t)
    course = Course(t, np.zeros((len(t), 2)), given, np.zeros(len(t)))
    named = {p.name: p.start for p in made.parameters}
    [delay] = [name for name in named if name.endswith("_T")]
    on = {name: 1.0 for name in named if name.endswith("_share")}
    moved = shifts(made, course, {**named, **on, delay: 0.03})["F"]
    settled = t > 1
    assert_allclose(moved[settled], (np.sin(t - 0.03) - np.sin(t))[settled], atol=2e-3)


@pytest.mark.parametrize("rate", [100.0, 250.0, 1000.0])
def test_a_mode_far_above_the_motion_is_a_mass_at_any_sampling_rate(
    drive: ForeignBuilder, rate: float
) -> None:
    """Also where it is so fast and so damped that steps of a sample would diverge."""
    made = around(drive.outside(), [("flexible_mode", "carriage")])
    t = np.arange(1500) / rate
    course = Course(t, np.column_stack([-np.cos(t), np.sin(t)]), np.zeros((len(t), len(made.given))), 0 * t)
    values = {"m": 3.0, "f": 90.0, "D": 1.99}
    named = {p.name: p.start for p in made.parameters}
    named |= {name: values[name.rsplit("_", 1)[1]] for name in named if name.rsplit("_", 1)[1] in values}
    moved = shifts(made, course, named)["F_ext"]
    assert_allclose(moved[100:], -3.0 * np.cos(t)[100:], atol=0.05)
