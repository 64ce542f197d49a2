"""Critical values and limit cycles against systems whose cycles are known, and the command."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

from fmus.errors import BadInput
from fmus.host.archive import Archive
from scenarios.bifurcation.finding import Question, answered
from scenarios.bifurcation.flow import FmuFlow, check_restarts
from scenarios.cli.app import run_safely
from tests.helpers.flows import Known, Subcritical, folded, kinked, turning, van_der_pol

FMU = Path("known.fmu")


def found(flow, low, high, step=0.1, **more):
    """The answer for a known flow."""
    names = tuple(f"x{i}" for i in range(len(flow.nominal)))
    question = Question(FMU, "p", low, high, "x", states=names, step=step, **more)
    return answered(question, flow, np.zeros(len(names)), ("1", "m"), lambda _: None)


def each(limb, name):
    """A number of every cycle of a branch."""
    return np.array([getattr(cycle, name) for cycle in limb.branch.cycles])


@pytest.fixture(scope="module")
def turned():
    return found(Known(folded, 2, size=10.0), -3.0, 0.1)


def test_a_subcritical_branch_is_that_of_its_normal_form():
    """The flow is exact: a^2 = -p, period 2 pi/(2 + a^2/2), multiplier exp(2 T a^2), unstable everywhere."""
    answer = found(Subcritical(), -1.0, 0.5, step=0.05)
    [limb] = answer.limbs
    a, period = each(limb, "amplitude"), each(limb, "period")
    assert_allclose(each(limb, "parameter"), -(a**2), rtol=1e-4)  # the extremes are read by a parabola
    assert_allclose(period, 2 * np.pi / (2 - each(limb, "parameter") / 2), rtol=1e-8)
    assert_allclose([c.multipliers[0].real for c in limb.branch.cycles], np.exp(2 * period * a**2), rtol=1e-3)
    assert each(limb, "unstable").tolist() == [1] * len(a)
    assert each(limb, "error").max() < 1e-2  # beside multipliers of up to some hundreds
    [inside] = limb.releases  # outside, it is at infinity within a period
    assert inside.leaves
    assert (limb.folds, limb.changes, limb.branch.end) == ((), (), "it leaves the range at -1")
    [crossing] = answer.crossings
    assert (crossing.parameter, crossing.frequency) == pytest.approx((0.0, 1 / np.pi), abs=1e-7)
    assert (crossing.begins, limb.kinked) == (True, False)
    assert answer.linear == (crossing.parameter, crossing.error)
    assert answer.nonlinear is None  # nothing is stable but rest


def test_a_branch_that_folds_has_an_unstable_and_a_stable_part(turned):
    """p = -2 a^2 + a^4, which turns at a = 1."""
    [limb] = turned.limbs
    a = each(limb, "amplitude")
    assert (a.min() < 0.15, a.max() > 1.3) == (True, True)
    assert_allclose(each(limb, "parameter"), -2 * a**2 + a**4, atol=8e-3)  # Runge-Kutta steps of 0.1
    clear = np.abs(a - 1) > 0.02
    assert each(limb, "unstable")[clear].tolist() == (a[clear] < 1).astype(int).tolist()


def test_a_fold_is_sharp_and_is_the_nonlinear_critical_value(turned):
    [fold] = turned.limbs[0].folds
    assert fold.parameter == pytest.approx(-1.0, abs=3e-4)  # Runge-Kutta steps of 0.1
    assert abs(fold.parameter + 1) < 2 * fold.error + 1e-9  # half the step has a sixteenth of the error
    assert fold.cycle.amplitude == pytest.approx(1.0, abs=5e-3)
    assert turned.nonlinear == (fold.parameter, fold.error)


def with_a_growing_state(x, p):
    """The same with x3' = 0.05 x3, so that no limit cycle is stable."""
    return np.column_stack([folded(x[:, :2], p), 0.05 * x[:, 2]])


def test_a_fold_between_unstable_parts_is_no_critical_value():
    answer = found(Known(with_a_growing_state, 3, size=10.0), -3.0, 0.1)
    cycles = [c for limb in answer.limbs for c in limb.branch.cycles]
    assert min(c.unstable for c in cycles) == 1
    assert any(limb.folds for limb in answer.limbs)
    assert answer.nonlinear is None


def test_stable_motions_that_leave_the_range_at_its_beginning_have_no_least_value():
    """A van der Pol oscillator over -p: its motions are stable from 0 downwards."""
    answer = found(Known(lambda x, p: van_der_pol(x, -p), 2, size=10.0), -0.4, 0.3)
    assert answer.stable_throughout
    assert answer.nonlinear is None


def test_motions_from_inside_decay_and_from_outside_grow(turned):
    inside, outside = turned.limbs[0].releases
    assert (inside.share < 1, outside.share > 1) == (True, True)
    assert inside.amplitudes[-1] < 0.1
    assert outside.amplitudes[-1] > 1.5
    assert inside.leaves
    assert outside.leaves


def test_van_der_pol_has_its_known_period_and_amplitude():
    """mu = 1: period 6.66328686, amplitude 2.00861986."""
    [limb] = found(Known(van_der_pol, 2, size=10.0), -2.0, 1.02).limbs
    p = each(limb, "parameter")
    assert not each(limb, "unstable").any()
    assert (limb.folds, limb.releases) == ((), ())
    at_one = [float(CubicSpline(p, each(limb, name))(1.0)) for name in ("period", "amplitude")]
    assert_allclose(at_one, [6.66328686, 2.00861986], rtol=3e-4)
    assert_allclose(each(limb, "amplitude")[p < 0.05], 2 * np.sqrt(p[p < 0.05]), rtol=0.02)


def test_rest_with_a_kink_counts_the_smallest_cycle():
    """The rates see the damping of one state alone; that of a small motion is its mean over a turn."""
    answer = found(Known(kinked, 2, size=5.0), -0.1, 0.4, largest=0.1)
    assert answer.limbs[0].kinked
    assert answer.linear[0] == pytest.approx(0.2 * 2 / np.pi, abs=4e-3)
    assert any("kink" in note for note in answer.notes())


@pytest.mark.parametrize("high", [0.5, 1.0])
def test_a_static_loss_of_rest_has_no_cycles(high):
    """The second range has the loss at one of the values that are tried."""
    answer = found(Known(lambda x, p: p[:, None] * x - x**3, 1), -1.0, high)
    [crossing] = answer.crossings
    assert (crossing.frequency, answer.limbs) == (0.0, ())
    assert crossing.parameter == pytest.approx(0.0, abs=1e-9)


def test_a_state_that_only_adds_up_is_named_in_one_sentence():
    with pytest.raises(BadInput, match="distance travelled"):
        found(Known(lambda x, p: np.stack([-x[:, 0], x[:, 0]], axis=1), 2), 0.0, 1.0)


def test_no_position_of_rest_is_told():
    with pytest.raises(BadInput, match="no position of rest"):
        found(Known(lambda x, p: 1 + p[:, None] + x**2, 1), 0.0, 1.0)


def test_a_flow_that_depends_on_more_is_refused():
    class Clocked(Known):
        def path(self, x, p, duration, steps):
            states, output = super().path(x, p, duration, steps)
            return states * np.linspace(1, 1.1, steps + 1)[:, None], output

    with pytest.raises(BadInput, match="depends on time"):
        check_restarts(Clocked(folded, 2), np.zeros(2), 0.0, 0.1)


def test_both_of_two_motions_that_become_unstable_are_found():
    def two(x, p):
        parts = ((x[:, :2], p, 2.0), (x[:, 2:], p - 0.05, 3.0))
        return np.hstack([turning(s, q - np.einsum("ij,ij->i", s, s), w) for s, q, w in parts])

    answer = found(Known(two, 4, size=10.0), -0.5, 0.5, largest=0.12)
    assert_allclose([c.parameter for c in answer.crossings], [0.0, 0.05], atol=1e-4)
    assert [round(2 * np.pi * c.frequency) for c in answer.crossings] == [2, 3]
    first, second = answer.limbs
    assert (first.branch.cycles[-1].unstable, second.branch.cycles[0].unstable) == (0, 2)


def test_the_flow_of_an_fmu_is_that_of_its_equations(vdp):
    with Archive(vdp) as archive:
        flow = FmuFlow(archive, ("x0", "x1"), "x1_dot", "mu", {"u": 0.1})
        x, p = np.array([[2.0, 0.0], [0.3, -0.4]]), np.array([1.0, 0.5])
        known = Known(
            lambda x, p: np.stack([x[:, 1], p * (1 - x[:, 0] ** 2) * x[:, 1] - x[:, 0] + 0.1], axis=1), 2
        )
        assert_allclose(flow.ends(x, p, 0.5, 50), known.ends(x, p, 0.5, 50), rtol=1e-7)
        assert flow.nominal.tolist() == [2.0, 3.0]
        check_restarts(flow, x[0], 1.0, 0.01)
        half = FmuFlow(archive, ("x0",), "x0", "mu", {})
        with pytest.raises(BadInput, match="not set"):
            check_restarts(half, x[0, :1], 1.0, 0.01)
        flow.close()
        half.close()


def asked(vdp, out, *more):
    """The command on the forced oscillator, whose rest x0 = u loses its cycle at u = 1."""
    words = ["bifurcation", vdp, "--parameter", "u", "--from", "0.9", "--to", "1.2", "--output", "x0"]
    return run_safely(list(map(str, [*words, "--set", "mu=0.3", "--step", "0.3", "--out", out, *more])))


def test_the_command_writes_page_and_tables(vdp, tmp_path, capsys):
    """x'' - mu (1 - x^2) x' + x = u: rest is stable for u > 1; the cycles have about a = 2 sqrt(1 - u^2)."""
    assert asked(vdp, tmp_path) == 0
    assert "linear critical" in capsys.readouterr().out
    result = json.loads((tmp_path / "result.json").read_text())
    [crossing] = result["crossings"]
    assert (crossing["value"], crossing["frequency"]) == pytest.approx((1.0, 1 / (2 * np.pi)), abs=1e-4)
    assert (crossing["begins"], crossing["kind"]) == (False, "Hopf")
    [branch] = result["branches"]
    for cycle in branch["cycles"]:
        about = 2 * np.sqrt(max(0.0, 1 - cycle["value"] ** 2))
        assert cycle["amplitude"] == pytest.approx(about, abs=0.05)
        assert cycle["stable"]
    for name in ("bifurcation.html", "cycles.csv", "rest.csv", "diagram.png", "course.svg"):
        assert (tmp_path / name).is_file(), name
    assert "Rest is" in (tmp_path / "bifurcation.html").read_text()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--parameter", "muu"), "did you mean 'mu'"),
        (("--output", "z"), "no variable of the FMU"),
        (("--set", "u=1"), "is what --parameter varies"),
        (("--set", "mu"), "NAME=VALUE"),
        (("--to", "0.8"), "range that rises"),
        (("--step", "0"), "above 0"),
        (("--state", "x0"), "name all of its states"),
    ],
)
def test_wrong_questions_get_one_sentence(vdp, tmp_path, capsys, more, words):
    assert asked(vdp, tmp_path, *more) == 2
    assert words in capsys.readouterr().err.replace("\n", " ")
    assert not any(tmp_path.iterdir())
