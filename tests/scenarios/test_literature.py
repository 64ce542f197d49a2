"""Rows of the literature: laws on short runs of the truth models here, whole rows where marked slow."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.filters.estimator import Diverged
from fmus.errors import BadInput
from scenarios.literature import ROWS, run_row
from scenarios.literature import friction_ukf as friction
from scenarios.literature import primary_stiffness as primary
from scenarios.literature import profile_rls as profile
from scenarios.literature import rolling_radius as radius
from scenarios.literature import secondary_stiffness as secondary
from scenarios.literature.case import Case, Record, recorded
from scenarios.literature.following import (
    Followed,
    covered,
    first_below,
    follow,
    rmse,
)
from scenarios.literature.outcome import Finding, Outcome, table
from scenarios.literature.row import Row
from scenarios.literature.twin import twin
from tests.helpers.native import native
from tests.helpers.rows import truth
from tests.truth.wheelset_motion import OTHER, SAME

ANY_MODEL = [pytest.param(m, id=m) for m in ("testrig", "vehicle7dof", "wheelset")]


def case_of(row, name, **changed):
    """A case of a row, shortened."""
    (found,) = (c for c in ROWS[row].cases if c.name == name)
    return replace(found, **changed)


def fmu_of(row):
    return native(ROWS[row].model)


# ---- records


@pytest.fixture
def small():
    return Case("small", "testrig", 0.02, 0.005, 7.5, ("T_P",), {"omega_w": 1e-3}, {"r_w": 0.35})


def test_a_record_is_read_as_it_was_written(tmp_path, small):
    rng = np.random.default_rng(1)
    whole = Record({n: small.times if n == "time" else rng.normal(size=5) for n in small.columns})
    whole.write(tmp_path / "small.csv")
    again = recorded(tmp_path)(small)
    for name in small.columns:
        np.testing.assert_allclose(again.columns[name], whole.columns[name], rtol=1e-8)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,T_P\n0,1\n", "has no column 'omega_w'"),
        ("time,T_P,omega_w\n0,1,2\n0.005,,2\n", "'T_P' has gaps"),
        ("time,T_P,omega_w\n0,1,2\n0.006,1,2\n", "does not rise in steps of 0.005 s"),
        ("time,T_P,omega_w\n0,1,2\n", "does not rise in steps"),
    ],
)
def test_a_record_that_is_none_says_why(tmp_path, small, text, words):
    (tmp_path / "small.csv").write_text(text)
    with pytest.raises(BadInput, match=words):
        recorded(tmp_path)(small)


def test_a_missing_record_is_named(tmp_path, small):
    with pytest.raises(BadInput, match=r"small\.csv"):
        recorded(tmp_path)(small)


def test_a_truth_jumps_when_its_case_says_so(small):
    case = replace(small, later={"r_w": 0.3}, when=0.01)
    assert case.truth("r_w", case.times).tolist() == [0.35, 0.35, 0.3, 0.3, 0.3]


def test_a_truth_goes_through_all_its_jumps_within_the_run(small):
    further = ((0.015, {"r_w": 0.25}), (0.5, {"r_w": 0.2}))
    case = replace(small, later={"r_w": 0.3}, when=0.01, further=further)
    assert case.truth("r_w", case.times).tolist() == [0.35, 0.35, 0.3, 0.25, 0.25]
    assert [when for when, _ in case.jumps] == [0.01, 0.015]


@pytest.mark.parametrize("model", ANY_MODEL)
@pytest.mark.slow
def test_twin_and_truth_measure_what_a_case_asks_for(model):
    dt = 1e-3 if model == "wheelset" else 0.01
    row = {
        "testrig": "rolling_radius",
        "vehicle7dof": "secondary_stiffness",
        "wheelset": "contact_force_ekf",
    }[model]
    case = replace(ROWS[row].cases[-1], duration=11.0 if model == "testrig" else 4.0, when=2.0, dt=dt)
    for record in (twin(native(model))(case), truth(case)):
        assert set(record.columns) == set(case.columns)
        assert all(len(x) == len(case.times) and np.isfinite(x).all() for x in record.columns.values())


# ---- judging


def test_a_missing_estimate_meets_no_target():
    lost = rmse(np.array([1.0, np.nan]), np.ones(2))
    assert lost == np.inf
    assert Finding("c", "w", "1", lost, target=1.0).met is False


def test_a_bound_from_below_is_one():
    assert Finding("c", "w", "1", 11.0, target=10.0, bound=">=").met
    assert not Finding("c", "w", "1", 9.0, target=10.0, bound=">=").met
    assert Finding("c", "w", "1", 9.0).met is None


def test_first_below_counts_from_the_step():
    t = np.arange(5.0)
    assert first_below(t, np.array([0.0, 1.0, 1.0, 0.1, 1.0]), 0.5, since=1.0) == 2.0
    assert first_below(t, np.ones(5), 0.5, since=1.0) == np.inf


def test_the_band_of_normal_errors_covers_in_95_percent_of_the_time():
    rng, t = np.random.default_rng(1), np.arange(20000.0)
    std = rng.uniform(0.5, 2.0, len(t))
    found = Followed(t, {"k": 3.0 + std * rng.standard_normal(len(t))}, {"k": std}, 0.0, 1.0, 1.0)
    assert covered(found, "k", np.full(len(t), 3.0)) == pytest.approx(0.95, abs=0.01)
    missed = replace(found, value={"k": np.where(t < 1000, 100.0, found.value["k"])})
    assert covered(missed, "k", np.full(len(t), 3.0)) < 0.92
    assert covered(missed, "k", np.full(len(t), 3.0), since=1000.0) == pytest.approx(0.95, abs=0.01)
    gone = replace(found, value={"k": np.full(len(t), np.nan)})
    assert covered(gone, "k", np.full(len(t), 3.0)) == 0.0


def test_one_missed_target_fails_the_row():
    good, bad = Finding("c", "w", "m", 1.0, target=2.0), Finding("c", "w", "m", 3.0, target=2.0)
    assert Outcome("r", [good], []).ok
    assert not Outcome("r", [good, bad], []).ok
    assert "**no**" in table([bad])


class Broken:
    """A filter that gives up after three samples."""

    def __init__(self, belief):
        self.now, self.left = belief, 3

    def step(self, u, y):
        self.left -= 1
        if self.left < 0:
            raise Diverged("lost")
        return self.now


class Plain:
    """One quantity, as it is."""

    names = ("x",)

    def values(self, x, std):
        return x, std


def test_a_filter_that_gives_up_is_followed_to_there():
    from estimator.filters.estimator import Estimate

    belief = Estimate(0.0, np.ones(1), np.eye(1))
    found = follow(Broken(belief), Plain(), np.arange(5.0), np.empty((5, 0)), np.empty((5, 1)))
    assert found.reason == "lost"
    assert found.log_likelihood == -np.inf
    assert np.isfinite(found.value["x"]).tolist() == [True] * 3 + [False] * 2


# ---- the command's side


@pytest.mark.parametrize(
    ("name", "cases", "words"),
    [
        ("friction", None, "row 'friction' is not known; did you mean 'friction_ukf'?"),
        ("friction_ukf", ["dri"], "has no case 'dri'; did you mean 'dry'?"),
    ],
)
def test_what_is_not_there_is_named(tmp_path, name, cases, words):
    with pytest.raises(BadInput, match=words.replace("?", r"\?")):
        run_row(name, tmp_path, cases=cases)


@pytest.mark.parametrize("row", ROWS.values(), ids=lambda row: row.name)
def test_every_row_is_whole(row: Row):
    assert row.title
    assert row.source
    assert len({case.name for case in row.cases}) == len(row.cases)
    assert all(case.model == row.model for case in row.cases)
    assert all(name in case.true for case in row.cases for name in case.later)


# ---- the filters, on short runs of the truth


@pytest.mark.slow
def test_friction_is_found_from_known_alignment_and_the_step_within_three_seconds():
    case = case_of("friction_ukf", "wet-very_low", duration=9.0, when=6.0)
    found = friction.task(case, fmu_of("friction_ukf")).known(truth(case))
    before = (found.t > 3.0) & (found.t < case.when)
    assert rmse(found.value["mu0"][before], np.full(before.sum(), 0.2)) < 0.3 * friction.SOURCE_RMSE["wet"]
    assert found.value["mu0"][before].min() > friction.CRITICAL
    assert first_below(found.t, found.value["mu0"], friction.CRITICAL, case.when) < 3.0


@pytest.mark.slow
def test_friction_is_found_from_the_outputs_alone_and_the_alignment_with_it():
    case = case_of("friction_ukf", "low", duration=20.0)
    record = truth(case)
    task = friction.task(case, fmu_of("friction_ukf"))
    found = task.along(record, task.shaped(record))
    assert rmse(found.value["mu0"], case.truth("mu0", record.t)) < 0.5 * friction.SOURCE_RMSE["low"]
    assert friction.alignment_error(found, record) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("condition", ["dry", "wet"])
def test_with_its_form_open_friction_is_found_on_another_contact(condition):
    case = case_of("friction_ukf", condition, duration=40.0)
    record = truth(case, OTHER)
    task = friction.task(case, fmu_of("friction_ukf"))
    right, opened = task.known(record), task.with_form(record)
    true = case.truth("mu0", record.t)
    assert covered(right, "mu0", true, 2.0) < 0.5  # its form is taken for right
    assert covered(opened, "mu0", true, 2.0) > 0.9
    assert rmse(opened.value["mu0"], true) < 0.5 * rmse(right.value["mu0"], true)
    assert opened.nis == pytest.approx(4.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wet", "static"])
def test_another_contact_gives_another_record_of_the_same_track(name):
    row = "friction_ukf" if name == "wet" else "primary_stiffness"
    case = case_of(row, name, duration=1.0)
    same, other = truth(case, SAME), truth(case, OTHER)
    np.testing.assert_array_equal(same.columns["y_irr"], other.columns["y_irr"])
    assert np.abs(same.columns["y"] - other.columns["y"]).max() > 1e-6


@pytest.mark.slow
def test_without_the_alignment_friction_is_biased():
    case = case_of("friction_ukf", "low", duration=10.0)
    record, fmu = truth(case), fmu_of("friction_ukf")
    published = friction.as_published(case, record, fmu)
    known = friction.task(case, fmu).known(record)
    true = case.truth("mu0", record.t)
    assert rmse(published.value["mu0"], true) > 5 * rmse(known.value["mu0"], true)


@pytest.mark.slow
def test_the_primary_spring_is_found_and_its_drop():
    case = case_of("primary_stiffness", "drop", duration=9.0, when=5.0)
    found = primary.task(fmu_of("primary_stiffness")).known(truth(case))
    k = found.value["k_y"]
    assert k[np.searchsorted(found.t, 4.9)] == pytest.approx(primary.TRUE, rel=0.1)
    assert k[-1] == pytest.approx(primary.DROPPED, rel=0.1)


@pytest.mark.parametrize("way", ["ukf", "least squares"])
@pytest.mark.slow
def test_the_secondary_spring_is_found(way):
    case = case_of("secondary_stiffness", "static", duration=25.0)
    record, fmu = truth(case), fmu_of("secondary_stiffness")
    if way == "ukf":
        found = secondary.joint_ukf(record, fmu, {"k1": secondary.stiffness()})
    else:
        found = secondary.least_squares(record, fmu)
    assert found.value["k1"][0] == pytest.approx(secondary.START, rel=0.2)
    assert found.value["k1"][-1] == pytest.approx(secondary.TRUE, rel=0.05)


@pytest.mark.slow
def test_a_weak_spring_is_found_at_its_corner():
    case = case_of("secondary_stiffness", "one corner", duration=20.0, when=5.0)
    found = secondary.joint_ukf(truth(case), fmu_of("secondary_stiffness"), secondary.healths())
    last = {c: float(found.value[f"h_k1_{c}"][-1]) for c in secondary.CORNERS}
    assert last["rl"] == pytest.approx(0.5, abs=0.1)
    assert all(abs(last[c] - 1.0) < 0.2 for c in ("fl", "fr", "rr"))


@pytest.mark.parametrize("start", radius.STARTS.values())
def test_the_radius_is_found_with_a_wrong_patch(start):
    case = case_of("rolling_radius", "15 km/h", duration=14.0, dt=1e-3)
    found = radius.followed(truth(case), case, start, fmu_of("rolling_radius"))
    late = found.t > 1.0
    assert rmse(found.value["r_w"][late], np.full(late.sum(), radius.TRUE)) < 1e-4


def test_a_wrong_roller_makes_the_wheel_wrong_in_proportion_and_drag_and_rounding_do_not():
    case = case_of("rolling_radius", "15 km/h, rough", duration=14.0)
    record = truth(case)
    steps = record.columns["omega_w"] / radius.RESOLUTION
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    found = radius.followed(record, case, radius.STARTS["from 320 mm"], fmu_of("rolling_radius"))
    declared = 0.45215  # m, of the roller
    wrong = radius.TRUE * declared / radius.ROUGH["r_r"]
    assert wrong < radius.TRUE - 3e-4
    assert rmse(found.value["r_w"][found.t > 1.0], wrong) < 1e-4


@pytest.mark.slow
def test_the_primary_springs_filter_finds_the_patch_as_its_source_does():
    """By virtual penetration, as the record has it; with Hertz's patch the record is far less likely."""
    case = case_of("primary_stiffness", "static", duration=4.0)
    record, own = truth(case), primary.task(fmu_of("primary_stiffness"))
    hertz = replace(own, declared={**own.declared, "patch": 0.0})
    assert case.true["patch"] == 1.0
    assert own.known(record).log_likelihood > hertz.known(record).log_likelihood + 100.0


def test_the_sources_crossing_stands_only_where_it_gives_one():
    t = np.arange(0.0, 75.0, 0.5)
    lost = Followed(t, {"mu0": np.full_like(t, 0.1)}, {"mu0": np.full_like(t, 0.01)}, 0.0, 4.0, 1.0)
    record = Record({"time": t})
    for case in (c for c in friction.CASES if c.later):
        (found,) = (f for f in friction._judged(case, record, "c", lost) if "below 0.15 after" in f.what)
        assert found.source == (25.0 if case.name.startswith("dry") else None)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rolling_radius", "primary_stiffness", "secondary_stiffness"])
def test_a_row_meets_its_targets_and_writes_what_it_found(tmp_path, name):
    outcome = run_row(name, tmp_path, truth, fmu_of(name))
    missed = [f for f in outcome.findings if f.met is False]
    assert not missed
    for file in ("result.json", "table.md", f"{name}.png"):
        assert (tmp_path / file).stat().st_size > 0


@pytest.mark.slow
def test_the_friction_row_halves_the_source(tmp_path):
    outcome = run_row("friction_ukf", tmp_path, truth, fmu_of("friction_ukf"), cases=["wet", "wet-low"])
    assert not [f for f in outcome.findings if f.met is False and "(a" not in f.what]


def test_a_record_may_begin_in_the_middle_of_a_run():
    """Cut out of a longer run, it is that run's: nothing of the start from rest is left."""
    rest = replace(case_of("friction_ukf", "wet"), duration=3.0, noise={"y": 0.0, "y_dot": 0.0})
    later = truth(replace(rest, duration=2.0, lead=1.0))
    whole = truth(rest)
    for name in ("y_irr", "y_irr_dot", "y", "y_dot"):
        np.testing.assert_allclose(later.columns[name], whole.columns[name][1000:], atol=1e-12)
    assert later.t[0] == 0.0
    assert abs(later.columns["y"][0]) > 1e-5


@pytest.mark.slow
def test_wet_rails_do_not_warn():
    case = replace(case_of("friction_false_alarms", "wet-11"), duration=60.0)
    outcome = ROWS["friction_false_alarms"].rebuilt([(case, truth(case))], fmu_of("friction_ukf"), print)
    assert outcome.ok


# ---- the profile


def test_the_region_of_a_true_gauge_is_the_curve():
    curves = profile.geometry()
    low, high = profile.region(curves, 0.0)
    inner = np.abs(curves.shift) < profile.FLANGE
    np.testing.assert_allclose(low[inner], high[inner])
    np.testing.assert_allclose(low[inner], curves.value[inner], atol=1e-4)  # left and right mirrored


@pytest.mark.slow
def test_the_profile_is_found_bin_by_bin_and_gauge_blurs_it():
    errors = {}
    for name in ("alignment", "gauge too"):
        case = case_of("profile_rls", name, duration=16.0)
        outcome = profile.rebuilt([(case, truth(case))], fmu=None, tell=print)
        alone = [f for f in outcome.findings if f.what.startswith(profile.COMBINATIONS)]
        errors[name] = [f.ours for f in alone if "RMSE" in f.what]
    sums_of_radii, differences, _, angles = zip(*errors.values(), strict=True)
    for alone, blurred in (sums_of_radii, differences, angles):
        assert alone < 0.02
        assert blurred > 5 * alone


@pytest.mark.slow
def test_with_its_gauge_known_the_sum_of_the_radii_stays_in_the_region_and_that_of_the_angles_does_not():
    """As Ward et al. 2010 say of their Fig. 7; without the gauge, both leave it."""
    case = case_of("profile_rls", "gauge too", duration=30.0)
    outcome = profile.rebuilt([(case, truth(case))], fmu=None, tell=print)
    share = {f.what.removesuffix(": share of bins in the region"): f.ours for f in outcome.findings}
    assert share["gauge known, r_L + r_R"] >= profile.IN_REGION
    assert share["r_L + r_R"] < 0.7
    assert share["gauge known, delta_L + delta_R"] < 0.5
    assert share["gauge known, r_L - r_R"] == share["gauge known, delta_L - delta_R"] == 1.0


@pytest.mark.slow
def test_the_regressors_as_printed_find_the_differences_and_lose_the_sums_by_the_gauge():
    """With free coefficients the equations share no combination, so that the sums are less certain."""
    true, errors = profile.geometry(), []
    span = np.ptp(true.value[np.abs(true.shift) <= profile.FLANGE], axis=0)
    for name in ("alignment", "gauge too"):
        found = profile.as_printed(truth(case_of("profile_rls", name, duration=16.0)))
        used = np.abs(found.shift) <= profile.FLANGE
        wanted = np.column_stack([np.interp(found.shift[used], true.shift, x) for x in true.value.T])
        errors.append(np.sqrt(np.mean((found.value[used] - wanted) ** 2, axis=0)) / span)
    alone, blurred = errors
    assert max(alone[1], alone[3]) < 0.005
    assert alone[0] < 0.5
    assert blurred[0] > 5 * alone[0]


def test_what_the_gauge_does_is_nothing_where_there_is_none():
    record = truth(case_of("profile_rls", "alignment", duration=4.0))
    X, _ = profile.regression(record, gauge_known=True)
    of_gauge = [i for i, (power, _) in enumerate(profile.GAUGED) if power]
    changes = X[:, :, len(profile.KNOWN_TO) :].reshape(len(X), 2, len(profile.GAUGED), 2)
    assert not changes[:, :, of_gauge].any()
    alone, known = (profile.identified(record, gauge_known) for gauge_known in (False, True))
    np.testing.assert_allclose(alone.value[:, 1], known.value[:, 1], atol=1e-4)


def test_records_of_other_equations_are_not_made_by_the_fmu():
    case = case_of("profile_rls", "alignment", duration=1.0)
    with pytest.raises(BadInput, match="the FMU has no 'phi_dot' to make a record with; give records"):
        twin(fmu_of("profile_rls"))(case)
