"""Generic code names no model: what a model has of its own is declared in it and asked of it."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from fmus.model import declared
from fmus.models import MODELS
from tests.helpers.paths import ROOT

# the models themselves, the contact that they share, and what is about single models by its subject
OWN = (
    *(f"fmus/{name}/" for name in MODELS),
    "fmus/contact/",
    "scenarios/literature/",
    "scenarios/shipped/",
    "scenarios/conicity/",
    "scenarios/wearing/",
)
GENERIC = {
    path: file
    for package in ("fmus", "estimator", "scenarios")
    for file in sorted((ROOT / package).rglob("*.py"))
    if not (path := file.relative_to(ROOT).as_posix()).startswith(OWN)
}
NAMES = {word.lower() for key, model in MODELS.items() for word in (key, model.__name__, model.name)}
SYMBOL = re.compile(r"[A-Za-z]\d?|mu|nu|phi|psi|omega")  # letters of any formula, and of units
VARIABLES = {v for model in MODELS.values() for v in declared(model) if not SYMBOL.fullmatch(v)}
WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
ALLOWED = {
    ("scenarios/cli/wear.py", "wear"): "the name of a command",
    ("scenarios/reporting/entries.py", "wear"): "the name of a command and of its page",
    ("scenarios/simulating/declaration.py", "patch"): "an argument of fmus.contact.contact_table",
    ("scenarios/simulating/functions.py", "r_left"): "a column of contact_table, for equivalent_conicity",
    ("scenarios/simulating/functions.py", "r_right"): "a column of contact_table, for equivalent_conicity",
}


def words(tree: ast.AST) -> Iterator[str]:
    """Identifiers, and the words of strings that are not docstrings."""
    documents = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            documents |= {id(n.value) for n in node.body[:1] if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant):
            if isinstance(node.value, str | bytes) and id(node) not in documents:
                text = node.value if isinstance(node.value, str) else node.value.decode(errors="replace")
                yield from WORD.findall(text)
        else:
            # id, attr, arg, name, asname, module, names: every field that holds an identifier
            for value in vars(node).values():
                for text in value if isinstance(value, list) else [value]:
                    if isinstance(text, str):
                        yield from WORD.findall(text)


def named(tree: ast.AST) -> set[str]:
    """What of a model some code names: its class, its name, also within a longer one, or a variable."""
    return {w for w in words(tree) if w in VARIABLES or NAMES & {w.lower(), *w.lower().split("_")}}


@pytest.mark.parametrize("path", GENERIC)
def test_generic_code_names_no_model_and_none_of_its_variables(path: str) -> None:
    found = named(ast.parse(GENERIC[path].read_text(encoding="utf-8")))
    assert found == {word for at, word in ALLOWED if at == path}


@pytest.mark.parametrize(
    ("code", "word"),
    [
        ("from fmus.wheelset.track import Track", "wheelset"),
        ("from fmus.models import Wheelset", "Wheelset"),
        ("def wheelset_inputs(): pass", "wheelset_inputs"),
        ("if name == 'vehicle7dof': pass", "vehicle7dof"),
        ("help = 'of the wheelset: the rail'", "wheelset"),
        ("f(mu0=1.0)", "mu0"),
        ("model.omega_w", "omega_w"),
        ("alarms = {'k_A': 0.1}", "k_A"),
        ("text = f'{x} of Testrig'", "Testrig"),
        ("global creep_law", "creep_law"),
    ],
)
def test_a_name_of_a_model_is_found_wherever_it_stands(code: str, word: str) -> None:
    assert named(ast.parse(code)) == {word}


def test_docstrings_and_symbols_may_name_what_they_like() -> None:
    code = 'class A:\n    """As the wheelset."""\n\n    def f(self, y):\n        """Of mu0."""\n'
    assert named(ast.parse(code + "        return y * self.phi\n")) == set()


def test_the_files_that_are_looked_at_are_the_packages() -> None:
    assert Path(ROOT / "fmus" / "model.py") in GENERIC.values()
    assert len(GENERIC) > 200
    assert all(path in GENERIC for path, _ in ALLOWED)
