"""Experiment files: what is read, and that whatever is wrong with them is said in one line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.errors import BadInput
from scenarios.experiment.experiment import Experiment, check_names, load_experiment
from tests.helpers.experiment_files import (
    GOOD,
    RIG,
    assert_one_clear_line,
    write,
)


def test_a_good_file_says_what_it_says(tmp_path):
    e = load_experiment(write(tmp_path))
    assert e.folder == e.data_dir == tmp_path
    assert e.fmu_path == tmp_path / "Testrig.fmu"
    assert e.data_files == (tmp_path / "data.csv",)
    assert e.calibrate == {"mu0": (0.3, 0.5)}
    assert e.inputs == {"T_P": "torque", "f_sync": 7.5}
    assert e.ports[0].force == "T_w_ext"
    assert e.estimate.inputs["T_w_ext"].frequency == 0.5
    check_names(e, RIG)


def test_experiment_is_frozen(tmp_path):
    e: Experiment = load_experiment(write(tmp_path))
    with pytest.raises(ValueError, match="frozen"):
        e.id = "other"


# the wrong edit of the good file, and words the message must hold
BAD_EXPERIMENTS = [
    ("[calibrate]", "[calibrat]", "key 'calibrat' is not known; did you mean 'calibrate'?"),
    ("identify = ", "identfy = ", "key 'split.identfy' is not known; did you mean 'identify'?"),
    (
        'column = "n_wheel"',
        'colum = "n_wheel"',
        "'outputs.omega_w.colum' is not known; did you mean 'column'?",
    ),
    ('force = "T_w_ext"', 'forse = "T_w_ext"', "'ports[0].forse' is not known; did you mean 'force'?"),
    ("std = 10.0, ", "sdt = 10.0, ", "'estimate.inputs.T_w_ext.sdt' is not known; did you mean 'std'?"),
    ('time = "time"', "", "key 'time' is missing"),
    ('data = "data.csv"', "", "key 'data' is missing"),
    ('unit = "rpm"', "", "key 'outputs.omega_w.unit' is missing"),
    ('id = "rig"', "id = 3", "key 'id' must be a string, not '3'"),
    ('id = "rig"', "id = ", "is not valid TOML: Invalid value (at line 1, column 6)"),
    ('id = "rig"', 'id = "rig"\nid = "rig"', "at line 2"),
    ('fmu = "Testrig.fmu"', "", "exactly one of the keys 'model' and 'fmu'"),
    ('fmu = "Testrig.fmu"', 'fmu = "a.fmu"\nmodel = "testrig"', "exactly one of the keys 'model' and 'fmu'"),
    ("[parameters]", "[parameters]\nr_w = '0.3'", "key 'parameters.r_w' must be a number, not '0.3'"),
    ("J_w = 17.86", "J_w = true", "key 'parameters.J_w' must be a number"),
    ("J_w = 17.86", "J_w = nan", "key 'parameters.J_w' must be a finite number"),
    (
        "mu0 = [0.3, 0.5]",
        "mu0 = [0.5, 0.3]",
        "key 'calibrate.mu0' must increase, [lower, upper], not [0.5, 0.3]",
    ),
    ("mu0 = [0.3, 0.5]", "mu0 = 0.3", "key 'calibrate.mu0' must be two numbers [lower, upper], not 0.3"),
    ("[6.0, 10.0]", "[5.0, 10.0]", "[split] 'identify' and 'test' overlap from 5 s to 6 s"),
    ("[6.0, 10.0]", "[10.0, 6.0]", "key 'split.test' must increase"),
    ("test = [6.0, 10.0]", "", "[split] needs either 'identify' and 'test', or 'identify_data'"),
    ("f_sync = 7.5", "f_sync = true", "key 'inputs.f_sync' must be a column name in quotes or a number"),
    ("noise_std = 0.3", "noise_std = 0", "key 'outputs.omega_w.noise_std' must be greater than 0, not '0'"),
    (
        'T_P = "torque"',
        'T_P = {column = "torque", noise_std = -1.0}',
        "key 'inputs.T_P.noise_std' must be greater than 0, not '-1.0'",
    ),
    (
        'derivative = "omega"',
        'derivative = "accel"',
        "[derived.accel] derivative 'accel' must be declared above",
    ),
    ("start = 0.4", "start = 0.9", "[estimate.parameters.mu0] start 0.9 is outside its bounds"),
    (
        "[estimate]",
        "[[ports]]\nname = 'wheel'\nforce = 'a'\nvelocity = 'b'\ndisplacement = 'c'\n[estimate]",
        "twice",
    ),
    ('displacement = "theta_w"', 'displacement = "theta_w"\nintegrate = true', "leave one of the two out"),
    ("[parameters]", "[parameters", "is not valid TOML"),
    ('id = "rig"', 'idd = "rig"\ntme = 3', "key 'idd' is not known; did you mean 'id'? (and 2 more)"),
    ('id = "rig"', '"i\\nd" = "rig"', "key 'i d' is not known; did you mean 'id'?"),
    ("test = [6.0, 10.0]", "test_data = 'b.csv'", "[split] needs either 'identify' and 'test'"),
    (
        "identify = [0.0, 6.0]\ntest = [6.0, 10.0]",
        "identify_data = 'a.csv'\ntest_data = 'b.csv'",
        "key 'data' beside [split] identify_data and test_data; leave one of the two out",
    ),
    ("T_P = ", "T_w_ext = ", "'T_w_ext' stands in [inputs] and in [estimate.inputs]"),
]

BAD_NAMES = [
    ("T_P = ", "T_p = ", "[inputs] 'T_p' is not an input of Testrig; did you mean 'T_P'?"),
    ("[outputs.omega_w]", "[outputs.omega]", "[outputs] 'omega' is not an output of Testrig; did you mean"),
    ("[outputs.omega_w]", "[outputs.T_P]", "'T_P' of Testrig is not an output (it is of causality input)"),
    ("J_w = 17.86", "Jw = 17.86", "[parameters] 'Jw' is not a parameter of Testrig; did you mean 'J_w'?"),
    (
        "mu0 = [0.3, 0.5]",
        "mu = [0.3, 0.5]",
        "[calibrate] 'mu' is not a parameter of Testrig; did you mean 'mu0'",
    ),
    ("omega_w = 12", "omega_w_dot = 12", "[initial] 'omega_w_dot' of Testrig is not a state"),
    ('force = "T_w_ext"', 'force = "T_w"', "[[ports]] 'wheel' force 'T_w' is not an input of Testrig"),
    ('displacement = "theta_w"', 'displacement = "theta"', "did you mean 'theta_w'?"),
    ('states = ["omega_w"]', 'states = ["mu0"]', "[estimate] states 'mu0' of Testrig is not an output"),
    ("parameters.mu0 =", "parameters.mu1 =", "[estimate.parameters] 'mu1'"),
    ("frequency = 0.5", "frequency = 0.5, rate_input = 'x'", "[estimate.inputs] rate_input 'x'"),
    ("J_w = 17.86", "J_w = 0.0", "[parameters] J_w = 0 is outside the FMU's limits 1e-06 to inf"),
    ("f_sync = 7.5", "f_sync = -7.5", "[inputs] f_sync = -7.5 is outside the FMU's limits 0 to inf"),
    (
        "mu0 = [0.3, 0.5]",
        "mu0 = [0.3, 2.5]",
        "[calibrate] mu0 = [0.3, 2.5] is outside the FMU's limits 0 to 2",
    ),
    ("mu0 = 0.4", "mu0 = 0.6", "leaves out the declared value 0.6; widen the bounds"),
    (
        "bounds = [0.1, 0.6]",
        "bounds = [-0.1, 0.6]",
        "[estimate.parameters] mu0 bounds = [-0.1, 0.6] is outside",
    ),
]


@pytest.mark.parametrize(("good", "bad", "words"), BAD_EXPERIMENTS)
def test_bad_experiment_files(tmp_path, good, bad, words):
    assert good in GOOD
    file = write(tmp_path, GOOD.replace(good, bad, 1))
    with pytest.raises(BadInput) as refused:
        load_experiment(file)
    assert_one_clear_line(refused, file, words)


@pytest.mark.parametrize(("good", "bad", "words"), BAD_NAMES)
def test_names_and_values_against_the_fmu(tmp_path, good, bad, words):
    assert good in GOOD
    file = write(tmp_path, GOOD.replace(good, bad, 1))
    with pytest.raises(BadInput) as refused:
        check_names(load_experiment(file), RIG)
    assert_one_clear_line(refused, file, words)


@pytest.mark.parametrize(
    ("content", "words"), [(None, "cannot be read (No such file"), (b"id = \xff", "is not UTF-8 text")]
)
def test_unreadable_experiment_files(tmp_path, content, words):
    file = tmp_path / "experiment.toml"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(BadInput) as refused:
        load_experiment(file)
    assert_one_clear_line(refused, file, words)


def test_an_unknown_model_is_named_with_the_nearest(tmp_path):
    toml = GOOD[: GOOD.index("[[ports]]")].replace('fmu = "Testrig.fmu"', 'model = "testrg"')
    with pytest.raises(BadInput, match="key 'model': model 'testrg' is not known; did you mean 'testrig'"):
        load_experiment(write(tmp_path, toml))


def test_ports_are_for_foreign_fmus(tmp_path):
    file = write(tmp_path, GOOD.replace('fmu = "Testrig.fmu"', 'model = "testrig"'))
    with pytest.raises(BadInput, match="for a foreign 'fmu' only"):
        load_experiment(file)


@given(st.binary(max_size=60))
def test_any_bytes_are_an_experiment_or_bad_input(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "any.toml"
    file.write_bytes(content)
    with pytest.raises(BadInput) as refused:
        load_experiment(file)
    assert "\n" not in str(refused.value)
