"""Exact profiles: each file of the folder `profiles` declares one by its sections."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from fmus.contact.geometry.profile import (
    Arc,
    Polynomial,
    Profile,
    Section,
    mirrored,
)
from fmus.errors import BadInput, did_you_mean
from fmus.registry import further_folders

FOLDER = Path(__file__).with_name("profiles")
PACKAGE = f"{__package__}.profiles"  # by which RAILFMI_PATH mirrors the folder
METRES = {"m": 1.0, "mm": 1e-3}  # of one unit of length in a file
UP = {"up": 1, "down": -1}


def exact_files() -> dict[str, Path]:
    """Files of the exact profiles by name; BadInput where a further one has a name that is taken."""
    found: dict[str, Path] = {}
    for folder in (FOLDER, *further_folders(PACKAGE)):
        for file in sorted(folder.glob("*.toml")):
            if file.stem in found:
                raise BadInput(
                    f"{file}: '{file.stem}' is also the name of {found[file.stem]}; rename the file"
                )
            found[file.stem] = file
    return found


def exact_names() -> list[str]:
    """Names of the exact profiles."""
    return sorted(exact_files())


@cache
def exact_profile(name: str) -> Profile:
    """The exact profile of that name; BadInput with the nearest name where there is none."""
    files = exact_files()
    if name not in files:
        raise BadInput(f"profile '{name}' is not known; {did_you_mean(name, files)}")
    try:
        return _profile(name, tomllib.loads(files[name].read_text(encoding="utf-8")))
    except (KeyError, TypeError, ValueError) as error:
        said = f"key {error}" if isinstance(error, KeyError) else error
        example = "write it as fmus/contact/geometry/profiles/60E1.toml is"
        raise BadInput(f"{files[name]}: is not a sound exact profile ({said}); {example}") from error


def _profile(name: str, declared: dict[str, Any]) -> Profile:
    length, up = METRES[declared["unit"]], UP[declared["z"]]
    sections = [_section(entry, length, up) for entry in declared["section"]]
    if declared.get("symmetric"):
        sections = [mirrored(s) for s in reversed(sections)] + sections
    face = declared.get("gauge_face")
    stated = None if face is None else float(face) * length
    return Profile(name, declared["kind"], tuple(sections), "exact sections", stated)


def _section(entry: dict[str, Any], length: float, up: int) -> Section:
    """One [[section]]: the ends of y, and a polynomial (ascending) or an arc, z = centre ± root."""
    begin, end = (float(y) * length for y in entry["y"])
    if "polynomial" in entry:
        c = tuple(up * float(c_k) * length ** (1 - k) for k, c_k in enumerate(entry["polynomial"]))
        return Polynomial(begin, end, c)
    arc = entry["arc"]
    centre_y, centre_z = (float(c) * length for c in arc["centre"])
    sign = up if arc["root"] == "+" else -up
    return Arc(begin, end, centre_y, up * centre_z, arc["radius"] * length, sign)
