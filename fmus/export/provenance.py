"""Where an FMU comes from: a record in its folder extra/, with checksums of all its other files.

Nothing in it depends on when or where the FMU was built, so that the same build gives the same bytes.
"""

import inspect
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup

from fmus.effects.effect import Effect
from fmus.errors import BadInput
from fmus.host.apart.isolation import Isolation
from fmus.model import Model
from fmus.taken import check_packed
from fmus.variables import Parameter

HERE = Path(__file__).parent
FOLDER = "extra/org.railfmi"  # FMI and SSP: a folder named by the reversed domain of who adds it
OWN = {
    "author": "the authors of railfmi",
    "copyright": "Copyright the authors of railfmi",
    "license": "Apache-2.0",
}
PLACE = f"{FOLDER}/provenance.json"


@dataclass(frozen=True)
class Origin:
    """What estimates in an FMU rest on.

    experiment: its id; estimates: value and standard error by the FMU's variable, in its unit, the error
    None where the data do not tell it; data: SHA-256 of the data files, by name; verdict: of close-loop.
    """

    experiment: str
    estimates: Mapping[str, tuple[float, float | None]] = field(default_factory=dict)
    data: Mapping[str, str] = field(default_factory=dict)
    verdict: str = ""


def record(model: Model, kind: str, fmi: int, origin: Origin | None = None) -> dict[str, Any]:
    """The record of a model's build: version, profiles, parameters, effects, and what estimates rest on."""
    return {
        **common(model.name, kind, fmi),
        "profiles": _options(model),
        "parameters": {p.name: _value(p) for p in model.of(Parameter)},
        "effects": [_effect(model, effect, location) for effect, location in model.effects],
        "origin": None if origin is None else asdict(origin),
    }


def record_around(
    base: Path,
    effects: Sequence[tuple[type[Effect], str]],
    parameters: Mapping[str, tuple[float, str | None]],
    origin: Origin | None,
) -> dict[str, Any]:
    """What the record of a foreign FMU `base` with effects around it says beside `common`.

    effects: with their locations; parameters: value and unit by name, of the FMU and of the effects.
    """
    values = {name: {"value": value, "unit": unit} for name, (value, unit) in parameters.items()}
    return {
        "base": {"file": base.name, "sha256": checksum(base)},
        "parameters": values,
        "effects": [_named(effect, location, values) for effect, location in effects],
        "origin": None if origin is None else asdict(origin),
    }


def rights(model: Model) -> dict[str, str]:
    """Author, copyright and license for a model description: those of a model of railfmi, else none."""
    try:
        file = inspect.getfile(type(model))
    except (TypeError, OSError):  # the class stands in no file, but in text that was executed
        return {}
    return OWN if Path(file).is_relative_to(HERE.parent) else {}


def common(model: str, kind: str, fmi: int) -> dict[str, Any]:
    """What the record of every build says."""
    return {"tool": "railfmi", "version": version("railfmi"), "model": model, "kind": kind, "fmi": fmi}


def sealed(record: Mapping[str, Any], files: Mapping[str, bytes]) -> bytes:
    """The file at PLACE: a record with the SHA-256 of the FMU's other files, by path."""
    sums = {path: sha256(files[path]).hexdigest() for path in sorted(files) if path != PLACE}
    return (json.dumps({**record, "sha256": sums}, indent=1, ensure_ascii=False) + "\n").encode()


def on_page(page: str, record: Mapping[str, Any]) -> str:
    """A documentation page with the record at its end."""
    template = Environment(loader=FileSystemLoader(HERE), autoescape=True).get_template("provenance.html.j2")
    section = template.render(r=record, place=PLACE)
    body, end, rest = page.rpartition("</body>")
    return str(Markup(body) + Markup(section) + Markup(end + rest)) if end else page


def provenance(fmu: str | Path) -> dict[str, Any]:
    """The record in an FMU file, and `fmu_sha256`, the checksum of the file itself.

    BadInput where it is no zip file, or has no such record, as an FMU of another tool.
    """
    path = Path(fmu)
    try:
        with zipfile.ZipFile(path) as packed:
            found = json.loads(packed.read(PLACE))
    except KeyError as error:
        raise BadInput(f"{path}: has no {PLACE}; it was not built by railfmi 0.1 or later") from error
    except (OSError, zipfile.BadZipFile) as error:
        raise BadInput(f"{path}: cannot be read as an FMU ({error}); give the path of an FMU") from error
    except ValueError as error:
        raise BadInput(f"{path}: its {PLACE} is no JSON ({error}); get the FMU again") from error
    if not isinstance(found, dict):
        raise BadInput(f"{path}: its {PLACE} holds no table; get the FMU again")
    return {**found, "fmu_sha256": checksum(path)}


def altered(fmu: str | Path) -> list[str]:
    """Files of an FMU that are not as its record says: changed, added or gone since it was built."""
    said: dict[str, str] = provenance(fmu).get("sha256", {})
    with zipfile.ZipFile(fmu) as packed:
        names = [n for n in packed.namelist() if n != PLACE and not n.endswith("/")]
        now = {name: sha256(packed.read(name)).hexdigest() for name in names}
    return sorted(name for name in {*said, *now} if said.get(name) != now.get(name))


def isolation_of(fmu: Path, isolation: Isolation | None) -> Isolation | None:
    """The isolation that an FMU needs: none if it is a build of railfmi's own models, unaltered.

    A record of provenance is no signature: who forges one can have an FMU run in the process of the command.
    """
    if isolation is None or not fmu.is_file():
        return isolation  # who opens it says what is wrong with it
    try:
        with zipfile.ZipFile(fmu) as packed:
            check_packed(packed, fmu)
        own = "base" not in provenance(fmu) and not altered(fmu)
    except Exception:  # a package that is damaged, or a record of another form, is not one of ours
        own = False
    return None if own else isolation


def checksum(file: Path) -> str:
    """SHA-256 of a file."""
    return sha256(file.read_bytes()).hexdigest()


def _options(model: Model) -> dict[str, Any]:
    """What was chosen for the build; a point file by its name and checksum, not its place."""
    found: dict[str, Any] = dict(model.options)
    for option in model.build_options:
        file = Path(str(found[option.name]))
        if option.type is Path and file.is_file():
            found |= {option.name: file.name, f"{option.name}_sha256": checksum(file)}
    return found


def _effect(model: Model, effect: type[Effect], location: str) -> dict[str, Any]:
    own = {p.name: _value(p) for p in model.of(Parameter) if p.name in model.brought}
    return _named(effect, location, own)


def _named(effect: type[Effect], location: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """An effect with those of the values that are its parameters."""
    start = effect.name_at(location, "")
    own = {name.removeprefix(start): value for name, value in values.items() if name.startswith(start)}
    return {"kind": effect.kind, "location": location, "parameters": own}


def _value(p: Any) -> dict[str, Any]:
    return {"value": float(p.start), "unit": p.unit}
