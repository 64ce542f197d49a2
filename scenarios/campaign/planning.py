"""From a campaign file to its tasks: the scenario with other values of some keys, once for each point."""

import tomllib
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fmus.errors import BadInput, did_you_mean
from fmus.host.apart.isolation import Isolation
from scenarios.campaign.declaration import Declaration
from scenarios.campaign.sampling import Point, points_of
from scenarios.experiment.validation import of_file, read_file, read_table, read_toml
from scenarios.simulating.declaration import Declaration as Scenario
from scenarios.simulating.expression import expression
from scenarios.simulating.reading import SINGLE, load_scenario, merged
from scenarios.tasks.hashes import hash_of, hash_of_data, hash_of_file, hash_of_program
from scenarios.tasks.running import Task

NOT_RUN = ("variants", "figure")  # keys of a scenario that a point leaves out
Way = tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """All points of a campaign with their tasks; files: FMUs that workers need, by checksum."""

    file: Path
    declared: Declaration
    points: list[Point]
    tasks: list[Task]
    files: dict[str, Path]


def plan_of(path: str | Path, isolation: Isolation | None) -> Plan:
    """The tasks of a campaign file; raises BadInput for what is wrong in it before any is done."""
    file = Path(path).absolute()
    with of_file(file):
        d = read_file(Declaration, file, "a campaign file")
        for name, text in d.measure.items():
            expression(text, f"key 'measure.{name}'")
        paths = {key: _path(key) for key in (*d.set, *d.vary)}
    scenario = file.parent / d.scenario
    with of_file(file):
        points = points_of(d)
        table = changed(_table(scenario, d.variant, file), d.set, paths)
        for point in points[:1]:
            read_table(Scenario, changed(table, point, paths))
    beside = dict(_files_of(table, scenario.parent))
    fmus = {name: file for name, file in beside.items() if file.suffix == ".fmu"}
    shipped = {hash_of_file(fmu): fmu for fmu in fmus.values()}
    common = {
        "file": str(scenario), "measure": d.measure, "isolation": asdict(isolation) if isolation else None,
        "fmus": {name: hash_of_file(fmu) for name, fmu in fmus.items()},
    }  # fmt: skip
    said = [
        d.measure,
        common["isolation"],
        {n: hash_of_data(f) for n, f in beside.items()},
        hash_of_program(),
    ]
    tasks = []
    for point in points:
        made = changed(table, point, paths)
        named = {k: v for k, v in made.items() if k not in ("id", "question", "expect")}
        tasks.append(Task(hash_of([named, *said]), {**common, "table": made}))
    return Plan(file, d, points, tasks, shipped)


def _table(file: Path, variant: str | None, campaign: Path) -> dict[str, Any]:
    """The scenario that is varied, as a table: the file, or one of its variants."""
    scenario = load_scenario(file)
    names = list(scenario.variants)
    if variant is None and names != [SINGLE]:
        raise BadInput(f"{campaign}: key 'variant' is missing; name one of {', '.join(names)}")
    if variant is not None and variant not in names:
        raise BadInput(
            f"{campaign}: key 'variant': there is no variant '{variant}'; {did_you_mean(variant, names)}"
        )
    table = read_toml(file, "a scenario")
    changes: dict[str, Any] = next((v for v in table.get("variants", []) if v.get("name") == variant), {})
    changes = {k: v for k, v in changes.items() if k != "name"}
    return merged({k: v for k, v in table.items() if k not in NOT_RUN}, changes)


def _path(key: str) -> Way:
    """The parts of a key of TOML, such as fmus.vehicle.parameters.k2 or inputs."vehicle.u_fl"."""
    try:
        value: Any = tomllib.loads(f"{key} = 0")
    except ValueError as error:
        raise BadInput(f"'{key}' is no key of TOML; write it as in the scenario") from error
    parts = []
    while isinstance(value, dict):
        [(part, value)] = value.items()
        parts.append(part)
    return tuple(parts)


def changed(table: Mapping[str, Any], point: Point, paths: Mapping[str, Way]) -> dict[str, Any]:
    """A scenario with the values of a point; BadInput where a key leads through what is no table or list."""
    made = deepcopy(dict(table))
    for key, value in point.items():
        *way, last = paths[key]
        here: Any = made
        for part in way:
            here = _step(here, part, key)
        if isinstance(here, list):
            here[_place(here, last, key)] = value
        elif isinstance(here, dict):
            here[last] = value
        else:
            raise BadInput(f"key '{key}': '{way[-1]}' is no table of the scenario; name one of its keys")
    return made


def _step(here: Any, part: str, key: str) -> Any:
    if isinstance(here, list):
        return here[_place(here, part, key)]
    if isinstance(here, dict):
        return here.setdefault(part, {})
    raise BadInput(f"key '{key}': '{part}' is within what is no table of the scenario")


def _place(entries: list[Any], part: str, key: str) -> int:
    if not part.isdigit() or int(part) >= len(entries):
        raise BadInput(f"key '{key}': '{part}' is no number of a list with {len(entries)} entries, from 0")
    return int(part)


def _files_of(table: Any, folder: Path) -> Iterator[tuple[str, Path]]:
    """The files beside a scenario that its table names, in the order of their names."""
    for text in sorted({*_texts(table)}):
        try:
            if text and (folder / text).is_file():
                yield text, folder / text
        except (OSError, ValueError):  # a text that is no name of a file
            continue


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _texts(part)
    elif isinstance(value, list):
        for part in value:
            yield from _texts(part)
