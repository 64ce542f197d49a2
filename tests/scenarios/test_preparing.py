"""The way in: a record surveyed, columns matched to variables, an experiment drafted, a trial run."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.record import Record, Run
from fmus.errors import BadInput
from fmus.host.description import FmuDescription, FmuVariable
from fmus.units import UNITS
from scenarios.cli.app import run_safely
from scenarios.cli.console import interrupted, say_notices, will_write
from scenarios.closing.suspicion import factor_of
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from scenarios.output import WRITING, replaced
from scenarios.preparing.draft import draft, with_column
from scenarios.preparing.initialising import Initialised, init
from scenarios.preparing.inspecting import bandwidth, inspect
from scenarios.preparing.matching import ENOUGH, SURE, likeness, matches
from scenarios.preparing.ports import port_remarks
from scenarios.preparing.quantities import numbers_of, unit_in_name
from scenarios.preparing.survey import Channel, survey
from scenarios.preparing.text import toml_of
from scenarios.preparing.trial import Trial, dry_run, duration
from tests.helpers.foreign import GOOD, foreign_builder
from tests.helpers.paths import SHIPPED

DEMO = SHIPPED / "demo" / "rig-drag"
T = np.arange(1000) * 0.01


def variable(name, causality="output", unit=None, start=None, description="", **more):
    given = {"min": None, "max": None, "nominal": None, **more}
    return FmuVariable(name, 0, causality, "continuous", None, unit, start, description=description, **given)


def fmu(*variables):
    return FmuDescription("Motor", "2.0", "Motor", "{0}", {v.name: v for v in variables})


MOTOR = fmu(
    variable("u", "input", start=0.0),
    variable("T_load", "input", start=0.0),
    variable("R", "parameter", start=1.2, max=1.3),
    variable("k", "parameter", start=-0.05),
    variable("zero", "parameter", start=0.0),
    variable("i"),
    variable("omega"),
)


def channel(name, unit=None):
    return Channel(name, unit, np.sin(T), ())


def log(folder, text_of_units="s,V,rpm,mA", begin=1234.5, names="time,voltage,speed,current", **columns):
    """A record of a motor as a logger writes it."""
    file = folder / "log.csv"
    rng = np.random.default_rng(0)
    cells = {"t": begin + T, "u": np.sin(T), "n": 100 * np.cos(T), "i": rng.normal(size=T.size)} | columns
    lines = pd.DataFrame(cells).to_csv(None, index=False, header=False)
    file.write_text("\n".join([names, *([text_of_units] if text_of_units else []), lines]))
    return file


# --- survey


def test_a_survey_finds_time_rate_units_and_gaps(tmp_path):
    u = np.sin(T)
    u[5] = np.nan
    file = log(tmp_path, u=u)
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:500], *lines[700:]]) + "\n")
    [raster] = survey(file)
    assert (raster.time, raster.step) == ("time", pytest.approx(0.01))
    assert [(c.name, c.unit) for c in raster.channels] == [
        ("voltage", "V"), ("speed", "rpm"), ("current", "mA"),
    ]  # fmt: skip
    assert "no number in 1 of 800 rows" in raster.channels[0].remarks
    assert any(r.startswith("no data from 1239.47 to 1241.48 s") for r in raster.remarks)
    assert raster.longest() == pytest.approx((1234.5, 1239.47))


def test_units_are_spelled_alike_whatever_the_format(tmp_path):
    table = pd.DataFrame({"time": T, "n": np.sin(T), "phi": np.cos(T)})
    file = tmp_path / "a.csv"
    table.to_csv(file, index=False)
    (tmp_path / "a.csv.units.json").write_text('{"n": "U/min", "phi": "[Grad]"}')
    [raster] = survey(file)
    assert [c.unit for c in raster.channels] == ["rpm", "deg"]


def test_without_a_time_a_survey_says_so(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("a,b\n1,2\n0,3\n2,1\n")
    with pytest.raises(BadInput, match=r"no column increases from row to row.*--time"):
        survey(file)
    with pytest.raises(BadInput, match="line 3: time column 'a' goes from 1 to 0 s"):
        survey(file, "a")
    with pytest.raises(BadInput, match="has no time column 'c'"):
        survey(file, "c")


def test_several_rates_are_several_rasters(tmp_path):
    from tests.scenarios.test_readers import mdf

    fast = {"time": T, "speed": np.sin(T)}
    slow = {"time": T[::10], "temp": np.cos(T[::10]), "press": np.cos(T[::10])}
    mdf(tmp_path / "a.mf4", {"fast": fast, "slow": slow})
    rasters = survey(tmp_path / "a.mf4")
    assert {round(r.step, 6): len(r.channels) for r in rasters} == {0.1: 2, 0.01: 1}


def test_the_bandwidth_is_that_of_the_signal():
    step, t = 0.01, np.arange(20000) * 0.01
    slow = np.sin(2 * np.pi * 1.0 * t)
    assert bandwidth(slow, step) == pytest.approx(1.0, abs=0.2)
    assert bandwidth(slow + 0.5 * np.sin(2 * np.pi * 20 * t), step) == pytest.approx(20, abs=0.5)


def test_the_noise_of_a_channel_is_found():
    rng = np.random.default_rng(3)
    assert Channel("a", None, np.sin(T) + rng.normal(0, 0.02, T.size), ()).noise == pytest.approx(
        0.02, rel=0.1
    )


# --- matching


@pytest.mark.parametrize(
    ("name", "unit", "column", "column_unit", "sure"),
    [
        ("omega", None, "omega", None, True),
        ("omega", "rad/s", "speed", "rpm", True),
        ("u", None, "Voltage [V]", "V", True),
        ("T_P", "N.m", "T_P", None, True),
        ("x", "m", "n", "rpm", False),  # the units contradict each other
        ("omega", None, "speed", "m/s", False),
        ("a", None, "bogus", None, False),
    ],
)
def test_likeness(name, unit, column, column_unit, sure):
    found = likeness(variable(name, unit=unit), channel(column, column_unit))
    assert 0.0 <= found <= 1.0
    assert (found >= SURE) == sure


def test_a_unit_at_the_end_of_a_name_tells_the_quantity():
    column = channel("n_wheel_rpm", None)
    speed = variable("omega_w", unit="rad/s", description="wheel speed")
    torque = variable("T_w_ext", unit="N.m", description="port: torque on the wheel")
    assert likeness(speed, column) >= SURE
    assert likeness(torque, column) < ENOUGH
    lateral = variable("y", unit="mm", description="place of the wheel A")
    assert likeness(lateral, channel("wheel_A", None)) >= ENOUGH  # one letter is an index as often


def test_one_column_for_many_variables_alike_is_left_apart():
    """Unless it shares a word with one of them, which is not sure then."""
    rates = [variable(f"u_{c}_dot", "input", unit="m/s", description="rate of the rail height") for c in "ab"]
    assert matches(rates, [channel("speed", "km/h")]) == []
    [one] = matches(rates, [channel("rail height rate", "mm/s")])
    assert ENOUGH <= one.likeness < SURE
    [alone] = matches(rates[:1], [channel("speed", "km/h")])
    assert alone.likeness >= SURE


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (["acc3"], ["acc1", "acc2", "acc3"]),
        (["x1", "x2"], ["x2", "x1"]),
        (["q[1]", "q[2]"], ["q[2]", "q[1]"]),
        (["acc1", "acc2"], ["acc2_bogie", "acc1_bogie"]),
        (["F_z1", "F_z2", "F_z3", "F_z4"], ["Fz_4", "Fz_3", "Fz_2", "Fz_1"]),
        (["T", "t"], ["t", "T"]),
    ],
)
def test_numbers_and_letters_that_are_alike_go_to_each_other(names, columns):
    unit = "N" if names[0].startswith("F") else None
    found = matches([variable(name, unit=unit) for name in names], [channel(c, unit) for c in columns])
    assert [numbers_of(m.channel.name) for m in found] == [numbers_of(name) for name in names]
    assert all(m.channel.name == m.variable.name for m in found if m.variable.name in columns)


@pytest.mark.parametrize(
    ("name", "unit", "columns"),
    [
        ("v", "m/s", ["v_soll", "v_ist"]),
        ("omega", "rad/s", ["speed_setpoint", "speed_actual"]),
        ("i", "A", ["current_ref", "current_meas"]),
    ],
)
def test_a_setpoint_is_not_taken_for_what_was_measured(name, unit, columns):
    """Nor is the other one sure, since two columns look like it."""
    [found] = matches([variable(name, unit=unit)], [channel(c, unit) for c in columns])
    assert found.channel.name == columns[1]
    assert found.likeness < SURE


def test_g_of_an_acceleration_is_no_gram(tmp_path):
    coach = fmu(variable("z1_ddot", unit="m/s2", description="vertical acceleration of the coach"))
    [signal] = drafted(tmp_path, coach, text_of_units="s,g,rpm,mA", names="time,acc vertical,n,i").outputs
    assert (signal.channel.name, signal.unit) == ("acc vertical", "g_0")


@given(st.permutations(["voltage", "speed", "current", "junk"]))
def test_the_order_of_the_columns_does_not_matter(names):
    units = {"voltage": "V", "speed": "rpm", "current": "mA", "junk": "degC"}
    signals = [MOTOR.variables[n] for n in (*MOTOR.inputs, *MOTOR.outputs)]
    found = matches(signals, [channel(n, units[n]) for n in names])
    assert {m.variable.name: m.channel.name for m in found} == {
        "u": "voltage", "omega": "speed", "i": "current",
    }  # fmt: skip


def drafted(folder, description=MOTOR, **record):
    [raster] = survey(log(folder, **record))
    return draft(folder / "Motor.fmu", description, [raster])


def test_a_draft_guesses_units_ports_split_and_bounds(tmp_path):
    made = drafted(tmp_path)
    assert {s.variable.name: s.model_unit for s in made.signals} == {"u": "V", "i": "A", "omega": "rad/s"}
    [port] = made.ports
    assert (port.force, port.velocity, port.displacement) == ("T_load", "omega", None)
    file = tmp_path / "experiment.toml"
    file.write_text(toml_of(made, tmp_path))
    e = load_experiment(file)
    assert e.calibrate == {"R": (0.96, 1.3), "k": (-0.06, -0.04)}  # within the FMU's limits; not around 0
    assert e.split.identify == pytest.approx((1234.5, 1240.99), abs=0.01)
    assert e.split.test[1] <= 1234.5 + T[-1] + 1e-9


MASSES = [("y", "wheelset"), ("y_m", "suspended mass")]
UNITS_IN_NAMES = [
    ("v_kmh", "m/s", "km/h"),
    ("omega_rpm", "rad/s", "rpm"),
    ("speedRpm", "rad/s", "rpm"),
    ("SPEED_KMH", "m/s", "km/h"),
    ("phi deg", "rad", "deg"),
    ("Phi_Grad", "rad", "deg"),
    ("i_mA", "A", "mA"),
    ("force_KN", "N", "kN"),
    ("x_µm", "m", "µm"),
    ("p/mbar", "Pa", "mbar"),
    ("rpm", "rad/s", "rpm"),
    ("temp_degC", "K", "degC"),
    ("v_km_h", "m/s", "km/h"),
    ("gyro_z_deg_s", "rad/s", "deg/s"),
    ("torque N.m", "N.m", "N.m"),
    ("acc_x_m_s2", "m/s2", "m/s2"),
    ("acc_x_g", "m/s2", "g_0"),
    ("m_g", "kg", "g"),
    ("x_in_mm", "1", None),
    ("v_s", "m/s", None),  # of another kind
    ("phi_1", "rad", None),
    ("x_in", "m", None),  # what goes in
    ("x", "m", None),
    ("speed", "m/s", None),
    ("[mm]", "m", None),
    ("", "m", None),
]


@pytest.mark.parametrize(("name", "of", "unit"), UNITS_IN_NAMES)
def test_the_unit_at_the_end_of_a_name(name, of, unit):
    assert unit_in_name(name, [of]) == unit


@given(st.sampled_from([u for u in UNITS if u.isalnum() and u != "in"]), st.sampled_from(["x_", "x ", "F/"]))
def test_every_unit_may_end_a_name(unit, before):
    assert unit_in_name(before + unit, [unit]) == unit


def test_a_unit_in_the_name_of_a_column_is_a_guess(tmp_path):
    """What the record states counts more, and so does a name that the FMU's variable has itself."""
    motor = fmu(
        variable("v", "input", "m/s", 0.0), variable("omega", unit="rad/s"), variable("x_km", unit="m")
    )
    made = drafted(tmp_path, motor, text_of_units="", names="time,v_kmh,omega_rpm,x_km")
    assert {s.variable.name: s.unit for s in made.signals} == {"v": "km/h", "omega": "rpm", "x_km": None}
    text = toml_of(made, tmp_path)
    assert 'v = {column = "v_kmh", unit = "km/h"}' in text
    assert text.count("a guess, by the name of the column") == 2
    (tmp_path / "experiment.toml").write_text(text)
    e = load_experiment(tmp_path / "experiment.toml")
    assert (e.input_columns["v"].unit, e.outputs["omega"].unit) == ("km/h", "rpm")
    assert any("km/h (guess)" in line for line in Initialised(tmp_path, made).lines())
    stated = drafted(tmp_path, motor, text_of_units="s,m/s,rad/s,m", names="time,v_kmh,omega_rpm,x_km")
    assert {s.variable.name: s.unit for s in stated.signals} == {"v": "m/s", "omega": "rad/s", "x_km": "m"}


def test_a_unit_in_a_name_tells_what_an_fmu_without_units_may_have(tmp_path):
    made = drafted(tmp_path, text_of_units="", names="time,voltage_mV,speed_rpm,current_A")
    assert {s.variable.name: (s.unit, s.model_unit) for s in made.signals} == {
        "u": ("mV", "V"), "omega": ("rpm", "rad/s"), "i": ("A", "A"),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("units", "said"), [("", "none"), ("s,furlong,furlong,mA", '"furlong", which is not known')]
)
def test_a_column_without_a_unit_is_told_what_it_is_taken_in(tmp_path, units, said):
    motor = fmu(variable("v", "input", "m/s", 0.0), variable("omega", unit="rad/s"))
    text = toml_of(drafted(tmp_path, motor, text_of_units=units, names="time,v,omega,i"), tmp_path)
    assert 'v = {column = "v", unit = "m/s"}  # sure (100%); FMU variable in m/s; unit is a guess' in text
    assert text.count(f"a guess: the record states {said}") == 2


def test_a_port_takes_the_displacement_that_the_fmu_gives(tmp_path):
    more = fmu(*MOTOR.variables.values(), variable("theta"))
    assert drafted(tmp_path, more).ports[0].displacement == "theta"


def test_a_port_has_the_motion_of_its_own_number(tmp_path):
    """And what turns is known by its unit, where no word of its name says so."""
    bogie = fmu(
        variable("u", "input", "V"), variable("F_z2_ext", "input", "N"), variable("M_y2_ext", "input", "N.m"),
        *(variable(f"z{i}_dot", unit="m/s", description="rate") for i in (1, 2)),
        *(variable(f"z{i}", unit="m") for i in (1, 2)),
        *(variable(f"phi_y{i}_dot", unit="rad/s", description="pitch rate") for i in (1, 2)),
        *(variable(f"phi_y{i}", unit="rad") for i in (1, 2)),
    )  # fmt: skip
    motions = {p.force: (p.velocity, p.displacement) for p in drafted(tmp_path, bogie).ports}
    assert motions == {"F_z2_ext": ("z2_dot", "z2"), "M_y2_ext": ("phi_y2_dot", "phi_y2")}


def test_a_port_has_the_motion_of_what_it_is_said_to_push(tmp_path):
    mass = fmu(
        variable("F_ym_ext", "input", "N", description="lateral force on the suspended mass"),
        *(variable(f"{n}_dot", unit="m/s", description=f"lateral velocity of the {of}") for n, of in MASSES),
        *(variable(n, unit="m", description=f"lateral displacement of the {of}") for n, of in MASSES),
    )
    [port] = drafted(tmp_path, mass).ports
    assert (port.velocity, port.displacement) == ("y_m_dot", "y_m")


@pytest.mark.parametrize("stated", [True, False])
def test_the_rate_of_an_input_is_derived_from_its_column(tmp_path, stated):
    """Also for an FMU that states no units, whose own ones are guessed as those of SI."""
    track = fmu(
        variable("u_fl", "input", "m" if stated else None),
        *(variable(f"u_{c}_dot", "input", "m/s" if stated else None) for c in ("fl", "fr")),
        variable("omega", unit="rad/s"),
    )
    made = drafted(tmp_path, track, text_of_units="s,mm,rpm,mA", names="time,u fl,speed,i")
    assert [v.name for v in made.free_inputs] == ["u_fr_dot"]
    text = toml_of(made, tmp_path)
    (tmp_path / "experiment.toml").write_text(text)
    e = load_experiment(tmp_path / "experiment.toml")
    assert (e.derived["u_fl_dot"].derivative, e.input_columns["u_fl_dot"].unit) == ("u fl", "(mm)/s")
    record = load_record(e, track)
    rate, place = (record.runs[0].u[:, record.inputs.index(name)] for name in ("u_fl_dot", "u_fl"))
    np.testing.assert_allclose(rate, np.gradient(place, record.runs[0].t), rtol=1e-9, atol=1e-12)


def test_many_parameters_are_left_to_the_user(tmp_path):
    many = fmu(*MOTOR.variables.values(), *(variable(f"p{i}", "parameter", start=1.0) for i in range(9)))
    text = toml_of(drafted(tmp_path, many), tmp_path)
    assert "# p3 = [0.8, 1.2]" in text
    (tmp_path / "experiment.toml").write_text(text)
    assert load_experiment(tmp_path / "experiment.toml").calibrate == {}


def test_a_factor_of_one_is_not_calibrated(tmp_path):
    more = fmu(*MOTOR.variables.values(), variable("gain.k", "parameter", unit="1", start=-1.0))
    text = toml_of(drafted(tmp_path, more), tmp_path)
    assert '# "gain.k" = [-1.2, -0.8]  # exactly 1 and without a unit' in text
    (tmp_path / "experiment.toml").write_text(text)
    assert set(load_experiment(tmp_path / "experiment.toml").calibrate) == {"R", "k"}


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (GOOD, None),
        (GOOD.replace("self.u", "-self.u"), "a positive u lowers x, so that friction and damping"),
        (GOOD.replace("self.u", "1.0"), "u does not move x; name the output that it moves"),
    ],
    ids=["conjugate", "opposed", "apart"],
)
def test_a_port_whose_force_does_not_raise_its_velocity_is_told(foreign, body, words):
    port = SimpleNamespace(name="mass", force="u", velocity="x")
    e = SimpleNamespace(fmu_path=foreign(body), ports=[port], parameters={}, initial={})
    run = SimpleNamespace(t=T, u=np.empty((T.size, 0)))
    said = list(port_remarks(e, run, (), None))
    assert len(said) == (words is not None)
    assert all(s.startswith(f"port 'mass': {words}") for s in said)


def test_another_column_may_be_chosen(tmp_path):
    made = with_column(drafted(tmp_path), "omega", None)
    assert made.unused == ["speed"]
    assert made.ports[0].velocity == "omega"
    assert [s.channel.name for s in with_column(made, "i", "speed").outputs] == ["speed"]


# --- commands


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """The test rig's FMU."""
    folder = tmp_path_factory.mktemp("rig")
    assert run_safely(["build", "testrig", "--out", str(folder)]) == 0
    return folder / "Testrig.fmu"


def test_init_writes_what_close_loop_accepts(rig, tmp_path, capsys):
    assert run_safely(["init", str(rig), str(DEMO / "data.csv"), "--out", str(tmp_path)]) == 0
    assert "omega_r" in capsys.readouterr().out
    e = load_experiment(tmp_path / "experiment.toml")
    assert {n: o.column for n, o in e.outputs.items()} == {"omega_w": "omega_w", "omega_r": "omega_r"}
    assert {n: c.column for n, c in e.input_columns.items()} == {"T_P": "T_P", "f_sync": "f_sync"}
    assert {p.force for p in e.ports} == {"T_w_ext", "T_r_ext"}
    assert [p.velocity for p in e.ports] == ["omega_w", "omega_r"]
    # and nothing is replaced without being asked to
    assert run_safely(["init", str(rig), str(DEMO / "data.csv"), "--out", str(tmp_path)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run_safely(["init", str(rig), str(DEMO / "data.csv"), "--out", str(tmp_path), "--force"]) == 0


def test_init_asks_what_is_not_sure_and_nothing_else(rig, tmp_path):
    data = pd.read_csv(DEMO / "data.csv").rename(columns={"omega_w": "kanal 7"})
    data.to_csv(tmp_path / "data.csv", index=False)
    asked = []

    def ask(question, answers, default):
        asked.append(question)
        return "kanal 7" if "'omega_w'" in question else default

    made = init(rig, tmp_path / "data.csv", tmp_path, ask=ask)
    assert any("'omega_w'" in question for question in asked)
    assert not any("'omega_r'" in question for question in asked)
    assert load_experiment(made.file).outputs["omega_w"].column == "kanal 7"


def test_init_refuses_a_record_of_something_else(rig, tmp_path):
    file = tmp_path / "a.csv"
    pd.DataFrame({"time": T, "zzz": T}).to_csv(file, index=False)
    with pytest.raises(BadInput, match=r"no column looks like an output of Testrig\.fmu"):
        init(rig, file, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_trial_tells_mapping_fit_and_cost(tmp_path, capsys):
    out = tmp_path / "out"
    assert run_safely(["close-loop", str(DEMO), "--dry-run", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "omega_w       omega_w  rad/s       rad/s            as it is" in said
    assert "candidates" in said
    assert "expected:" in said
    assert [f.name for f in sorted(out.iterdir())] == ["dry_run.png", "dry_run.svg"]


def test_trials_of_several_experiments_have_a_folder_by_their_id(tmp_path):
    files = []
    for name in ("slow", "fast"):
        file = tmp_path / name / "experiment.toml"
        file.parent.mkdir()
        file.write_text((DEMO / "experiment.toml").read_text().replace('id = "', f'id = "{name}-'))
        files.append(str(file))
    out = tmp_path / "out"
    assert run_safely(["close-loop", *files, "--dry-run", "--data", str(DEMO), "--out", str(out)]) == 0
    ids = sorted(folder.name for folder in out.iterdir())
    assert [name.split("-")[0] for name in ids] == ["fast", "slow"]
    assert all((out / name / "dry_run.png").exists() for name in ids)


def test_a_trial_notices_a_wrong_unit(tmp_path):
    """Columns in rad/s that are declared as rpm are ten times too small after the conversion."""
    (tmp_path / "data.csv").write_bytes((DEMO / "data.csv").read_bytes())
    text = (DEMO / "experiment.toml").read_text().replace('unit = "rad/s"', 'unit = "rpm"')
    (tmp_path / "experiment.toml").write_text(text)
    trial = dry_run(tmp_path)
    assert sum("look at unit, model_unit, scale" in line for line in trial.lines()) == 2
    assert not any("look at unit" in line for line in dry_run(DEMO).lines())
    assert trial.candidates == dry_run(DEMO).candidates > 20


def test_a_trial_tells_the_unit_that_nobody_stated(tmp_path):
    """Columns in rpm that are taken for rad/s: a run from their first values has no course like theirs."""
    data = pd.read_csv(DEMO / "data.csv")
    data[["omega_w", "omega_r"]] *= 30 / np.pi
    data.to_csv(tmp_path / "data.csv", index=False)
    (tmp_path / "experiment.toml").write_bytes((DEMO / "experiment.toml").read_bytes())
    said = [line for line in dry_run(tmp_path).lines() if "times the simulated ones" in line]
    assert len(said) == 2
    assert all("as if the column were in rpm: look at unit" in line for line in said)


def test_a_trial_judges_the_parts_of_the_record_alone():
    """What lies before them may show how the FMU starts."""
    part = T >= 1.0
    y = np.sin(T)[:, None]
    run = Run(T, np.empty((T.size, 0)), y, part & (T < 7), part & False, part & (T >= 7))
    simulated = y + 0.01 * np.cos(40 * T)[:, None] + np.where(part, 0.0, 50.0)[:, None]
    problem = SimpleNamespace(record=Record((run,), (), ("y",), np.array([np.nan])))
    told = Trial(problem, simulated, simulated, 1.0, 1, 1).to_frame().loc["y"]
    assert told["error"] == pytest.approx(0.01 / np.sqrt(2), rel=0.02)
    assert told["factor"] == pytest.approx(1.0, rel=0.01)


@given(st.floats(0.01, 100))
def test_the_factor_between_signals_of_one_course(factor):
    x = np.sin(T)
    assert factor_of(factor * x, x) == pytest.approx(factor)
    assert factor_of(-factor * x, x) == pytest.approx(-factor)
    assert factor_of(np.cos(40 * T), x) is None
    assert factor_of(factor * x, np.cos(40 * T), x) == pytest.approx(factor)


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.13, "130 ms"), (4.2, "4 s"), (300, "5 min"), (7200, "2 h")]
)
def test_durations(seconds, words):
    assert duration(seconds) == words


def test_inspecting_an_fmu_tells_what_is_missing(tmp_path):
    said = repr(inspect(foreign_builder(tmp_path)()))
    assert "whether it can be used: railfmi check" in said
    assert "state" in said


# --- folders and conversions


def test_a_command_says_what_it_replaces(tmp_path, capsys):
    will_write(tmp_path)
    say_notices()
    assert capsys.readouterr().err == ""
    (tmp_path / "result.json").write_text("{}")
    will_write(tmp_path)
    say_notices()
    assert "held earlier results (result.json, of 2" in capsys.readouterr().err.replace("\n", " ")


def test_files_that_are_not_complete_are_no_earlier_results(tmp_path):
    (tmp_path / f"{WRITING}1_x").mkdir()
    (tmp_path / f"{WRITING}1_x" / "result.json").write_text("{}")
    assert replaced(tmp_path) == ""
    (tmp_path / "plan.json").write_text("{}")
    assert "(plan.json, of 2" in replaced(tmp_path)


@pytest.mark.parametrize("code", [0, 1, 130])
def test_an_interrupted_command_does_not_say_that_it_replaced_results(tmp_path, monkeypatch, capsys, code):
    def command(_arguments, standalone_mode):
        will_write(tmp_path)
        return interrupted("nothing is kept").exit_code if code == 130 else code

    (tmp_path / "result.json").write_text("{}")
    monkeypatch.setattr("scenarios.cli.app.loaded", lambda _: command)
    assert run_safely([]) == code
    assert ("were replaced" in capsys.readouterr().err.replace("\n", " ")) == (code != 130)


def test_each_command_has_a_folder_of_its_own():
    from inspect import signature

    from scenarios.cli import (
        bifurcation,
        close_loop,
        compare,
        conicity,
        conicity_norm,
        estimate,
        import_ssp,
        inspect,
        plan,
        row,
        run,
        wear,
    )

    modules = [
        close_loop.close_loop, estimate.estimate, compare.compare, row.rebuild, run.run_scenarios,
        import_ssp.import_package, plan.plan, inspect.inspect, conicity.conicity, conicity_norm.conicity_norm,
        bifurcation.bifurcation, wear.wear,
    ]  # fmt: skip
    folders = [str(signature(command).parameters["out"].default) for command in modules]
    assert len(set(folders)) == len(folders)
    assert all(folder.startswith("out/") for folder in folders)
