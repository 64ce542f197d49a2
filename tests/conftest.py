"""FMUs built once for all tests, and examples without a time limit."""

import fcntl
import os
import pickle
import shutil
import signal
from collections.abc import Callable, Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

import pytest
from hypothesis import settings

from fmus.effects import parse_effect
from fmus.export.builders.pythonfmu import build_python
from fmus.models import model_class
from scenarios import close_loop
from scenarios.cli import voice
from scenarios.closing.result import Result
from tests.helpers.everything import fitting
from tests.helpers.foreign import foreign_builder
from tests.helpers.kinds import build_kinds
from tests.helpers.paths import SHIPPED
from tests.helpers.vdp import build_vdp

settings.register_profile("railfmi", deadline=None)  # a busy machine is no failure
settings.register_profile("same-draws", settings.get_profile("railfmi"), derandomize=True)
settings.load_profile("same-draws")  # one tree, one result; `make test-all` draws anew

DEMO = SHIPPED / "demo" / "rig-drag"
Built = Callable[..., Path]
Made = TypeVar("Made")


def once(place: Path, make: Callable[[], Made]) -> Made:
    """What `make` makes in the folder `place`, made by one of the processes of a run for all of them."""
    place.mkdir(parents=True, exist_ok=True)
    kept = place.with_suffix(".pickle")
    with place.with_suffix(".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if not kept.exists():
            kept.write_bytes(pickle.dumps(make()))
    made: Made = pickle.loads(kept.read_bytes())
    return made


@pytest.fixture(autouse=True)
def no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """No lines of progress beside what a command says: whether there are any depends on the machine."""
    monkeypatch.setattr(voice, "PATIENCE", 1e9)


@pytest.fixture(scope="session")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of all processes of this run together."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(scope="session", autouse=True)
def cache_of_its_own(whole_run: Path) -> Iterator[None]:
    """What is computed once is kept for this run alone, by all of its processes together."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(whole_run / "cache"))
        yield


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C interrupts, also where the tests were started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def built(whole_run: Path) -> Built:
    """built(model, "kind@location", ...) is the path of that FMU; "all" stands for every effect that fits."""

    @cache
    def build(name: str, *effects: str) -> Path:
        place = whole_run / "built" / sha256(repr((name, effects)).encode()).hexdigest()
        chosen = fitting(name) if effects == ("all",) else map(parse_effect, effects)
        return once(place, lambda: build_python(model_class(name)(chosen), place))

    return build


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """foreign(body of do_step, more of the class) is the path of an FMU made with PythonFMU alone."""
    return foreign_builder(tmp_path_factory.mktemp("foreign"))


@pytest.fixture(scope="session")
def vdp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The path of an FMI 3.0 FMU compiled from C."""
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("no C compiler 'cc' here to make an FMI 3.0 FMU with")
    return build_vdp(compiler, tmp_path_factory.mktemp("vdp"))


@pytest.fixture(scope="session")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Paths of FMUs with whole numbers, truths and, by FMI 3.0, arrays, by the version of FMI."""
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("no C compiler 'cc' here to make FMUs with")
    return {fmi: build_kinds(compiler, tmp_path_factory.mktemp("kinds"), f"kinds_fmi{fmi}") for fmi in (2, 3)}


@pytest.fixture(scope="session")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The path of an FMU for model exchange alone, with events of state and time."""
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("no C compiler 'cc' here to make an FMU for model exchange with")
    return build_kinds(compiler, tmp_path_factory.mktemp("ball"), "events_fmi3")


@pytest.fixture(scope="session")
def demo(whole_run: Path) -> tuple[Result, Path]:
    """The bundled record, closed once, and the folder of its report."""
    out = whole_run / "demo"
    return once(out, lambda: close_loop(DEMO, out, jobs=1)), out
