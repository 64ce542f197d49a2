"""The command line: wrong input gets one clear line and exit code 2, whatever is wrong with it."""

import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from scenarios.cli.app import COMMANDS, NOTHING_FROM_HERE, _told, run_safely
from tests.helpers.misbehaving import Fault, bad_fmu
from tests.helpers.paths import SHIPPED

DEMO = SHIPPED / "demo" / "rig-drag"


def railfmi(*arguments: str | Path) -> int:
    """Exit code of a command line, run in this process."""
    return run_safely([str(a) for a in arguments])


@pytest.fixture
def experiment(tmp_path: Path) -> Path:
    """A copy of the bundled experiment with its first 600 samples, to be spoiled."""
    folder = tmp_path / "spoiled"
    folder.mkdir()
    text = (DEMO / "experiment.toml").read_text()
    text = text.replace("identify = [0.0, 30", "identify = [0.0, 3").replace("test = [30", "test = [3")
    text = text.replace(", 50]", ", 5.9]").replace(", 50.0]", ", 5.9]")
    (folder / "experiment.toml").write_text(text)
    rows = (DEMO / "data.csv").read_text().splitlines()[:601]
    (folder / "data.csv").write_text("\n".join(rows) + "\n")
    return folder


def in_toml(old: str, new: str) -> Callable[[Path], None]:
    """An edit of experiment.toml."""

    def spoil(folder: Path) -> None:
        file = folder / "experiment.toml"
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))

    return spoil


def in_rows(change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    """An edit of the lines of data.csv."""

    def spoil(folder: Path) -> None:
        file = folder / "data.csv"
        file.write_text("\n".join(change(file.read_text().splitlines())) + "\n")

    return spoil


def without_values(first: int, last: int) -> Callable[[list[str]], list[str]]:
    """Blank the last column of some rows."""

    def change(rows: list[str]) -> list[str]:
        gone = [r.rsplit(",", 1)[0] + "," for r in rows[first:last]]
        return [*rows[:first], *gone, *rows[last:]]

    return change


def corrupt_fmu(folder: Path) -> None:
    """A foreign FMU that is no zip file."""
    (folder / "x.fmu").write_bytes(b"PK\x03\x04 broken")
    in_toml('model = "testrig"', 'fmu = "x.fmu"')(folder)


def escaping_fmu(folder: Path) -> None:
    """A foreign FMU with a path that leads out of it."""
    with zipfile.ZipFile(folder / "x.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", "<fmiModelDescription/>")
        packed.writestr("../../outside.txt", "no")
    in_toml('model = "testrig"', 'fmu = "x.fmu"')(folder)


def other_platform(folder: Path) -> None:
    """A foreign FMU whose only binary is for a machine that is not this one."""
    xml = (
        '<fmiModelDescription fmiVersion="2.0" modelName="x" guid="1"><CoSimulation modelIdentifier="x"/>'
        "<ModelVariables/><ModelStructure/></fmiModelDescription>"
    )
    with zipfile.ZipFile(folder / "x.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", xml)
        packed.writestr("binaries/vax/x.so", "no")
    in_toml('model = "testrig"', 'fmu = "x.fmu"')(folder)


WRONG: dict[str, tuple[Callable[[Path], None], list[str]]] = {
    "no experiment file": (lambda f: (f / "experiment.toml").unlink(), ["experiment.toml", "cannot be read"]),
    "no data file": (lambda f: (f / "data.csv").unlink(), ["data.csv"]),
    "broken TOML": (in_toml("[split]", "[split"), ["experiment.toml", "not valid TOML"]),
    "unknown key": (in_toml("[calibrate]", "[calibrat]"), ["calibrat", "did you mean 'calibrate'?"]),
    "unknown model": (in_toml('"testrig"', '"testrgi"'), ["testrgi", "did you mean 'testrig'?"]),
    "FMU is missing": (in_toml('model = "testrig"', 'fmu = "gone.fmu"'), ["gone.fmu", "no such FMU"]),
    "FMU is corrupt": (corrupt_fmu, ["x.fmu", "not a readable zip"]),
    "FMU leads outside": (escaping_fmu, ["x.fmu", "leads outside"]),
    "FMU for another platform": (other_platform, ["x.fmu", "no binary for this platform", "vax"]),
    "unknown output": (in_toml("[outputs.omega_w]", "[outputs.omega]"), ["'omega'", "did you mean 'omega_"]),
    "output that is an input": (in_toml("[outputs.omega_w]", "[outputs.T_P]"), ["T_P", "not an output"]),
    "unknown parameter": (in_toml("J_w = ", "J_v = "), ["J_v", "did you mean"]),
    "parameter out of range": (in_toml("mu0 = 0.4", "mu0 = -0.4"), ["mu0", "-0.4"]),
    "bounds turned round": (in_toml("mu0 = [0.3, 0.5]", "mu0 = [0.5, 0.3]"), ["mu0", "increase"]),
    "unknown column": (in_toml('column = "omega_w"', 'column = "omega_v"'), ["omega_v", "did you mean"]),
    "unknown unit": (in_toml('unit = "rad/s"', 'unit = "rad/sec"'), ["rad/sec"]),
    "unit of another kind": (in_toml('unit = "rad/s"', 'unit = "m/s"'), ["m/s", "rad/s"]),
    "hertz for rad/s": (in_toml('unit = "rad/s"', 'unit = "Hz"'), ["Hz", "2 pi"]),
    "split outside the record": (in_toml("test = [3", "test = [300"), ["test"]),
    "no split": (in_toml("[split]", "[split_off]"), ["split"]),
    "a block of blanks": (
        in_rows(without_values(100, 140)),
        ["data.csv", "outputs have no number in 40 of 591 rows"],
    ),
    "time goes back": (in_rows(lambda r: [*r[:50], r[40], *r[50:]]), ["data.csv", "time", "increas"]),
    "a gap": (in_rows(lambda r: [*r[:200], *r[260:]]), ["data.csv"]),
    "a word in a cell": (in_rows(lambda r: [*r[:9], r[9].replace(",", ",oops", 1), *r[10:]]), ["data.csv"]),
    "an empty file": (in_rows(lambda _: []), ["data.csv"]),
    "too few samples": (in_rows(lambda r: r[:40]), ["data.csv"]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_input_gets_one_line_and_exit_2(
    wrong: str, experiment: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil, words = WRONG[wrong]
    spoil(experiment)
    assert railfmi("close-loop", experiment / "experiment.toml", "--out", tmp_path / "out") == 2
    said = capfd.readouterr()
    lines = [line for line in (said.out + said.err).splitlines() if line.strip()]
    assert len(lines) == 1, lines
    assert lines[0].startswith("railfmi: ")
    assert "Traceback" not in lines[0]
    for word in words:
        assert word in lines[0], lines[0]
    assert not (tmp_path / "out").exists(), "nothing may be half-written"


USAGE = {
    "unknown command": (["buidl"], "buidl"),
    "unknown model": (["build", "testrgi"], "did you mean 'testrig'?"),
    "unknown effect": (["build", "testrig", "--effect", "viscos_damping@roller"], "viscous_damping"),
    "effect without a place": (["build", "testrig", "--effect", "viscous_damping"], "KIND@LOCATION"),
    "unknown place": (["build", "testrig", "--effect", "viscous_damping@roler"], "did you mean 'roller'?"),
    "effect that makes no sense": (["build", "testrig", "--effect", "cubic_stiffness@wheel"], "no sense"),
    "kind that is not built": (["build", "testrig", "--kind", "steam"], "steam"),
    "FMI version that is not built": (["build", "testrig", "--fmi", "1"], "--fmi 1"),
    "no such FMU": (["check", "gone.fmu"], "gone.fmu"),
    "a number that is none": (["close-loop", "x", "--jobs", "many"], "--jobs"),
    "a seed below zero": (["close-loop", "x", "--seed", "-5"], "--seed"),
    "no such experiment": (["close-loop", "gone"], "railfmi init"),
    "an effect for every model": (["build", "--effect", "viscous_damping@roller"], "name the model"),
    "a branch without length": (
        [
            "bifurcation",
            "x.fmu",
            "--parameter",
            "V",
            "--from",
            "1",
            "--to",
            "2",
            "--output",
            "y",
            "--largest",
            "-1",
        ],
        "--largest",
    ),
    "a folder without tables": (["conicity-norm", "--reference", "gone"], "WheelARailA_conicity.csv"),
    "points without noise": (["conicity-norm", "--smoothing", "0"], "--smoothing"),
    "wheels beside the rails": (
        ["conicity", "--wheel", "S1002", "--rail", "60E1", "--gauge", "1"],
        "never touch",
    ),
}


@pytest.mark.parametrize("wrong", USAGE)
def test_wrong_usage_gets_one_line_and_exit_2(
    wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, word = USAGE[wrong]
    assert railfmi(*arguments) == 2
    said = capfd.readouterr()
    lines = [line for line in (said.out + said.err).splitlines() if line.strip()]
    assert len(lines) == 1, lines
    assert word in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_a_fault_of_railfmi_is_one_line_and_has_an_exit_code_of_its_own(monkeypatch, capfd):
    def fails(*_):
        raise TypeError("not this")

    monkeypatch.setattr("fmus.host.grading.check.grade", fails)
    assert railfmi("check", "x.fmu") == 70
    [line] = capfd.readouterr().err.strip().splitlines()
    assert "TypeError: not this" in line
    assert "please report it" in line
    assert railfmi("check", "x.fmu", "-v") == 70
    assert "Traceback" in capfd.readouterr().err


def test_build_and_check_work_together(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert railfmi("build", "drive", "--effect", "coulomb_friction@carriage", "--out", tmp_path) == 0
    assert railfmi("check", tmp_path / "Drive.fmu") == 0
    assert "FAILED" not in capfd.readouterr().out


@pytest.mark.parametrize("command", ["", "build", "check", "close-loop"])
def test_help_is_there(command: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert railfmi(*filter(None, [command]), "--help") == 0
    assert "Usage" in capfd.readouterr().out


def test_the_installed_command_answers_with_its_exit_code(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "scenarios.cli", "close-loop", str(tmp_path / "nowhere")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "nowhere" in done.stderr


HEAVY = ("casadi", "numpy", "scipy", "pandas", "matplotlib", "fmpy", "fmus.models")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--help"], ["build", "close-loop", "Try an FMU out"]), (["--version"], ["railfmi "]), ([], ["Usage"])],
    ids=["help", "version", "nothing"],
)
def test_help_loads_nothing_that_simulates(arguments, words):
    script = (
        "import sys\n"
        "from scenarios.cli.app import COMMANDS, _told, run_safely\n"
        f"run_safely({arguments!r})\n"
        f"print(*(name for name in {HEAVY!r} if name in sys.modules), file=sys.stderr, end='')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0
    assert all(word in done.stdout for word in words)
    assert done.stderr == ""


def test_the_help_of_a_command_loads_only_what_it_shows():
    script = (
        "import sys\n"
        "from scenarios.cli.app import COMMANDS, run_safely\n"
        "for name in sorted(COMMANDS, key='build'.__eq__):\n"
        "    assert run_safely([name, '--help']) == 0\n"
        f"    print(name, *(n for n in {HEAVY!r} if n in sys.modules), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    loaded = {name: found for name, *found in map(str.split, done.stderr.splitlines())}
    # the options of build are those of the models, whose equations are CasADi's
    assert loaded.pop("build") == ["casadi", "numpy", "fmus.models"]
    assert loaded == {name: [] for name in COMMANDS if name != "build"}


def test_all_commands_are_listed_with_what_they_do():
    for name in COMMANDS:
        assert len(_told(name).split()) > 2, name


def test_a_command_stays_a_command_where_it_is_loaded_alone(capsys):
    assert railfmi("check", "--help") == 0
    assert " check [OPTIONS] {fmu}" in capsys.readouterr().out


FROM_HERE = """
import sys
from joblib import Parallel, delayed
import scenarios.cli.app as app

def command(run, arguments):
    from numba.core import config
    return 10 * bool(config.CACHE_DIR) + sum(Parallel(2)(delayed(abs)(i) for i in (-1, 2)))

app.supervised = command
app.main()
"""


def test_nothing_is_run_that_lies_in_the_working_folder(tmp_path: Path) -> None:
    """It may be that of somebody's data; Python's own workers would import modules from it first."""
    for name in ("joblib", "numpy", "json", "pickle", "scenarios", "fmus"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('run from the working folder')\n")
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: here\n")
    left = {name: value for name, value in os.environ.items() if name not in NOTHING_FROM_HERE}
    done = subprocess.run(
        [sys.executable, "-P", "-c", FROM_HERE], cwd=tmp_path, env=left, capture_output=True, text=True
    )
    assert done.returncode == 3, done.stderr


@pytest.mark.slow
def test_close_loop_runs_nothing_of_the_working_folder(tmp_path: Path, compiled: Path) -> None:
    """As a command in the folder of the record, with workers that import."""
    bad_fmu(tmp_path, Fault("none", "none", ""), compiled)
    for name in ("joblib", "numpy", "scipy", "casadi"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('run from the working folder')\n")
    call = "from scenarios.cli.app import main; main()"
    done = subprocess.run(
        [sys.executable, "-P", "-c", call, "close-loop", "experiment.toml", "--jobs", "2", "--out", "out"],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "result.json").exists()


@pytest.fixture
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for a compiled library."""
    return tmp_path_factory.mktemp("compiled")
