"""Pack a foreign FMU with effects around it as a native FMU, for runs in this process.

It takes the same steps as the container in Python (see coupled.py), which is what users get: that one needs
no compiler and runs on every platform that PythonFMU supports. An FMU for model exchange alone is integrated
over each step (see exchange.c), so that it becomes one for co-simulation.
"""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import casadi as cs
import fmpy
from jinja2 import Environment, FileSystemLoader

from fmus.export.around.outside import Laws, laws
from fmus.export.builders.native.build import NO_TOKEN, identified, packed
from fmus.export.builders.native.code import STANDARD, Work, quoted
from fmus.export.builders.native.compilers import host
from fmus.export.builders.native.description import flag, text
from fmus.export.builders.native.libraries import library
from fmus.export.container.coupled import COUPLING_STEP, carrying
from fmus.files import write_at_once
from fmus.host.archive import Archive
from fmus.host.description import FmuDescription, PortNames

HERE = Path(__file__).parent
NAME = "Carrier"
LARGEST = sys.float_info.max
LINKED = {".so": ("-ldl",)}  # for libraries of a platform that load others
ABILITIES = {
    "needsExecutionTool": "true",
    "canNotUseMemoryManagementFunctions": "true",
}


def build_carrier(
    base: Path, ports: Sequence[PortNames], effects: Sequence[tuple[str, str]], out: Path,
    step: float = COUPLING_STEP,
) -> Path:  # fmt: skip
    """Write an FMU with `base` inside and effects (kind, location) around it to `out`, and return it.

    step: the longest time between two readings of a port, s. BadInput where there is no compiler, or the base
    has no library for this platform.
    """
    with Archive(base) as archive:
        description, inside = archive.description, archive.folder
        where, fmi = host(), int(archive.description.fmi_version[0])
        carried = f"binaries/{where.folder(fmi)}/{description.identifier}{where.suffix}"
        made = laws(description, ports, effects)
        card = carrying(description, ports, effects, made, {}, step)
        code = _sources(card, made, description, carried)
        files = identified(code | {"modelDescription.xml": _described(card, description)})
        built = library({name: files.pop(name) for name in code}, "carrier.c", LINKED.get(where.suffix, ()))
        files |= {
            f"resources/base/{path.relative_to(inside).as_posix()}": path.read_bytes()
            for path in inside.rglob("*")
            if path.is_file()
        }
    files[f"binaries/{where.folder(2)}/{_named(description)[1]}{where.suffix}"] = built
    write_at_once(out, packed(files, zipfile.ZIP_STORED))
    return out


def _sources(card: dict[str, Any], made: Laws, description: FmuDescription, library: str) -> dict[str, bytes]:
    """The files to compile, by name."""
    generator = cs.CodeGenerator("laws.c", {"casadi_int": "int"})
    functions = [made.push, made.go_on]
    for function in functions:
        generator.add(function)
    sizes = ([getattr(f, f"sz_{part}")() for f in functions] for part in ("arg", "res", "iw", "w"))
    rows, base = card["variables"], card["base"]
    n_states, n_inputs, n_parameters, _ = card["sizes"]
    settable = n_states + n_inputs + n_parameters
    told, references = set(base["told"]), base["references"]
    facts = {
        "c": quoted,
        "token": NO_TOKEN,
        "fmi": description.fmi_version[0],
        "exchange": description.exchange,
        "base_token": description.guid,
        "library": library,
        "longest": repr(card["step_size"]),
        "work": Work(*(max(size) for size in sizes)),
        "rows": rows,
        "settable": settable,
        "memory": base["states"],
        "first_memory": n_states - base["states"],
        "starts": [repr(float(r["start"])) for r in rows],
        "least": [_limit(r, "min", -LARGEST) for r in rows[:settable]],
        "most": [_limit(r, "max", LARGEST) for r in rows[:settable]],
        "references": [max(reference, 0) for reference in references],
        "motion": [references[i] for i in base["motion"]],
        "motion_is_state": int(_is_state(description, [rows[i]["name"] for i in base["motion"]], made)),
        "told": [references[i] for i in base["told"]],
        "passed": [int(references[i] >= 0 and i not in told) for i in range(settable)],
        "inputs": [int(n_states <= i < n_states + n_inputs) for i in range(settable)],
    }
    templates = Environment(loader=FileSystemLoader(HERE), trim_blocks=True, lstrip_blocks=True)
    headers = Path(fmpy.__file__).parent / "c-code"
    sources = ("carrier.c", "exchange.c") if description.exchange else ("carrier.c",)
    files = {
        **{name: (HERE / name).read_text(encoding="utf-8") for name in sources},
        "carrier.h": templates.get_template("carrier.h.j2").render(facts),
        "laws.c": generator.dump(),
    }
    standard = {n: (headers / n).read_bytes() for n in (*STANDARD[2], *STANDARD[3])}
    return standard | {name: content.encode() for name, content in files.items()}


def _is_state(description: FmuDescription, motion: Sequence[str], made: Laws) -> bool:
    """Whether laws want the motion at the ports and no input changes it before the next step, as declared.

    A law that sets a parameter may change it.
    """
    depends = [description.dependencies.get(name, ("unknown",)) for name in motion]
    return bool(made.told) and {*made.told} <= {*description.inputs} and not any(depends)


def _limit(row: dict[str, Any], key: str, without: float) -> str:
    """Least or largest value that a variable takes; see runtime/common.py."""
    given = row[key] if row["causality"] in ("parameter", "input") else None
    return repr(without if given is None else min(max(float(given), -LARGEST), LARGEST))


def _named(description: FmuDescription) -> tuple[str, str]:
    """Name of the model, and of the library: those of an FMU that stands in the place of what it carries."""
    return (description.name, description.identifier) if description.exchange else (NAME, NAME)


def _described(card: dict[str, Any], description: FmuDescription) -> bytes:
    """modelDescription.xml."""
    name, identifier = _named(description)
    root = Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=name, guid=NO_TOKEN,
        description=card["description"], variableNamingConvention="structured",
    )  # fmt: skip
    once = {
        "canBeInstantiatedOnlyOncePerProcess": flag(description.once_per_process),
        "canHandleVariableCommunicationStepSize": flag(description.variable_step),
    }
    SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **once, **ABILITIES})
    if card["units"]:
        units = SubElement(root, "UnitDefinitions")
        for name, exponents in card["units"].items():
            SubElement(SubElement(units, "Unit", name=name), "BaseUnit", exponents)
    variables, outputs = SubElement(root, "ModelVariables"), []
    for i, v in enumerate(card["variables"]):
        keys = ("name", "causality", "variability", "initial", "description")
        about = {k: v[k] for k in keys if v[k]} | {"valueReference": str(i)}
        numbers = {
            k: repr(float(v[k])) for k in ("min", "max", "nominal") if v[k] is not None and isfinite(v[k])
        }
        start = {"start": repr(v["start"])} if v["starts"] else {}
        unit = {"unit": v["unit"]} if v["unit"] else {}
        SubElement(SubElement(variables, "ScalarVariable", about), "Real", unit | numbers | start)
        if v["causality"] == "output":
            outputs.append(i)
    structure = SubElement(root, "ModelStructure")
    node = SubElement(structure, "Outputs")
    for i in outputs:
        SubElement(node, "Unknown", index=str(i + 1))
    computed = [i for i in outputs if card["variables"][i]["initial"] == "calculated"]
    if computed:
        node = SubElement(structure, "InitialUnknowns")
        for i in computed:
            SubElement(node, "Unknown", index=str(i + 1))
    return text(root)
