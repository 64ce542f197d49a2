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

FOLDER = Path(__file__).with_name("profiles")
METRES = {"m": 1.0, "mm": 1e-3}  # of one unit of length in a file
UP = {"up": 1, "down": -1}


def exact_names() -> list[str]:
    """Names of the exact profiles."""
    return sorted(file.stem for file in FOLDER.glob("*.toml"))


@cache
def exact_profile(name: str) -> Profile:
    """The exact profile of that name; BadInput with the nearest name where there is none."""
    if name not in exact_names():
        raise BadInput(f"profile '{name}' is not known; {did_you_mean(name, exact_names())}")
    declared = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    length, up = METRES[declared["unit"]], UP[declared["z"]]
    sections = [_section(entry, length, up) for entry in declared["section"]]
    if declared.get("symmetric"):
        sections = [mirrored(s) for s in reversed(sections)] + sections
    return Profile(name, declared["kind"], tuple(sections), "exact sections")


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
