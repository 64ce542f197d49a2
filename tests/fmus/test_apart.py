"""Free runs in a process of their own: what goes to it and comes back, and that nothing there can be run."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from fmus.codec import Unreadable
from fmus.errors import BadInput
from fmus.export.builders.hypotheses import ModelBuilder
from fmus.host import apart
from fmus.host.apart import FreeRun, simulate_apart
from fmus.host.fmu import Fmu, FmuError
from tests.fmus.test_codec import Harmful

T = np.linspace(0.0, 1.0, 101)
RUN = FreeRun(T, {"F": 50 * np.sin(T)}, {"q": 0.1, "M": 90.0})


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ModelBuilder("drive", tmp_path_factory.mktemp("drive"))(())


def test_a_run_apart_is_that_of_this_process_to_the_bit(drive: Path) -> None:
    found = simulate_apart(drive, [RUN, RUN], ["q", "q_dot"])
    with Fmu(drive) as fmu:
        expected = fmu.simulate(RUN.t, RUN.inputs, ["q", "q_dot"], RUN.start)
    assert len(found) == 2
    for y in found:
        np.testing.assert_array_equal(y, expected, strict=True)


@pytest.mark.parametrize(("kind", "words"), [(BadInput, "no file"), (FmuError, "nor")])
def test_a_refusal_comes_back_as_what_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Exception], words: str
) -> None:
    def refuse(fmu: Path) -> None:
        raise kind(f"{fmu}: {words}")

    monkeypatch.setattr(apart, "Fmu", refuse)

    def here(command: list[str], **_: object) -> object:
        apart.main(command[-1])
        return type("Ended", (), {"returncode": 0})

    monkeypatch.setattr(apart.subprocess, "run", here)
    with pytest.raises(kind, match=f"one.fmu: {words}"):
        simulate_apart(tmp_path / "one.fmu", [RUN], ["q"])


def test_a_planted_question_runs_nothing(tmp_path: Path) -> None:
    mark = tmp_path / "ran"
    for name in ("asked.pickle", apart.ASKED):
        (tmp_path / name).write_bytes(pickle.dumps((Harmful(mark), (), ())))
    with pytest.raises(Unreadable):
        apart.main(str(tmp_path))
    assert not mark.exists()


def test_a_planted_answer_runs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An FMU could write it, as it knows the folder from its process."""
    mark = tmp_path / "ran"

    def plant(command: list[str], **_: object) -> object:
        (Path(command[-1]) / apart.FOUND).write_bytes(pickle.dumps(Harmful(mark)))
        return type("Ended", (), {"returncode": 0})

    monkeypatch.setattr(apart.subprocess, "run", plant)
    with pytest.raises(FmuError, match="brings down the process"):
        simulate_apart(tmp_path / "one.fmu", [RUN], ["q"])
    assert not mark.exists()
