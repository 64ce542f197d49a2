"""An FMU that is no function of what is set in it is refused before anything is estimated from it."""

import pytest

from fmus.errors import BadInput
from fmus.host.apart.isolation import ISOLATED
from fmus.host.grading import honest
from scenarios.cli.app import run_safely
from tests.helpers.misbehaving import Fault, bad_fmu

WRONG = {
    "random": "a run from the same start values does not repeat",
    "survives": "a run from the same start values does not repeat",
    "hidden": "it has a hidden state",
    "shared": "instances influence each other",
}


COMMANDS = ("estimate", "close-loop", "close-loop --dry-run", "plan")


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(honest, "folder", lambda: tmp_path / "cache")
    return tmp_path / "cache"


@pytest.mark.parametrize("what", WRONG)
@pytest.mark.parametrize("command", COMMANDS)
def test_it_is_refused_in_one_line(command, what, own_cache, tmp_path, tmp_path_factory, capfd):
    bad_fmu(tmp_path, Fault(what, "none", ""), tmp_path_factory.mktemp("library"))
    assert (
        run_safely([*command.split(), str(tmp_path / "experiment.toml"), "--out", str(tmp_path / "out")]) == 2
    )
    [line] = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    assert WRONG[what] in line
    assert "bad.fmu" in line
    assert "railfmi check" in line


@pytest.mark.parametrize(("what", "objection"), [("none", ""), ("nan", ""), ("hidden", "hidden state")])
def test_the_outcome_is_kept_by_content(what, objection, own_cache, tmp_path, tmp_path_factory, monkeypatch):
    path = bad_fmu(tmp_path, Fault(what, "none", ""), tmp_path_factory.mktemp("library"))
    said = []
    for _ in range(2):
        try:
            honest.check_honest(path, ISOLATED)
        except BadInput as error:
            said.append(str(error))
        monkeypatch.setattr(honest, "TRIED", ())  # nothing is tried the second time
    assert len(list(own_cache.iterdir())) == 1
    assert len(said) == (2 if objection else 0)
    assert all(objection in line for line in said)


def test_a_damaged_cache_is_tried_again(own_cache, tmp_path, tmp_path_factory):
    path = bad_fmu(tmp_path, Fault("hidden", "none", ""), tmp_path_factory.mktemp("library"))
    with pytest.raises(BadInput, match="hidden state"):
        honest.check_honest(path, ISOLATED)
    [file] = own_cache.iterdir()
    file.write_text("[")
    with pytest.raises(BadInput, match="hidden state"):
        honest.check_honest(path, ISOLATED)
