"""What truth models may have beyond their declared ones: laws, passing inputs, changes, links, kinks."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from tests.truth import (
    rig_effects,
    rig_motion,
    vehicle_effects,
    vehicle_motion,
    wheelset_effects,
)
from tests.truth.laws import (
    LAWS,
    FlexibleMode,
    FrictionBursts,
    Hysteresis,
    ImpactTrain,
    Precession,
)
from tests.truth.more import (
    NO_MORE,
    Change,
    Kinks,
    More,
    changed,
    made,
)
from tests.truth.passing import Passing, arrived, arrived_with_rate
from tests.truth.rig import Inputs, torque_profile
from tests.truth.vehicle import (
    Vehicle,
    passed,
    run_over,
    spectrum_rails,
    with_kinks,
)
from tests.truth.wheelset import passed as wheelset_passed
from tests.truth.wheelset_effects import CONDITIONS, FRICTION
from tests.truth.wheelset_motion import Wheelset
from tests.truth.wheelset_motion import simulate as simulate_wheelset
from tests.truth.wheelset_track import random_alignment

SIZES = {  # one that shows, of every law
    "constant_force": {"F_0": 300.0},
    "step_force": {"F_0": 300.0, "t0": 0.5},
    "coulomb_friction": {"F_c": 300.0},
    "stribeck_friction": {"F_c": 100.0, "F_b": 300.0, "v_b": 0.02},
    "viscous_damping": {"c": 1e4},
    "quadratic_damping": {"c": 1e6},
    "cubic_stiffness": {"k_3": 1e12},
    "bump_stop": {"k": 1e6, "gap": 1e-5},
    "free_play": {"k": 1e5, "gap": 1e-4},
    "hysteresis": {"F_h": 300.0, "q_y": 1e-4},
    "periodic_force": {"F_sin": 300.0, "F_cos": 100.0, "order": 900.0},
    "harmonic_excitation": {"F_sin": 300.0, "F_cos": 100.0, "f": 3.0},
    "flexible_mode": {"m": 300.0, "f": 6.0, "D": 0.05},
    "stiffness_change": {"k": -1e5},
    "damping_change": {"c": 1e4},
    "impact_train": {"F": 3e3, "period": 0.3, "width": 0.02},
    "crack": {"F": 300.0, "width": 0.1},
    "precession": {"F": 300.0, "order": 1.0, "rate": 0.1, "swing": 1.0, "swing_period": 20.0},
    "friction_bursts": {"F_c": 300.0, "times": (0.3, 0.9)},
    "speed_stiffness": {"k_v": 1e9},
    "root_damper": {"bump": 1e3, "rebound": 2e3},
}
DRAG = ("coulomb_friction", "stribeck_friction", "viscous_damping", "quadratic_damping", "root_damper")
TURNING = ("crack", "precession", "periodic_force")  # by an angle: see the rig
SPRINGS = ("cubic_stiffness", "bump_stop")
numbers = st.floats(-0.1, 0.1)


def test_every_law_has_a_size_here():
    assert SIZES.keys() == LAWS.keys()


@given(numbers, numbers)
def test_drag_takes_energy_and_springs_pull_back(q, v):
    for kind in DRAG:
        assert LAWS[kind](**SIZES[kind]).force(0.0, q, v, ()) * v <= 0, kind
    for kind in SPRINGS:
        assert LAWS[kind](**SIZES[kind]).force(0.0, q, v, ()) * q <= 0, kind


@settings(max_examples=20)
@given(st.floats(0.5, 1.0), st.floats(1.0, 4.0), st.floats(1e-3, 1e-2))
def test_hysteresis_is_passive_and_slips_at_its_force(beta, n, size):
    """Over a motion that comes back, the law takes work, and its force stays within F_h."""
    law = Hysteresis(F_h=200.0, q_y=1e-3, beta=beta, n=n)
    t = np.linspace(0, 4 * np.pi, 2001)
    q, v = size * np.sin(t), size * np.cos(t)
    z, forces = [0.0], []
    for i in range(len(t)):
        forces.append(law.force(t[i], q[i], v[i], z))
        z = [z[0] + (t[1] - t[0]) * law.rates(t[i], q[i], v[i], z)[0]]
    assert max(map(abs, forces)) <= 200.0 * 1.01
    assert np.trapezoid(np.array(forces)[1000:] * v[1000:], t[1000:]) < 0


def test_a_mode_keeps_momentum_and_gives_back_no_energy():
    base, law = 50.0, FlexibleMode(m=20.0, f=4.0, D=0.1)

    def rates(t, x):
        q, v, *z = x
        return [v, law.force(t, q, v, z) / base, *law.rates(t, q, v, z)]

    run = solve_ivp(rates, (0, 3), [0.0, 1.0, *law.start(0.0, 0.5)], rtol=1e-9, atol=1e-12)
    q, v, place, speed = run.y
    assert_allclose(base * v + law.m * speed, base * 1.0 + law.m * 0.5, rtol=1e-7)
    omega = 2 * np.pi * law.f
    energy = base * v**2 / 2 + law.m * (speed**2 + omega**2 * (place - q) ** 2) / 2
    assert np.all(np.diff(energy) < 1e-9)
    assert_allclose([v[-1], speed[-1]], (base + law.m * 0.5) / (base + law.m), atol=2e-3)


def test_blows_and_bursts_come_when_they_are_due():
    blows = ImpactTrain(F=5.0, period=1.0, width=0.1)
    assert [blows.force(t, 0, 0, ()) for t in (3.05, 3.2)] == pytest.approx([5.0, 0.0])
    grip = FrictionBursts(F_c=5.0, times=(1.0, 2.0, 4.0))
    assert [grip.force(t, 0.0, 1.0, ()) for t in (0.5, 1.5, 3.0, 4.5)] == pytest.approx(
        [0.0, -5.0, 0.0, -5.0]
    )
    still = Precession(F=1.0, order=2.0, rate=0.0, swing=0.0, swing_period=1.0)
    assert still.force(7.0, 0.3, 0.0, ()) == LAWS["periodic_force"](1.0, 0.0, 2.0).force(0.0, 0.3, 0.0, ())


def test_changes_of_parameters():
    assert [Change(delta=2.0, t0=1.0).at(t) for t in (0.9, 1.0)] == [0.0, 2.0]
    assert [Change(delta=2.0, t0=1.0, t1=3.0).at(t) for t in (1.0, 2.0, 9.0)] == [0.0, 1.0, 2.0]
    assert Change(rate=0.5).at(4.0) == 2.0
    assert Change(warm=1.0, tau=2.0).at(2.0) == pytest.approx(1 - np.exp(-1))
    assert changed(Vehicle(), {"m1": Change(delta=-1e3)}, 0.0) == replace(Vehicle(), m1=31e3)


def test_what_arrives_of_an_input():
    t = np.arange(1001) * 0.01
    ramp = 2.0 * t
    assert_allclose(arrived(t, ramp, Passing(lag=0.5)), ramp - (1 - np.exp(-t / 0.5)), atol=1e-12)
    assert_allclose(arrived(t, ramp, Passing(delay=0.5))[50:], ramp[50:] - 1.0)
    assert_allclose(arrived(t, ramp, Passing(gain=-0.1, limit=9.0)), np.minimum(0.9 * ramp, 9.0))
    assert_array_equal(arrived(t, ramp - 5, Passing(band=6.0))[:500], 0.0)
    assert np.abs(np.diff(arrived(t, np.sin(9 * t), Passing(slew=3.0)))).max() <= 0.03 + 1e-12
    assert_array_equal(arrived(t, ramp, Passing()), ramp)


@pytest.mark.parametrize(
    "how", [Passing(gain=0.1), Passing(lag=0.05), Passing(delay=0.033), Passing(limit=0.7)]
)
def test_the_rate_that_arrives_is_that_of_the_value(how):
    t = np.arange(4001) * 0.0025
    u, u_dot = arrived_with_rate(t, np.sin(3 * t), 3 * np.cos(3 * t), how)
    assert_allclose(u, arrived(t, np.sin(3 * t), how), atol=3e-5)
    steady = np.abs(np.abs(u) - how.limit) > 0.01
    steady[:20] = steady[-1] = False
    assert_allclose(np.gradient(u, t)[steady], u_dot[steady], atol=2e-3)


def test_a_dead_band_needs_an_input_without_a_rate():
    with pytest.raises(ValueError, match="dead band"):
        arrived_with_rate(np.arange(3.0), np.zeros(3), np.zeros(3), Passing(band=1.0))


def test_kinks_slope_as_they_dip():
    dips = Kinks((5.0, 12.0), depth=1e-3, reach=0.4)
    s = np.array([3.9, 5.3, 9.0, 12.6])
    rise = (dips.heights(s + 1e-6)[0] - dips.heights(s - 1e-6)[0]) / 2e-6
    assert_allclose(dips.heights(s)[1], rise, atol=1e-8)
    assert dips.heights(np.array([5.0]))[0][0] == pytest.approx(-1e-3, rel=1e-6)


def test_two_together_are_both_and_unknown_kinds_are_refused():
    both = made("viscous_damping", "wheel", c=1.0) + made("parameter_offset", "J_w", delta=1.0)
    assert both == More(laws=(("wheel", LAWS["viscous_damping"](1.0)),), changes={"J_w": Change(delta=1.0)})
    with pytest.raises(ValueError, match="'rust' is not one of constant_force"):
        made("rust", "wheel")


# the rig


def rig_run(more=NO_MORE, parameters=rig_motion.DECLARED):
    t = np.arange(1201) / 100
    inputs = Inputs(t, torque_profile(t, np.random.default_rng(5)), np.interp(t, [2, 10], [7.5, 12.0]))
    return np.array(rig_motion.simulate(inputs, parameters, rig_effects.Effects(more=more)))


@pytest.fixture(scope="module")
def sound_rig():
    return rig_run()


@pytest.mark.parametrize(
    "more",
    [
        made("viscous_damping", "roller", c=2.0),
        made("flexible_mode", "wheel", m=3.0, f=2.0, D=0.05),
        made("crack", "roller", F=200.0, width=0.1),
        made("precession", "wheel", F=40.0, order=1.0, rate=0.2, swing=1.0, swing_period=9.0),
        made("actuator_gain", "f_sync", gain=0.01),
        made("input_delay", "T_P", T=0.1),
        made("dead_band", "T_P", band=50.0),
        made("slew_rate", "T_P", slew=300.0),
        made("parameter_offset", "J_r", delta=5.0),
        made("parameter_step", "R_2", delta=0.003, t0=4.0),
        made("warming", "R_2", warm=0.004, tau=3.0),
    ],
    ids=repr,
)
def test_the_rig_shows_each(more, sound_rig):
    assert np.abs(rig_run(more) - sound_rig).max() > 0.004  # twice the usual noise


def test_the_rigs_laws_are_those_it_had_before(sound_rig):
    old = rig_effects.single("quadratic_damping", "roller", quadratic=0.3)
    t = np.arange(1201) / 100
    inputs = Inputs(t, torque_profile(t, np.random.default_rng(5)), np.interp(t, [2, 10], [7.5, 12.0]))
    assert_allclose(
        rig_run(made("quadratic_damping", "roller", c=0.3)),
        rig_motion.simulate(inputs, effects=old),
        atol=1e-6,
    )


def test_a_force_in_a_rolling_contact_hardly_shows(sound_rig):
    """The creep takes it up: less than the noise, and a tenth of what the same torque on the wheel does."""
    inside, outside = (
        np.sqrt(np.mean((rig_run(made("constant_force", place, F_0=F)) - sound_rig) ** 2))
        for place, F in (("contact", 100.0), ("wheel", 100.0 * rig_motion.DECLARED.r_w))
    )
    assert inside < 0.002
    assert inside < 0.1 * outside


def test_a_changed_inertia_is_a_rig_with_it():
    heavier = replace(rig_motion.DECLARED, J_w=20.0)
    assert_allclose(
        rig_run(made("parameter_offset", "J_w", delta=20.0 - 17.86)), rig_run(parameters=heavier), atol=1e-6
    )


def test_a_stiff_mode_is_more_inertia():
    heavier = replace(rig_motion.DECLARED, J_w=17.86 + 2.0)
    stiff = rig_run(made("flexible_mode", "wheel", m=2.0, f=30.0, D=0.3))
    assert np.abs(stiff - rig_run(parameters=heavier)).max() < 0.05 * np.abs(stiff - rig_run()).max()


# the vehicle


def vehicle_run(more=NO_MORE, parameters=vehicle_motion.DECLARED, duration=1.0):
    rails = spectrum_rails(np.random.default_rng(6), 60.0)
    fine = np.arange(round(duration / 0.0025) + 1) * 0.0025
    track = run_over(with_kinks(rails, more.kinks), fine, 20.0, 19.0)
    effects = vehicle_effects.Effects(more=more)
    return vehicle_motion.simulate(passed(track, effects), parameters, effects, fine[::2]).q_ddot


@pytest.fixture(scope="module")
def sound_vehicle():
    return vehicle_run()


AT = [(kind, "secondary_rl") for kind in SIZES if kind not in TURNING]
AT += [("harmonic_excitation", "body"), ("flexible_mode", "bogie_rear"), ("viscous_damping", "primary")]


@pytest.mark.parametrize(("kind", "location"), AT)
def test_the_vehicle_shows_every_law(kind, location, sound_vehicle):
    assert np.abs(vehicle_run(made(kind, location, **SIZES[kind])) - sound_vehicle).max() > 1e-4


@pytest.mark.parametrize(
    "more",
    [
        made("cross_coupling", "secondary_fl", source="primary_rr", k=1e5),
        made("rail_kink", "left", where=(6.0, 14.0), depth=1e-3, reach=0.5),
        made("actuator_lag", "u_fl", T=0.03),
        made("load_leaves", "m1", delta=-5e3, t0=0.2, t1=0.8),
    ],
    ids=repr,
)
def test_the_vehicle_shows_what_is_no_law(more, sound_vehicle):
    assert np.abs(vehicle_run(more) - sound_vehicle).max() > 1e-4


def test_a_change_of_a_component_is_a_vehicle_with_it():
    half = vehicle_run(parameters=Vehicle(k1=215e3))
    assert_allclose(vehicle_run(made("stiffness_change", "secondary", k=-215e3)), half, atol=1e-5)
    offset = vehicle_run(made("parameter_offset", "k1", delta=-215e3))
    assert_allclose(offset, half, atol=1e-5)


def test_a_kink_under_one_rail_turns_what_it_lifts():
    """A kink under both rails rolls nothing, under the left one it rolls the bogie to the right."""
    where = {"where": (6.0,), "depth": 1e-3, "reach": 0.5}
    plain = vehicle_run()
    both = vehicle_run(made("rail_kink", "left", **where) + made("rail_kink", "right", **where)) - plain
    left = vehicle_run(made("rail_kink", "left", **where)) - plain
    assert np.abs(both[:, 4]).max() < 1e-3 * np.abs(left[:, 4]).max()
    assert_allclose(both[:, 3], 2 * left[:, 3], atol=1e-3 * np.abs(both[:, 3]).max())


# the wheelset


def wheelset_run(more=NO_MORE, parameters=None, duration=1.0):
    run = random_alignment(np.random.default_rng(6), np.arange(round(duration * 1000) + 1) * 1e-3)
    effects = wheelset_effects.Effects(more=more)
    return simulate_wheelset(wheelset_passed(run, effects), parameters or Wheelset(), effects)


@pytest.fixture(scope="module")
def sound_wheelset():
    return wheelset_run()


PLACES = ("wheelset_lateral", "wheelset_yaw", "primary_lateral", "primary_yaw", "suspended_mass", "contact")
LAWS_THERE = [(kind, "primary_lateral") for kind in SIZES if kind not in TURNING]
LAWS_THERE += [("constant_force", place) for place in PLACES]


@pytest.mark.parametrize(("kind", "location"), LAWS_THERE)
def test_the_wheelset_shows_every_law(kind, location, sound_wheelset):
    found = wheelset_run(made(kind, location, **SIZES[kind]))
    noise = np.array([1e-5, 2e-6, 1e-3, 2e-4])
    assert np.max(np.abs(found - sound_wheelset)[:, :4] / noise) > 0.3


@pytest.mark.parametrize(
    "more",
    [
        made("cross_coupling", "primary_yaw", source="primary_lateral", c=3e4),
        made("rail_kink", "alignment", where=(15.0, 30.0), depth=1e-3, reach=0.5),
        made("actuator_gain", "V", gain=0.02),
        made("input_delay", "y_irr", T=0.03),
        made("parameter_offset", "m_m", delta=600.0),
    ],
    ids=repr,
)
def test_the_wheelset_shows_what_is_no_law(more, sound_wheelset):
    assert np.abs(wheelset_run(more) - sound_wheelset)[:, 0].max() > 1e-5


def test_wet_rails_are_a_wheelset_on_wet_rails():
    dry, wet = CONDITIONS["dry"], CONDITIONS["wet"]
    more = NO_MORE
    for name, before, after in zip(FRICTION, dry, wet, strict=True):
        more += made("parameter_step", name, delta=after - before, t0=0.0)
    onto = Wheelset(**dict(zip(FRICTION, wet, strict=True)))
    assert_allclose(wheelset_run(more, duration=0.5), wheelset_run(parameters=onto, duration=0.5), atol=1e-12)
