"""Python in the documents: what it imports is there, and each block runs as it is printed.

The pages whose blocks other tests run are named with these tests.
"""

import ast
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from shutil import copy

import numpy as np
import pytest

from fmus.export.builders.pythonfmu import build_python
from fmus.model import Model
from fmus.testrig.model import Testrig
from fmus.variables import Input, Parameter, State
from tests.contracts.test_documents import DOCUMENTS, ids
from tests.helpers.paths import ROOT, SHIPPED
from tests.helpers.profile_files import points_of, write_points

BLOCK = re.compile(r"```python\n(.*?)```", re.S)
RUN_ELSEWHERE = {
    "README.md": "test_readme", "docs/tutorial.md": "test_tutorial",
    "docs/extending.md": "test_extending_page", "docs/several.md": "test_close_loops",
    "docs/master.md": "test_master_parts", "docs/track.md": "test_track", "docs/sensors.md": "test_track",
}  # fmt: skip
OURS = ("railfmi", "scenarios", "estimator", "fmus")


class VanDerPol(Model):
    """x0'' = mu (1 - x0²) x0' - x0 + u."""

    name = "VanDerPol"
    step_size = 1e-2

    x0 = State("m", 2.0, doc="displacement")
    x1 = State("m/s", doc="its rate")
    u = Input("m/s2", doc="input")
    mu = Parameter("1/s", 1.5, min=0.0, max=10.0, doc="damping", source="the tests")

    def derivatives(m):
        return {"x0": m.x1, "x1": m.mu * (1 - m.x0**2) * m.x1 - m.x0 + m.u}


def rig(folder: Path) -> None:
    """The test rig's FMU, in the folder where the pages build it and beside it."""
    copy(build_python(Testrig(), folder / "build"), folder)


def profiles(folder: Path) -> None:
    """Measured points of wheels under the names of the pages."""
    for name in ("worn", "left", "right"):
        points = points_of("S1002", 400, np.random.default_rng(2), noise=5e-6)
        write_points(folder / f"{name}.txt", points)


def demo(name: str) -> Callable[[Path], None]:
    """A shipped experiment as that of the page."""

    def copied(folder: Path) -> None:
        for file in (SHIPPED / "demo" / name).iterdir():
            copy(file, folder)

    return copied


def fleet(folder: Path) -> None:
    """The shipped fleet."""
    for file in (SHIPPED / "fleet").iterdir():
        if file.is_file():
            copy(file, folder)
    (folder / "records").symlink_to(SHIPPED / "fleet" / "records")


def campaign(folder: Path) -> None:
    """The shipped campaign, which names its scenario by a path from its folder."""
    text = (SHIPPED / "campaign" / "settling.toml").read_text(encoding="utf-8")
    (folder / "settling.toml").write_text(text.replace("../", f"{SHIPPED}/"), encoding="utf-8")


def estimates(folder: Path) -> None:
    """The experiment of the page on estimates, and the FMU of its filters."""
    demo("rig-friction")(folder)
    build_python(VanDerPol(), folder)


def nothing(folder: Path) -> None:
    """A folder without anything."""


# what a reader has before he begins with a page; slow: its blocks compile or take minutes
BEFORE: dict[str, tuple[Callable[[Path], None], bool]] = {
    "docs/campaign.md": (campaign, True),
    "docs/estimate.md": (estimates, False),
    "docs/exchange.md": (rig, True),
    "docs/fleet.md": (fleet, True),
    "docs/native.md": (nothing, True),
    "docs/other-tools.md": (rig, False),
    "docs/plan.md": (demo("rig-drag"), True),
    "docs/rows.md": (nothing, True),
    "docs/scenarios.md": (nothing, True),
    "fmus/bogie/README.md": (profiles, False),
    "fmus/contact/README.md": (nothing, False),
    "fmus/contact/geometry/README.md": (profiles, False),
    "fmus/wheelset/README.md": (profiles, False),
}
ORDER = {"docs/estimate.md": (0, 2, 1, 3)}  # the second block works on the system of the third
PAGES = [page for page in DOCUMENTS if BLOCK.search(page.read_text(encoding="utf-8"))]


def blocks(page: Path) -> list[str]:
    """The blocks of Python on a page."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def imported(code: str) -> Iterator[tuple[str, str]]:
    """Modules of railfmi that a block imports, each with a name that it takes from there, or none."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom) and str(node.module).partition(".")[0] in OURS:
            yield from ((str(node.module), alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((a.name, "") for a in node.names if a.name.partition(".")[0] in OURS)


def test_every_page_with_python_has_a_test_that_runs_it():
    assert {*map(ids, PAGES)} == {*BEFORE, *RUN_ELSEWHERE}
    files = {file.stem for file in (ROOT / "tests").rglob("test_*.py")}
    assert {*RUN_ELSEWHERE.values()} <= files


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_what_a_page_imports_is_there(page: Path) -> None:
    for code in blocks(page):
        for module, name in imported(code):
            assert hasattr(import_module(module), name or "__name__"), f"{ids(page)}: {module}.{name}"


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(ROOT / name, id=name, marks=[pytest.mark.slow] if slow else [])
        for name, (_, slow) in BEFORE.items()
    ],
)
def test_the_python_of_a_page_runs_as_printed(page: Path, tmp_path: Path, monkeypatch) -> None:
    """The blocks share their names, as for a reader; those of a library that is not here are left out."""
    before, _ = BEFORE[ids(page)]
    before(tmp_path)
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "shipped").symlink_to(SHIPPED)
    monkeypatch.chdir(tmp_path)
    code = blocks(page)
    space = {"__name__": "__main__", "np": np, "record": [(np.zeros(1), np.array([2.0]))] * 5}
    for i in ORDER.get(ids(page), range(len(code))):
        if "ecospy" in code[i] and not find_spec("ecospy"):
            continue
        exec(compile(code[i], f"{ids(page)}, block {i + 1}", "exec"), space)
