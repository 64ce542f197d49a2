"""Critical speeds and limit cycles of the bogie without yaw dampers, against eigenvalues and simulations."""

from dataclasses import replace

import numpy as np
import pytest

from fmus.bogie.model import Bogie
from fmus.host.fmu import Fmu
from scenarios.bifurcation.finding import Question, bifurcation
from tests.helpers.evaluated import Evaluated
from tests.helpers.native import native
from tests.truth import bogie_linear

pytestmark = pytest.mark.slow

LINEAR, OFF = 0.0, {"b_d": 0.0}  # code of the linear creep law; yaw dampers off
LONG, STEP = 40.0, 1e-3  # s, of simulations that tell a motion that goes on from one that dies


@pytest.fixture(scope="module")
def fmu():
    return native("bogie")


@pytest.fixture(scope="module")
def polach(fmu):
    """Rest and limit cycles on dry rail."""
    return bifurcation(Question(fmu, "V", 65.0, 82.0, "y_1", OFF))


def growing(rates):
    return rates.real.max()


def test_the_linear_critical_speed_is_that_of_the_eigenvalues(fmu):
    """Within 0.1 %, where 1 % is asked for: against the equations' Jacobian, and a state matrix by hand."""
    answer = bifurcation(Question(fmu, "V", 78.0, 82.0, "y_1", {**OFF, "creep_law": LINEAR}, largest=2e-5))
    value, error = answer.linear
    by_hand = bogie_linear.critical_speed(replace(bogie_linear.Parameters(), **OFF))
    assert value == pytest.approx(by_hand, rel=1e-3)
    assert error < 1e-3
    bogie, said = Evaluated(Bogie()), {**OFF, "creep_law": LINEAR}

    def growth(V):
        at = {**said, "V": V}
        return growing(np.linalg.eigvals(bogie.state_matrix(**at, **bogie.equilibrium(**at))))

    assert growth(0.999 * value) < 0 < growth(1.001 * value)
    assert not answer.limbs[0].kinked


def amplitudes(fmu, runs, output="y_1", seconds=LONG):
    """Half the output's range, m, in the first and the last two seconds of runs of (speed, states)."""
    t = np.arange(0.0, seconds + STEP / 2, STEP)
    with Fmu(fmu) as bogie:
        starts = [{**OFF, "V": V, **states} for V, states in runs]
        found = bogie.simulate_rows(t, {}, [output], starts)[:, :, 0]
    two = round(2 / STEP)
    return [(np.ptp(y[:two]) / 2, np.ptp(y[-two:]) / 2) for y in found]


def states_of(answer, cycle, share=1.0):
    return dict(zip(answer.states, (share * cycle.x).tolist(), strict=True))


def test_hunting_goes_on_above_the_last_fold_and_dies_below_it(polach, fmu):
    """From the states of the fold, 0.4 m/s slower and faster: from both sides the fold lies in between."""
    speed, error = polach.nonlinear
    fold = next(f for f in polach.limbs[0].folds if f.parameter == speed)
    assert error < 0.05
    at = states_of(polach, fold.cycle)
    (_, slower), (_, faster) = amplitudes(fmu, [(speed - 0.4, at), (speed + 0.4, at)])
    assert slower < 0.1e-3
    assert faster > 5e-3


def small_hunting(answer):
    """Speeds and amplitudes of the stable limit cycles that are no larger than a millimetre or so."""
    small = [c for c in answer.limbs[0].branch.cycles if not c.unstable and c.amplitude < 1.2e-3]
    return [c.parameter for c in small], [c.amplitude for c in small]


def test_points_of_the_unstable_branch_part_decay_from_growth(polach, fmu):
    """Released a little inside, the motion falls to rest or small hunting; outside it grows to the flange."""
    unstable = [c for c in polach.limbs[0].branch.cycles if c.unstable == 1 and c.multipliers[0].real > 1.05]
    assert len(unstable) > 10
    some = unstable[:: max(1, len(unstable) // 5)]
    for cycle in some:
        runs = [(cycle.parameter, states_of(polach, cycle, share)) for share in (0.95, 1.05)]
        (_, inside), (_, outside) = amplitudes(fmu, runs)
        below = float(np.interp(cycle.parameter, *small_hunting(polach), left=0.0))
        assert inside < (below + cycle.amplitude) / 2, cycle.parameter
        assert outside > 1.03 * cycle.amplitude, cycle.parameter
        assert outside > 5e-3, cycle.parameter


def test_small_stable_hunting_is_where_simulations_settle(polach, fmu):
    """At 76 to 78 m/s, from a tenth of a millimetre and from above."""
    speeds = [76.0, 77.0, 78.0]
    known = np.interp(speeds, *small_hunting(polach))
    for start in (0.1e-3, 1.3e-3):
        found = [last for _, last in amplitudes(fmu, [(V, {"y_1": start}) for V in speeds], seconds=60.0)]
        assert found == pytest.approx(known.tolist(), rel=0.02)


def test_simulations_beside_the_unstable_cycle_are_part_of_the_answer(polach):
    assert len(polach.limbs[0].releases) >= 2
    assert all(release.leaves for release in polach.limbs[0].releases)
    assert polach.limbs[0].kinked  # the law mixes two coefficients by the direction of the creepage
    assert 70.5 < polach.nonlinear[0] < 72.0
    assert 74.5 < polach.linear[0] < 76.0
