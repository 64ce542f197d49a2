"""Read a scenario and its variants from a file; any error is a BadInput of one line."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.validation import of_file, read_table, read_toml
from scenarios.simulating.declaration import Declaration

KEPT = ("id", "question", "expect", "figure", "variants")  # the same for all variants
SINGLE = "run"  # name of the only variant if none is declared
RESERVED = ("sensors", "contact", "pi", "e")


@dataclass(frozen=True)
class Scenario:
    """A scenario with its variants by name; its paths are relative to the folder of its file."""

    file: Path
    declared: Declaration
    variants: Mapping[str, Declaration]

    @property
    def id(self) -> str:
        """The name of the scenario."""
        return self.declared.id


def load_scenario(path: str | Path) -> Scenario:
    """Read the scenario in a file; a BadInput names the file, the key and the way out."""
    file = Path(path).absolute()  # an FMU may change the working directory
    with of_file(file):
        table = read_toml(file, "a scenario")
        declared = read_table(Declaration, table)
        scenario = Scenario(file, declared, _variants(table, declared))
        _check_variants_named(scenario)
    return scenario


def _variants(table: Mapping[str, Any], declared: Declaration) -> dict[str, Declaration]:
    """The declaration of each variant; keys that it does not give are those of the base."""
    if not declared.variants:
        return {SINGLE: declared}
    found: dict[str, Declaration] = {}
    base = {key: value for key, value in table.items() if key != "variants"}
    for i, changes in enumerate(declared.variants):
        name = _name(changes, f"variants[{i}]", found, declared)
        rest = {key: value for key, value in changes.items() if key != "name"}
        try:
            found[name] = read_table(Declaration, merged(base, rest))
        except BadInput as error:
            raise BadInput(f"variant '{name}': {error}") from error
    return found


def _name(changes: Mapping[str, Any], key: str, found: Mapping[str, Any], declared: Declaration) -> str:
    name = changes.get("name")
    if name is None:
        raise BadInput(f"key '{key}.name' is missing")
    if not isinstance(name, str) or not name.isidentifier():
        raise BadInput(f"key '{key}.name' must be a name of letters, digits and _, not {name!r}")
    if name in found or name in declared.fmus or name in RESERVED:
        raise BadInput(f"key '{key}.name' = '{name}' is in use already; take another one")
    for kept in KEPT:
        if kept in changes:
            raise BadInput(f"key '{key}.{kept}' cannot differ between variants; move it to the scenario")
    return name


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Merge tables key by key; values that are not tables are replaced."""
    made = dict(base)
    for key, value in changes.items():
        old = made.get(key)
        both = isinstance(old, Mapping) and isinstance(value, Mapping)
        made[key] = merged(old, value) if both else value  # type: ignore[arg-type]  # both are mappings
    return made


def _check_variants_named(scenario: Scenario) -> None:
    """Raise BadInput if an expectation or a panel names a variant that does not exist."""
    d = scenario.declared
    named = [(f"expect[{i}]", e.variants) for i, e in enumerate(d.expect)]
    named += [
        (f"figure[{i}].panels[{j}]", panel.variants)
        for i, picture in enumerate(d.figure)
        for j, panel in enumerate(picture.panels)
    ]
    for key, names in named:
        for name in names:
            if name not in scenario.variants:
                near = did_you_mean(name, scenario.variants)
                raise BadInput(f"key '{key}.variants': there is no variant '{name}'; {near}")
