"""Wear over mileage: the law, footprints, balance of mass, early ends, the command and what follows it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.contact.geometry.exact import exact_profile
from fmus.contact.geometry.measured import load_profile
from fmus.errors import BadInput
from fmus.wheelset.track import Track
from scenarios.cli.app import run_safely
from scenarios.simulating import load_scenario
from scenarios.wearing.evolution import Plan, evolved, new_wheels, worn_track
from scenarios.wearing.followed import followed
from scenarios.wearing.footprint import footprints
from scenarios.wearing.law import BEGINS, SEVERE, STEEL, section_loss, wear_rate
from scenarios.wearing.page import headline, write_page
from scenarios.wearing.result import Wear
from scenarios.wearing.service import SIDES, Ride, Service
from scenarios.wearing.sizes import sizes
from scenarios.wearing.wheel import WornWheel

SHIPPED = Path(__file__).parents[2] / "scenarios" / "shipped"
SERVICE = SHIPPED / "bogie_in_service.toml"
S1002 = exact_profile("S1002")


class Riding(Service):
    """A service whose rides are drawn, without an FMU: shifts about a place, m, and T gamma, N."""

    about, tread, flange = 0.0, 20.0, 0.0

    def rides(self, wheels, tell):
        """See Service."""
        rng = np.random.default_rng(4)
        for side, sign in SIDES.items():
            shift = sign * self.about + 1e-3 * rng.standard_normal(400)
            both = (np.full(400, value) for value in (self.tread, self.flange))
            yield Ride(side, shift, np.full(400, 0.1), *both, 55e3)


def riding(about=0.0, tread=20.0, flange=0.0):
    made = Riding(load_scenario(SERVICE), "bogie", ("1", "2"), Track())
    for name, value in (("about", about), ("tread", tread), ("flange", flange)):
        object.__setattr__(made, name, value)
    return made


@given(st.floats(0.0, 200.0), st.floats(0.0, 200.0))
def test_more_energy_by_area_wears_more(one, other):
    assert (wear_rate(min(one, other)) <= wear_rate(max(one, other)) + 1e-12).all()


@pytest.mark.parametrize("edge", BEGINS)
def test_the_law_is_steady_where_its_regimes_meet(edge):
    beside = wear_rate(np.array([edge * (1 - 1e-9), edge, edge * (1 + 1e-9)]))
    assert np.ptp(beside) < 1e-6 * beside[1]
    assert beside[1] == pytest.approx(SEVERE * 1e-3)


def test_mild_wear_does_not_depend_on_the_area():
    """5.3 ug by m and N: 10 N over a way of 1000 km take 53 g of a wheel, by hand."""
    loss = section_loss(np.array([10.0, 10.0]), np.array([80e-6, 160e-6]), 0.46)
    assert loss == pytest.approx(53e-3 / 1e6 / STEEL / (2 * np.pi * 0.46), rel=1e-12)


def test_sizes_of_a_new_wheel_are_those_of_its_standard():
    """EN 13715: flange 28 mm high and 32.5 mm thick; its qR is 10.79 mm."""
    found = sizes(S1002)
    assert found.Sh == pytest.approx(28e-3, abs=1e-6)
    assert found.Sd == pytest.approx(32.5e-3, abs=1e-5)
    assert found.qR == pytest.approx(10.79e-3, abs=2e-5)
    assert found.beyond == ()
    assert replace(found, Sh=37e-3, Sd=21e-3).beyond == ("Sh", "Sd")


def test_a_tread_that_wears_evenly_makes_the_wheel_smaller_and_the_flange_higher(tmp_path):
    new = WornWheel.of(S1002, 0.46)
    eta = np.linspace(-0.07, 0.07, 2000)
    depth = np.where(eta > -0.02, 1e-3, 0.0)
    worn = new.after(eta, depth)
    assert worn.radius == pytest.approx(0.459, abs=1e-5)
    profile = load_profile(worn.write(tmp_path / "worn.txt", "a test"), "wheel")
    assert sizes(profile).Sh == pytest.approx(29e-3, abs=3e-5)
    assert worn.section == pytest.approx(1e-3 * 80e-3, rel=0.01)


@pytest.mark.parametrize("wheel", ["S1002", "EN15302_WheelH"])
def test_what_is_lost_is_spread_over_the_profile_and_none_is_left_out(wheel):
    prints = footprints(Track(wheel=wheel), 7e-3)
    rng = np.random.default_rng(2)
    for one in prints.values():
        assert np.diff(one.eta).min() > 0
        for part, shifts in (("tread", rng.uniform(-5e-3, 5e-3, 50)), ("flange", np.full(5, 6.8e-3))):
            loss = rng.uniform(0.0, 1e-9, len(shifts))
            assert one.depth(part, shifts, loss) @ one.along == pytest.approx(loss.sum(), rel=1e-9)


def test_a_wheel_at_its_flange_wears_there():
    one = footprints(Track(), 7.5e-3)["left"]
    lost = one.depth("flange", np.array([7e-3]), np.array([1e-9]))
    centred = one.depth("tread", np.array([0.0]), np.array([1e-9]))
    assert -0.045 < one.eta[np.argmax(lost)] < -0.03
    assert abs(one.eta[np.argmax(centred)]) < 0.01


@pytest.mark.parametrize("both_ways", [pytest.param(False, marks=pytest.mark.slow), True])
def test_the_section_that_is_lost_is_that_of_the_dissipated_energy(both_ways, tmp_path):
    """2 %: the points follow the profile's curve, and the file is smoothed when it is read."""
    found = evolved(riding(about=1e-3), Plan(1500.0, 1e-4, both_ways), tmp_path)
    assert not found.ended
    assert found.states[-1].km == pytest.approx(1500.0)
    by_law = section_loss(np.array([20.0]), np.array([1e-4]), 0.46)[0] * 1.5e6
    for side in SIDES:
        assert found.states[-1].wheels[side].section == pytest.approx(by_law, rel=0.02)
    files = sorted(p.name for p in tmp_path.glob("wheel*.txt"))
    assert files[0].startswith("wheel_0" if both_ways else "wheel_left_0") or not both_ways


@pytest.mark.slow
def test_a_smaller_step_leads_to_the_same_wheel(tmp_path):
    ends = []
    for step in (4e-5, 2e-5):
        folder = tmp_path / f"{step:g}"
        folder.mkdir()
        states = evolved(riding(about=1e-3), Plan(600.0, step), folder).states
        wheel = states[-1].wheels["left"]
        ends.append(np.interp(np.linspace(-0.03, 0.03, 300), wheel.y, wheel.worn))
    assert np.abs(ends[0] - ends[1]).max() < 0.1 * ends[1].max()


@pytest.mark.slow
def test_exchanged_sides_wear_as_the_mirror_image(tmp_path):
    rates = []
    for about in (2e-3, -2e-3):
        folder = tmp_path / f"{about:g}"
        folder.mkdir()
        last = evolved(riding(about=about), Plan(100.0), folder).states[-1]
        rates.append({side: last.wheels[side].section for side in SIDES})
    assert rates[0]["left"] == pytest.approx(rates[1]["right"], rel=0.02)


def test_a_service_that_derails_worn_keeps_the_states_before(tmp_path):
    class Later(Riding):
        def rides(self, wheels, tell):
            if wheels:
                object.__setattr__(self, "about", 0.05)
            yield from super().rides(wheels, tell)

    service = Later(load_scenario(SERVICE), "bogie", ("1",), Track())
    found = evolved(service, Plan(5000.0), tmp_path)
    assert len(found.states) == 1
    assert "derails" in found.ended
    assert "ended early" in " ".join(Wear(found).notes())
    with pytest.raises(BadInput, match="derails"):
        evolved(riding(about=0.05), Plan(5000.0), tmp_path)


def test_a_service_without_creep_wears_nothing(tmp_path):
    found = evolved(riding(tread=0.0), Plan(1000.0), tmp_path)
    assert [s.km for s in found.states] == [0.0, 1000.0]
    assert Wear(found).deepest == 0.0


def test_the_page_and_the_tables_of_three_states(tmp_path):
    result = Wear(evolved(riding(about=1e-3, flange=1.0), Plan(250.0, 1e-4), tmp_path))
    assert len(result.evolution.states) >= 3
    result.write(tmp_path)
    write_page(tmp_path, result, "railfmi wear")
    page = (tmp_path / "wear.html").read_text(encoding="utf-8")
    assert headline(result) in page
    assert page.count("<figure") == 3
    assert len((tmp_path / "states.csv").read_text().splitlines()) == len(result.evolution.states) + 1
    said = json.loads((tmp_path / "result.json").read_text())
    assert said["states"][-1]["km"] == 250.0
    assert said["states"][0]["at_flange_left"] == pytest.approx(1 / 21)
    for name in said["states"][1]["wheels"]:
        assert (tmp_path / name).is_file()


def test_sides_that_wear_alike_share_a_file(tmp_path):
    wheels = new_wheels(Track())
    alike = worn_track(Track(), wheels, tmp_path, 1, 10.0)
    assert alike.alike
    assert Path(alike.wheel).name == "wheel_001_0000010km.txt"
    stated = worn_track(Track(wheel_right="S1002", r0_right=0.46), wheels, tmp_path, 1, 10.0)
    assert stated == alike  # a right wheel that the scenario states wears, too


@pytest.mark.parametrize(
    ("plan", "said"), [((0.0,), "--km"), ((float("nan"),), "--km"), ((10.0, -1e-3), "--step")]
)
def test_a_wrong_plan_is_refused(plan, said):
    with pytest.raises(BadInput, match=said):
        Plan(*plan)


def test_a_scenario_without_wheels_that_wear_is_refused():
    with pytest.raises(BadInput, match="wear needs one FMU"):
        Service.read(SHIPPED / "alignment_step.toml")


def test_a_service_is_read_with_its_wheelsets():
    service = Service.read(SERVICE)
    assert (service.fmu, service.wheelsets, service.track) == ("bogie", ("1", "2"), Track())


@pytest.mark.slow
def test_the_command_wears_wheels_and_estimates_follow(tmp_path):
    out = tmp_path / "wear"
    words = ["wear", str(SERVICE), "--km", "60", "--follow", "--both-ways", "--out", str(out)]
    assert run_safely(words) == 0
    said = json.loads((out / "result.json").read_text())
    assert said["km"] == pytest.approx(60.0)
    worn = said["states"][-1]
    assert worn["worn_left"] == pytest.approx(worn["worn_right"], rel=1e-6)
    assert 2e-5 < worn["worn_left"] < 5e-4
    for f in said["followed"]:
        assert f["conicity"] == pytest.approx(f["true_conicity"], abs=0.02)
        assert max(f["error"], f["looped_error"]) < 0.05
    assert (out / "wear.html").is_file()


@pytest.mark.slow
def test_estimates_follow_a_tread_that_wears_hollow(tmp_path):
    states = evolved(riding(), Plan(4000.0, 1e-4), tmp_path).states
    ends = followed((states[0], states[-1]), lambda _: None)
    assert abs(ends[1].true_conicity - ends[0].true_conicity) > 0.03
    for f in ends:
        assert f.conicity == pytest.approx(f.true_conicity, abs=0.02)
        assert f.error < 0.05
        radii, alignment = f.looped
        assert radii < 0.05
        assert alignment < 0.2
