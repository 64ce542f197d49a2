"""The bill of materials sbom.cdx.json, from the lock and the libraries inside the packages; run to write it.

It is CycloneDX 1.6. What railfmi needs to run is `required`, what an extra brings is `optional`, and what
builds, tests and documents it is `excluded`. Checksums of what is installed stand in requirements.lock.
"""

import hashlib
import json
import re
import tomllib
import uuid
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
FILE, LOCK = ROOT / "sbom.cdx.json", ROOT / "requirements.lock"
DECLARED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WHEEL = DECLARED["tool"]["hatch"]["build"]["targets"]["wheel"]
OF_DEVELOPERS = ("dev", "docs")  # extras whose packages no user needs
OURS = "railfmi"
PINNED = re.compile(r"^([\w.-]+)==(\S+)(?: ; ([^\\]+?))? \\$")
VIA = re.compile(r"^ {4}#(?: via|  ) (\S+)")
INSIDE = re.compile(r"/\*! \S+/(\S+) \(v(\S+)\) \*/")  # how a library that is built into one file begins


@dataclass(frozen=True)
class Pin:
    """A package of the lock: its version, checksums of its files, and the packages that ask for it."""

    name: str
    version: str
    hashes: tuple[str, ...]
    via: tuple[str, ...]
    marker: str = ""

    @property
    def purl(self) -> str:
        """Its name in bills of materials."""
        return f"pkg:pypi/{self.name}@{self.version}"


def pins(lock: Path = LOCK) -> dict[str, Pin]:
    """The packages of a lock by name."""
    found: dict[str, Pin] = {}
    for block in re.split(r"\n(?=\S)", lock.read_text(encoding="utf-8")):
        first, *more = block.splitlines()
        if named := PINNED.match(first):
            name, version, marker = named.groups()
            hashes = tuple(re.findall(r"--hash=sha256:(\w+)", block))
            via = tuple(m[1] for line in more if (m := VIA.match(line)) and m[1] != "-c")
            found[name] = Pin(name, version, hashes, via, marker or "")
    return found


def declared() -> dict[str, list[str]]:
    """Requirements of railfmi itself (''), and of its extras by their names."""
    project = DECLARED["project"]
    return {"": project["dependencies"], **project["optional-dependencies"]}


def named(requirements: Iterable[str]) -> set[str]:
    """The names in requirements, as the lock writes them."""
    return {canonicalize_name(Requirement(requirement).name) for requirement in requirements}


def reached(begin: set[str], packages: Mapping[str, Pin]) -> set[str]:
    """These packages and all that they ask for."""
    while True:
        more = {pin.name for pin in packages.values() if {*pin.via} & begin} - begin
        if not more:
            return begin & packages.keys()
        begin = begin | more


def scopes(packages: Mapping[str, Pin]) -> dict[str, str]:
    """Of each package whether railfmi needs it, whether an extra does, or whether developers do."""
    asked = declared()
    of_users = [name for key, names in asked.items() if key not in OF_DEVELOPERS for name in names]
    required, optional = (reached(named(given), packages) for given in (asked[""], of_users))
    return {
        name: "required" if name in required else "optional" if name in optional else "excluded"
        for name in packages
    }


def inside() -> Iterator[dict[str, Any]]:
    """Libraries that lie in the packages as files of other people."""
    for package in WHEEL["packages"]:
        for file in sorted((ROOT / package).rglob("*.js")):
            if begins := INSIDE.match(file.read_text(encoding="utf-8")):
                name, version = begins.groups()
                licence = file.with_name(f"{name.upper()}-LICENSE").read_text(encoding="utf-8")
                yield {
                    "type": "library",
                    "bom-ref": f"pkg:npm/{name.lower()}@{version}",
                    "name": name,
                    "version": version,
                    "purl": f"pkg:npm/{name.lower()}@{version}",
                    "scope": "required",
                    "licenses": [{"license": {"name": licence.splitlines()[0]}}],
                    "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(file.read_bytes()).hexdigest()}],
                    "evidence": {"occurrences": [{"location": file.relative_to(ROOT).as_posix()}]},
                }


def licences(pin: Pin) -> list[dict[str, Any]]:
    """What the package says of its licence; nothing where this version of it is not installed."""
    try:
        about = distribution(pin.name)
    except PackageNotFoundError:
        return []
    if about.version != pin.version:
        return []
    if expression := about.metadata.get("License-Expression"):
        return [{"expression": expression}]
    classed = [c for c in about.metadata.get_all("Classifier") or () if c.startswith("License :: ")]
    name = classed[0].rpartition(" :: ")[2] if classed else about.metadata.get("License") or ""
    first = next(iter(name.strip().splitlines()), "")
    return [{"license": {"name": first}}] if first else []


def component(pin: Pin, scope: str) -> dict[str, Any]:
    """A package of the lock as a component."""
    found: dict[str, Any] = {
        "type": "library",
        "bom-ref": pin.purl,
        "name": pin.name,
        "version": pin.version,
        "purl": pin.purl,
        "scope": scope,
    }
    if pin.marker:
        found["properties"] = [{"name": f"{OURS}:marker", "value": pin.marker}]
    if told := licences(pin):
        found["licenses"] = told
    return found


def bill() -> dict[str, Any]:
    """The bill of materials; the same packages give the same bytes."""
    packages, ours = pins(), DECLARED["project"]
    own = f"pkg:pypi/{OURS}@{ours['version']}"
    of, built_in = scopes(packages), list(inside())
    asked = named(name for names in declared().values() for name in names) & packages.keys()
    needs = {
        pin.purl: sorted(p.purl for p in packages.values() if pin.name in p.via) for pin in packages.values()
    }
    needs[own] = sorted([*(packages[n].purl for n in asked), *(c["purl"] for c in built_in)])
    content = {
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": own,
                "name": OURS,
                "version": ours["version"],
                "purl": own,
                "description": ours["description"],
                "licenses": [{"license": {"id": ours["license"]}}],
            },
            "properties": [
                {"name": f"{OURS}:lock:sha256", "value": hashlib.sha256(LOCK.read_bytes()).hexdigest()}
            ],
        },
        "components": [*(component(pin, of[pin.name]) for pin in packages.values()), *built_in],
        "dependencies": [{"ref": ref, "dependsOn": on} for ref, on in sorted(needs.items()) if on],
    }
    serial = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(content, sort_keys=True))
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{serial}",
        "version": 1,
        **content,
    }


if __name__ == "__main__":
    FILE.write_text(json.dumps(bill(), indent=1) + "\n", encoding="utf-8")
