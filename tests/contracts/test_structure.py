"""The house: imports go one way, no room is entered by two doors, and what decides stands in the policy."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from tests.helpers.paths import ROOT

PACKAGES = ("fmus", "estimator", "scenarios", "railfmi")  # each may import those before it
FILES = [file for package in PACKAGES for file in sorted((ROOT / package).rglob("*.py"))]
CLOSELOOP = ROOT / "estimator" / "closeloop"
ROOMS = [  # of closeloop, each may import those before it
    "policy", "question", "hypotheses", "fitting", "screening", "detection", "decision", "search",
    "diagnostics", "planning", "several",
]  # fmt: skip
# in a comparison that decides: nothing, one, a pair, a half of a sum of squares, a sign, a tiny divisor
FREE = {0, 1, -1, 2, 0.5, 1e-300}


def name_of(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(file): file for file in FILES}


def imported(file: Path) -> Iterator[str]:
    """Modules of ours that a file imports, also within functions."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in MODULES else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize("file", FILES, ids=name_of)
def test_packages_import_those_below_them_alone(file):
    own = PACKAGES.index(name_of(file).split(".")[0])
    for module in imported(file):
        top = module.split(".")[0]
        assert top not in PACKAGES or PACKAGES.index(top) <= own, module
        assert top not in ("tests", "benchmarks"), module


def room(module: str) -> str:
    """The folder of a module: two deep, three in closeloop."""
    return ".".join(module.split(".")[: 3 if module.startswith("estimator.closeloop") else 2])


def test_no_folder_imports_one_that_imports_it():
    arrows: dict[str, set[str]] = defaultdict(set)
    for name, file in MODULES.items():
        ours = (m for m in imported(file) if m.split(".")[0] in PACKAGES)
        arrows[room(name)] |= {room(m) for m in ours} - {room(name)}
    assert list(TopologicalSorter(arrows).static_order())  # raises where there is a circle


@pytest.mark.parametrize("at", range(len(ROOMS)), ids=ROOMS)
def test_rooms_of_closeloop_import_those_before_them(at):
    allowed = {f"estimator.closeloop.{r}" for r in ROOMS[: at + 1]}
    for file in (CLOSELOOP / ROOMS[at]).glob("*.py"):
        rooms = {room(m) for m in imported(file) if m.startswith("estimator.closeloop.")}
        assert {r for r in rooms if r.rpartition(".")[2] in ROOMS} <= allowed, file.name


def constants(file: Path) -> Iterator[str]:
    """Names of the numbers that a module gives a name."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                yield from (n.id for n in names if isinstance(n, ast.Name) and n.id.isupper())


DECIDING = sorted(f for name in ("detection", "decision") for f in (CLOSELOOP / name).glob("*.py"))


@pytest.mark.parametrize("file", DECIDING, ids=lambda f: f.stem)
def test_no_number_that_decides_stands_outside_the_policy(file):
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            numbers = [n.value for n in ast.walk(node) if isinstance(n, ast.Constant)]
            numbers = [n for n in numbers if isinstance(n, int | float) and not isinstance(n, bool)]
            assert set(numbers) <= FREE, f"{file.name}:{node.lineno}"


@pytest.mark.parametrize(("name", "most"), [("detection", 200), ("decision", 600)])
def test_the_decision_can_be_read_in_one_sitting(name, most):
    lines = [len(f.read_text(encoding="utf-8").splitlines()) for f in (CLOSELOOP / name).glob("*.py")]
    assert sum(lines) <= most


def test_what_decides_does_not_grow():
    assert sum(len(f.read_text(encoding="utf-8").splitlines()) for f in DECIDING) <= 780


def test_no_two_constants_of_closeloop_share_a_name():
    homes: dict[str, list[str]] = defaultdict(list)
    for file in sorted(CLOSELOOP.rglob("*.py")):
        for name in constants(file):
            homes[name].append(file.name)
    assert {name: files for name, files in homes.items() if len(files) > 1} == {}
