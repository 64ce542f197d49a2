"""estimate: from an experiment to values with bands, for our own and for foreign FMUs."""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest

from fmus.errors import BadInput
from fmus.host.fmu import Fmu
from scenarios.estimating.alarms import stretches
from scenarios.estimating.estimating import estimate
from scenarios.estimating.result import write_csv
from scenarios.experiment.estimated import Alarm, Options
from tests.estimator.test_filters_fmu import PYTHON_VDP, SHOW_SPEED
from tests.helpers.vdp import solved
from tests.truth.rig import write_record

MU, NOISE = 0.8, 0.05
VDP = """\
id = "oscillator"
fmu = "{fmu}"
data = "data.csv"
time = "t"
[initial]
{x} = 2.0
[inputs]
u = "u"
[outputs.{x}]
column = "x"
unit = "{unit}"
noise_std = 0.05
[estimate]
parameters.{mu} = {{start = 1.5, std = 0.5, bounds = [0.0, 10.0]}}
"""
IN_M = 'm"\nmodel_unit = "m'  # for an FMU that states no unit
RIG = """
[estimate]
parameters.mu0 = {start = 0.3, std = 0.1, bounds = [0.02, 0.8]}
parameters.r_w = {start = 0.348, std = 0.002}
"""


def write_vdp(folder, fmu, names=("x0", "mu"), unit="m", text="", n=400, noise=NOISE, delay=0.0):
    rng = np.random.default_rng(3)
    t = 0.05 * np.arange(n)
    u = np.sin(0.7 * t)
    x = solved(t, (u[1:] + u[:-1]) / 2, MU)[:, 0]
    x = np.interp(t - delay, t, x) if delay else x
    x = x + noise * rng.standard_normal(n)
    np.savetxt(folder / "data.csv", np.column_stack([t, u, x]), delimiter=",", header="t,u,x", comments="")
    file = folder / "experiment.toml"
    file.write_text(VDP.format(fmu=fmu, x=names[0], mu=names[1], unit=unit) + text)
    return file


@pytest.fixture(scope="module")
def oscillator(vdp, tmp_path_factory):
    """The result and the folder of one run on the FMU from C."""
    folder = tmp_path_factory.mktemp("oscillator")
    heard = []
    file = write_vdp(folder, vdp)
    truth = {"mu": (np.array([0.0, 20.0]), np.array([MU, MU]))}
    return estimate(file, folder / "out", tell=heard.append, truth=truth), folder / "out", heard


def test_the_oscillator_of_the_c_fmu(oscillator):
    result, _, _ = oscillator
    mu = result.estimated["mu"]
    assert (mu["kind"], mu["informed_by_data"]) == ("parameter", True)
    assert mu["value"] == pytest.approx(MU, abs=3 * mu["std_error"])
    assert mu["std_error"] < 0.05
    assert mu["band_95"][0] < mu["value"] < mu["band_95"][1]
    assert 0 < result.rms_error["mu"] < 0.3
    assert set(result.estimated) == {"x0", "x1", "mu"}
    assert not result.diverged
    assert result.nis["share_within_95"] == pytest.approx(0.95, abs=0.04)
    assert result.innovations["x0"]["rms_over_expected"] == pytest.approx(1.0, abs=0.12)
    assert result.innovations["x0"]["gated_share"] == 0.0


def test_what_is_written(oscillator):
    result, out, heard = oscillator
    written = json.loads((out / "result.json").read_text())
    assert written["estimated"]["mu"]["value"] == result.estimated["mu"]["value"]
    table = np.genfromtxt(out / "estimate.csv", delimiter=",", names=True)
    assert table.dtype.names == ("time", "x0", "x0_std", "x1", "x1_std", "mu", "mu_std")
    assert len(table) == 400
    assert table["mu"][-1] == pytest.approx(result.estimated["mu"]["value"], rel=1e-6)
    assert table["mu_std"][-1] == pytest.approx(result.estimated["mu"]["std_error"], rel=1e-6)
    assert not [f for f in out.iterdir() if f.name.startswith(".") or f.is_dir()]
    assert any("filtering" in line for line in heard)


def test_the_page_holds_what_was_found_and_asks_for_nothing(oscillator):
    result, out, _ = oscillator
    page = (out / "estimate.html").read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)\s*=\s*["'](https?:)?//""", page)
    assert "<script" not in page
    assert f"{result.estimated['mu']['value']:.2f}" in page
    assert page.count("data:image/png;base64,") >= 2
    assert {"estimate.png", "estimate.svg", "innovations.png"} <= {f.name for f in out.iterdir()}
    assert "nan" not in re.sub(r"<[^>]+>|base64,[^\"]+", " ", page).lower().split()


@pytest.mark.slow
def test_the_oscillator_made_with_pythonfmu(foreign, tmp_path):
    file = write_vdp(tmp_path, foreign(PYTHON_VDP, SHOW_SPEED), ("x", "k"), IN_M)
    k = estimate(file).estimated["k"]
    assert k["value"] == pytest.approx(MU, abs=3 * k["std_error"])
    assert k["std_error"] < 0.05


FALLING = """\
id = "falling"
fmu = "{fmu}"
data = "data.csv"
time = "t"
[inputs]
u = "u"
[outputs.x]
column = "x"
unit = "m"
model_unit = "m"
noise_std = 1e-3
[estimate]
parameters.k = {{start = 1.0, std = 0.5, bounds = [0.1, 9.0]}}
"""


def write_falling(folder, fmu, text=""):
    """A record of x' = u - k x with k = 2, from 1.5, and its experiment."""
    t = 0.02 * np.arange(500)
    u = np.sign(np.sin(2 * t))
    x = [1.5]
    for now in (u[1:] + u[:-1]) / 2:
        x.append(now / 2 + (x[-1] - now / 2) * np.exp(-2 * 0.02))
    seen = x + 1e-3 * np.random.default_rng(5).standard_normal(len(t))
    np.savetxt(folder / "data.csv", np.column_stack([t, u, seen]), delimiter=",", header="t,u,x", comments="")
    file = folder / "experiment.toml"
    file.write_text(FALLING.format(fmu=fmu) + text)
    return file


EXACT = "self.x = self.u / self.k + (self.x - self.u / self.k) * math.exp(-self.k * dt)"


def test_a_state_that_the_fmu_does_not_declare_can_be_named(foreign, tmp_path):
    """Most FMUs that are written quickly declare none; whether one is a state, restarts show."""
    fmu = foreign(EXACT, initial="calculated")
    k = estimate(write_falling(tmp_path, fmu, 'states = ["x"]\n')).estimated["k"]
    assert k["value"] == pytest.approx(2.0, abs=3 * k["std_error"])
    assert k["std_error"] < 0.01


def test_an_fmu_without_declared_states_asks_for_their_names(foreign, tmp_path):
    with pytest.raises(BadInput, match=r"declares no states, so name them: \[estimate\] states = \[...\]$"):
        estimate(write_falling(tmp_path, foreign(EXACT, initial="calculated")))


def test_a_state_that_is_named_without_being_one_is_found_out(foreign, tmp_path):
    hidden = foreign("self.h += dt * (self.u - self.k * self.h)\nself.x = self.h", initial="calculated")
    with pytest.raises(BadInput, match=r"'x' differs from the simulation without a restart; it has a hidden"):
        estimate(write_falling(tmp_path, hidden, 'states = ["x"]\n'))


def test_mass_and_friction_of_the_drive(built, tmp_path):
    shutil.copy(built("drive"), tmp_path / "Drive.fmu")
    rng, t = np.random.default_rng(4), 0.005 * np.arange(500)
    F = 120 * np.sign(np.sin(2 * np.pi * 0.7 * t)) + 40 * np.sin(2 * np.pi * 2.3 * t)
    with Fmu(built("drive")) as fmu:
        q, v = fmu.simulate(t, {"F": (F[1:] + F[:-1]) / 2}, ["q", "q_dot"], {"M": 88.0, "F_v": 150.0}).T
    y = np.column_stack([q, (F - 150.0 * v) / 88.0])  # an accelerometer sees the force of its moment
    y += rng.standard_normal(y.shape) * [1e-4, 0.02]
    rows = np.column_stack([t, F, y])
    np.savetxt(tmp_path / "data.csv", rows, delimiter=",", header="t,F,q,a", comments="")
    (tmp_path / "experiment.toml").write_text(DRIVE)
    result = estimate(tmp_path)
    for name, true in (("M", 88.0), ("F_v", 150.0)):
        found = result.estimated[name]
        assert found["value"] == pytest.approx(true, abs=3 * found["std_error"])
        assert found["std_error"] < 0.02 * true
    assert [n for n in result.notes if "noise of 'q' was not declared" in n]
    assert result.innovations["q"]["noise"] == pytest.approx(1e-4, rel=0.1)


DRIVE = """\
id = "drive"
fmu = "Drive.fmu"
data = "data.csv"
time = "t"
[inputs]
F = "F"
[outputs.q]
column = "q"
unit = "m"
[outputs.q_ddot]
column = "a"
unit = "m/s2"
noise_std = 0.02
[estimate]
parameters.M = {start = 100.0, std = 15.0}
parameters.F_v = {start = 200.0, std = 60.0}
"""


def write_rig(folder, seed):
    """A record of the rig's truth model, which shares no code with the FMU."""
    file = write_record(
        folder, "rig", np.random.default_rng(seed), duration=12.0, dt=0.01,
        parameters_true={"mu0": 0.36, "r_w": 0.3492},
    )  # fmt: skip
    file.write_text(file.read_text() + RIG)
    return file


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """One record of the rig."""
    return write_rig(tmp_path_factory.mktemp("rig"), 0)


def inside(result, name, true):
    low, high = result.estimated[name]["band_95"]
    return low < true < high


def test_friction_and_rolling_radius_of_the_rig(rig):
    result = estimate(rig)
    assert inside(result, "mu0", 0.36)
    assert inside(result, "r_w", 0.3492)
    assert result.estimated["r_w"]["std_error"] < 2e-6
    assert result.estimated["mu0"]["std_error"] < 0.01
    assert result.nis["mean"] == pytest.approx(2.0, abs=0.15)
    assert result.alarms == []
    assert "states that are simulated, not estimated: theta_w, theta_r" in result.notes
    assert set(result.estimated) == {"omega_w", "omega_r", "mu0", "r_w"}


@pytest.mark.slow
def test_bands_hold_over_records_of_the_truth_model(tmp_path):
    """Of ten bands of 95 % each, fewer than eight hold by chance once in ninety times."""
    results = [estimate(write_rig(tmp_path / str(seed), seed)) for seed in range(10)]
    assert sum(inside(r, "mu0", 0.36) for r in results) >= 8
    assert sum(inside(r, "r_w", 0.3492) for r in results) >= 8


def test_an_alarm_tells_when_and_how_surely(rig):
    options = Options(
        alarms={"r_w": Alarm(above=0.349, probability=0.99)}, process_std={"omega_w": 0.01, "omega_r": 0.01}
    )
    (raised,) = estimate(rig, options=options).alarms
    assert (raised.name, raised.limit, raised.end) == ("r_w", "above 0.349", None)
    assert 0.0 <= raised.begin < 2.0
    assert raised.probability > 0.99


def test_an_alarm_ends_where_it_is_even_again():
    p = np.array([0.1, 0.96, 0.7, 0.97, 0.4, 0.9, 0.99, 0.6])
    found = stretches("mu0", "below 0.15", np.arange(8.0), p, Alarm(below=0.15, hold=0.0))
    assert [(a.begin, a.end, a.probability) for a in found] == [(1.0, 4.0, 0.97), (6.0, None, 0.99)]


def test_an_alarm_waits_until_it_has_held():
    p = np.array([0.97, 0.96, 0.1, 0.96, 0.97, 0.98, 0.6, 0.99, 0.99, 0.99, 0.4, 0.95])
    found = stretches("mu0", "below 0.15", np.arange(12.0), p, Alarm(below=0.15, hold=2.0))
    assert [(a.begin, a.end, a.probability) for a in found] == [(3.0, 10.0, 0.99)]


def test_a_parameter_that_the_data_do_not_inform_is_reported_as_such(vdp, tmp_path):
    """'fault' is a switch of the FMU that nothing but its failures depends on."""
    text = "parameters.fault = {start = 0.2, std = 0.01, bounds = [0.0, 0.5]}\n"
    result = estimate(write_vdp(tmp_path, vdp, text=text, n=200))
    assert result.estimated["fault"]["informed_by_data"] is False
    assert result.estimated["mu"]["informed_by_data"] is True
    assert any("the record contains no information on 'fault'" in note for note in result.notes)


def test_a_start_beside_its_bound_has_the_declared_prior(vdp, tmp_path):
    """The half of a percent of the bounds is the distance of the start from one of them."""
    file = write_vdp(tmp_path, vdp)
    file.write_text(file.read_text().replace("start = 1.5, std = 0.5", "start = 0.05, std = 1.0"))
    mu = estimate(file).estimated["mu"]
    assert mu["value"] == pytest.approx(MU, abs=3 * mu["std_error"])
    assert mu["std_error"] < 0.2
    assert mu["prior"] == [0.05, 1.0]


def test_a_parameter_that_the_data_bring_to_its_bound_is_informed(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp)
    file.write_text(file.read_text().replace("start = 1.5, std = 0.5", "start = 9.9, std = 0.05"))
    found = estimate(file)
    mu = found.estimated["mu"]
    left = found.identifiability["after"]["deviation_left"]["mu"]
    assert left <= mu["std_error"] / 0.05 * (1 + 1e-9)


def test_a_constant_column_without_noise_is_refused(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp)
    file.write_text(file.read_text().replace("noise_std = 0.05\n", ""))
    table = pd.read_csv(tmp_path / "data.csv")
    table["x"] = 2.0
    table.to_csv(tmp_path / "data.csv", index=False)
    with pytest.raises(BadInput, match=r"\[outputs.x0\] is constant over the record"):
        estimate(file)


def test_noise_of_a_state_that_is_not_estimated_leaves_the_others_to_be_found(vdp, tmp_path):
    found = estimate(write_vdp(tmp_path, vdp), options=Options(process_std={"x1": 1e-3}))
    assert found.process_noise_share is not None


def test_a_first_sample_that_is_empty_leaves_the_state_open(vdp, tmp_path):
    """The first measurement comes after 4 s, when the state has moved on."""
    file = write_vdp(tmp_path, vdp)
    file.write_text(file.read_text().replace("[initial]\nx0 = 2.0\n", ""))
    table = pd.read_csv(tmp_path / "data.csv")
    table.loc[:80, "x"] = np.nan
    table.to_csv(tmp_path / "data.csv", index=False)
    found = estimate(file, tmp_path / "out")
    first = np.genfromtxt(tmp_path / "out" / "estimate.csv", delimiter=",", names=True)[0]
    assert first["x0_std"] > 0.9 > 10 * NOISE
    assert found.estimated["mu"]["value"] == pytest.approx(MU, abs=3 * found.estimated["mu"]["std_error"])


def test_smoothing_and_the_other_filters(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp)
    known = {"process_std": {"x0": 1e-3, "x1": 1e-3}}
    plain, smooth, ekf = (
        estimate(file, options=Options(**known, **more)) for more in ({}, {"smooth": True}, {"filter": "ekf"})
    )
    assert smooth.estimated["mu"]["value"] == pytest.approx(plain.estimated["mu"]["value"])
    assert ekf.estimated["mu"]["value"] == pytest.approx(plain.estimated["mu"]["value"], abs=0.02)
    assert plain.process_noise_share is None


def test_a_filter_that_diverges_says_so_and_keeps_what_it_has(foreign, tmp_path):
    step = "if self.x > 1.9 and t > 6.0:\n    return False\n" + PYTHON_VDP.strip()
    result = estimate(
        write_vdp(tmp_path, foreign(step, SHOW_SPEED), ("x", "k"), IN_M), tmp_path / "out",
        options=Options(process_std={"x": 1e-3, "h": 1e-3}),
    )  # fmt: skip
    assert result.diverged
    assert "a step at t = " in result.reason
    table = np.genfromtxt(tmp_path / "out" / "estimate.csv", delimiter=",", names=True)
    assert 100 < len(table) == result.samples < 400
    assert "diverged" in (tmp_path / "out" / "estimate.html").read_text()


def test_half_the_rate_is_half_the_samples(vdp, tmp_path):
    result = estimate(write_vdp(tmp_path, vdp, text="rate = 10.0\n"))
    assert result.samples == 200
    assert result.estimated["mu"]["value"] == pytest.approx(MU, abs=3 * result.estimated["mu"]["std_error"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[estimate]\n", "[estimates]\n"), "key 'estimates' is not known; did you mean 'estimate'?"),
        (("parameters.mu ", "parameters.nu "), "'nu' is not a parameter of VanDerPol; known are fault, mu"),
        (
            ("start = 1.5", "start = 0.0"),
            r"[estimate.parameters] mu: start 0 is not between its bounds 0 and 10",
        ),
        (
            ("[estimate]\n", "[estimate]\nrate = 50.0\n"),
            "[estimate] rate = 50 Hz is above the 20 Hz of the record; leave it out to use every sample",
        ),
        (
            ('[inputs]\nu = "u"\n', "[estimate.inputs]\nu = {std = 1.0, frequency = 12.0}\n"),
            "[estimate.inputs.u] frequency = 12 Hz does not show in samples at 20 Hz; name one of at most",
        ),
        (("std = 0.5, ", ""), None),
    ],
)
def test_bad_input_is_one_clear_line(change, words, vdp, tmp_path):
    file = write_vdp(tmp_path, vdp, n=60)
    file.write_text(file.read_text().replace(*change))
    if words is None:  # a deviation not given is a quarter of the bounds
        assert estimate(file).estimated["mu"]["value"] > 0
        return
    with pytest.raises(BadInput, match=re.escape(words)) as refused:
        estimate(file)
    assert "\n" not in str(refused.value)
    assert str(file) in str(refused.value)


def test_options_are_checked_against_what_is_estimated(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp, n=60)
    with pytest.raises(BadInput, match=r"\[estimate.options\] walk 'nu' is not estimated; known are mu"):
        estimate(file, options=Options(walk={"nu": 0.1}))
    with pytest.raises(BadInput, match="filter = 'dual' does not support gate and adapt"):
        estimate(file, options=Options(filter="dual", gate=5.0, process_std={"x0": 1e-3, "x1": 1e-3}))


def test_without_the_table_there_is_nothing_to_estimate(vdp, tmp_path):
    file = write_vdp(tmp_path, vdp, n=60)
    file.write_text(file.read_text().split("[estimate]")[0])
    with pytest.raises(BadInput, match=r"has no \[estimate\]; list there the parameters"):
        estimate(file, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["A[1,2]", 'x"y', "ω_0", "µ"])
def test_a_name_with_any_letters_is_one_column(name, tmp_path):
    write_csv(tmp_path / "estimate.csv", (name,), np.arange(3.0), np.ones((3, 1)), np.zeros((3, 1)))
    assert list(pd.read_csv(tmp_path / "estimate.csv")) == ["time", name, f"{name}_std"]


@pytest.mark.parametrize("where", ["write_csv", "write_page"])
def test_an_interrupted_run_leaves_nothing_half_written(where, vdp, tmp_path, monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"scenarios.estimating.estimating.{where}", interrupted)
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        estimate(write_vdp(tmp_path, vdp, n=60), out)
    assert list(out.iterdir()) == []
