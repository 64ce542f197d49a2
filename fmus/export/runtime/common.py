"""The part of a slave that all builds share: variables, refusals, saved state, model description.

All that an instance knows is in one flat array of its variables, so that there is no hidden state;
no exception leaves it, since a host could not survive one.
"""

from __future__ import annotations

import atexit
import ctypes
import json
import math
import sys
import zlib
from array import array
from functools import cache, wraps
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Causality, Fmi2Slave, Real
from pythonfmu.enums import Fmi2Initial, Fmi2Status, Fmi2Variability

HERE = Path(__file__).parent
MODEL: dict[str, Any] = json.loads((HERE / "model.json").read_text(encoding="utf-8"))
VARIABLES: list[dict[str, Any]] = MODEL["variables"]
SIZES: list[int] = MODEL["sizes"]  # how many states, inputs, parameters, outputs, in this order
SETTABLE = sum(SIZES[:3])
START = array("d", [v["start"] for v in VARIABLES])
LARGEST = sys.float_info.max
TOLD: set[str] = set()  # names of the instances whose note is in the log: a reset makes a new slave


def limits(key: str, without: float) -> list[float]:
    """Least or largest value of each variable that can be set; nothing that is not finite lies between."""
    given = [v[key] if v["causality"] in ("parameter", "input") else None for v in VARIABLES[:SETTABLE]]
    return [without if v is None else min(max(v, -LARGEST), LARGEST) for v in given]


LEAST, MOST = limits("min", -LARGEST), limits("max", LARGEST)


def caught(method: Any) -> Any:
    """Turn an exception of a callback into a logged reason; do_step then answers fmi2Discard."""

    @wraps(method)
    def safe(self: Slave, *args: Any) -> Any:
        try:
            return method(self, *args)
        except Exception as error:
            self.fail(f"{method.__name__}: {type(error).__name__}: {error}")
            return False

    return safe


@cache
def let_go_in_time(binaries: Path) -> None:
    """Have PythonFMU's binary drop its interpreter before the process ends, not twice while it ends.

    Its destructor for the library runs after that of its variables and releases freed memory (0.7.0),
    which now and then aborts a host. Where the host is no Python, the binary owns the interpreter and
    must keep it.
    """
    hosted_by_python = bool(sys.orig_argv)
    for binary in binaries.glob("*.so") if hosted_by_python else ():
        atexit.register(ctypes.CDLL(str(binary)).finalizePythonInterpreter)


class Slave(Fmi2Slave):  # type: ignore[misc]  # PythonFMU comes without types
    """One instance: values of all variables in the order of the model description."""

    note = ""  # what a user should know of how it runs here, in one sentence
    computed = SETTABLE  # variables from here on are brought up to date when they are asked for

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        if "resources" in kwargs:
            let_go_in_time(Path(kwargs["resources"]).parent / "binaries" / "linux64")
        self.description, self.author = MODEL["description"], None
        self.guid, self.version = MODEL["guid"], MODEL["version"]
        self.values = START[:]
        self.failure, self.stale = "", True
        if self.note and kwargs["instance_name"] not in TOLD:
            TOLD.add(kwargs["instance_name"])
            self.log(self.note, Fmi2Status.warning)

    def refresh(self) -> None:
        """Compute the outputs from states, inputs and parameters."""
        raise RuntimeError("a build defines this")

    def advance(self, current_time: float, step_size: float) -> bool:
        """Make the step, or leave the state as it was and answer False."""
        raise RuntimeError("a build defines this")

    def needed(self) -> list[list[int]] | None:
        """For each output, what it is computed from, by place in the description; None where nobody knows."""
        return None

    def experiment(self) -> dict[str, float]:
        """Times, s, tolerance and step of the usual experiment; empty where nobody states one."""
        return dict(MODEL.get("experiment", {}))

    def display(self) -> dict[str, dict[str, str]]:
        """By variable the <DisplayUnit> of its unit in which a person reads it, where one is stated."""
        return dict(MODEL.get("display", {}))

    def fail(self, reason: str) -> None:
        """Log a reason; the instance refuses to step until it is reset or restored."""
        self.failure = reason
        self.log(reason, Fmi2Status.discard)

    def get_real(self, vrs: list[int]) -> list[float]:
        """Values by reference; outputs are computed when first asked for after a change."""
        values = self.values
        try:
            if self.stale and max(vrs, default=-1) >= self.computed:
                self.refresh()
                self.stale = False
            return [values[i] for i in vrs]
        except Exception as error:
            self.fail(f"get_real: {error}")
            return [math.nan] * len(vrs)

    @caught
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set states, inputs and parameters; what cannot be set stops the next step."""
        self.stale, known = True, self.values
        for i, value in zip(vrs, values, strict=True):
            if i >= SETTABLE or not LEAST[i] <= value <= MOST[i]:
                raise ValueError(why_not(i, value))
            known[i] = value

    def get_integer(self, vrs: list[int]) -> list[int]:
        """There are none; PythonFMU would raise an error that no host survives."""
        self.fail("it has Real variables only")
        return [0] * len(vrs)

    def get_string(self, vrs: list[int]) -> list[str]:
        """There are none."""
        return [str(number) for number in self.get_integer(vrs)]

    def set_integer(self, vrs: list[int], values: list[Any]) -> None:
        """There are none."""
        self.get_integer(vrs)

    get_boolean = get_integer
    set_boolean = set_string = set_integer

    @caught
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by a communication step; False where it could not be made."""
        if self.failure:
            self.log(self.failure, Fmi2Status.discard)
            return False
        if not 0 < step_size < math.inf:
            raise ValueError(f"step size {step_size} s is not positive and finite")
        self.stale = True
        return self.advance(current_time, step_size)

    def _get_fmu_state(self) -> dict[str, Any]:
        return {"values": self.values.tolist(), "failure": self.failure}

    @caught
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if "damage" in state:
            raise ValueError(state["damage"])
        self.values[:] = array("d", state["values"])
        self.failure, self.stale = state["failure"], True

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        data = json.dumps(state).encode()
        return json.dumps({"of": MODEL["guid"], "sum": zlib.crc32(data)}).encode() + b"\n" + data

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        """A state from bytes, or what is wrong with them, for the refusal when it is set.

        An exception here would be fmi2Fatal, after which every further call ends the host (PythonFMU 0.7).
        """
        head, _, data = state.partition(b"\n")
        try:
            said = json.loads(head)
            origin, whole = said["of"], said["sum"] == zlib.crc32(data)
        except (ValueError, TypeError, KeyError):
            whole = False
        if not whole:
            return {"damage": "the bytes of the saved state are damaged; nothing was restored"}
        if origin != MODEL["guid"]:
            return {"damage": "the saved state is not one of this FMU; nothing was restored"}
        return dict(json.loads(data))

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The model description, completed by what PythonFMU leaves out."""
        for v in VARIABLES:
            self.register_variable(
                Real(
                    v["name"],
                    causality=Fmi2Causality[v["causality"]],
                    variability=Fmi2Variability[v["variability"]],
                    initial=None if v["initial"] is None else Fmi2Initial[v["initial"]],
                    description=v["description"],
                    getter=lambda: 0.0,
                ),
                nested=False,
            )
        root: Element = super().to_xml(model_options or {})
        root.set("guid", str(self.guid))
        del root.attrib["generationDateAndTime"]  # the same source gives the same bytes
        root.set("variableNamingConvention", "flat")
        made_by = f"railfmi {MODEL['version']} with PythonFMU {MODEL['pythonfmu']}"
        for key, value in {"generationTool": made_by, **MODEL.get("rights", {})}.items():
            root.set(key, value)
        place = [node.tag for node in root].index("LogCategories")
        experiment, display = self.experiment(), self.display()
        if experiment:
            times = {k: repr(float(v)) for k, v in experiment.items()}
            root.insert(place + 1, Element("DefaultExperiment", times))
        root.insert(place, units_xml(display))
        for node, v in zip(root.iter("ScalarVariable"), VARIABLES, strict=True):
            complete(node, v, display.get(v["name"]))
        structure = root.findall("ModelStructure")[0]
        computed = range(SETTABLE, len(VARIABLES))
        if computed:
            unknowns = SubElement(structure, "InitialUnknowns")
            for i in computed:
                SubElement(unknowns, "Unknown", index=str(i + 1))
        needed = self.needed()
        if needed is not None:
            state_dependencies(structure, needed)
        return root


def why_not(i: int, value: float) -> str:
    """Why a variable does not take a value."""
    name = VARIABLES[i]["name"]
    if i >= SETTABLE:
        return f"{name} is computed and cannot be set"
    if not math.isfinite(value):
        return f"{name} = {value} is not a finite number"
    low, high = (math.copysign(math.inf, v) if abs(v) == LARGEST else v for v in (LEAST[i], MOST[i]))
    return f"{name} = {value:g} is outside {low:g} to {high:g}"


def complete(node: Element, v: dict[str, Any], shown: dict[str, str] | None) -> None:
    """Unit, display unit, limits, nominal and start of one <ScalarVariable>."""
    real = node.findall("Real")[0]
    if v["unit"]:
        real.set("unit", v["unit"])
    if shown:
        real.set("displayUnit", shown["name"])
    for key in ("min", "max", "nominal", "start"):
        if v[key] is not None and math.isfinite(v[key]) and (key != "start" or v["starts"]):
            real.set(key, repr(float(v[key])))


def state_dependencies(structure: Element, needed: list[list[int]]) -> None:
    """Write into <ModelStructure> what each output depends on: at a communication point the inputs alone.

    A state is none of them: it is free at the start and its value is kept.
    """
    inputs = range(SIZES[0], SIZES[0] + SIZES[1])
    for kind, known in (("Outputs", inputs), ("InitialUnknowns", range(SETTABLE))):
        for unknown in structure.findall(f"{kind}/Unknown"):
            place = int(unknown.attrib["index"]) - 1
            of = needed[place - SETTABLE] if place >= SETTABLE else []
            unknown.set("dependencies", " ".join(str(i + 1) for i in of if i in known))


def units_xml(display: dict[str, dict[str, str]]) -> Element:
    """<UnitDefinitions> from the exponents found when the FMU was built; display: units by variable."""
    node = Element("UnitDefinitions")
    for name, base in MODEL["units"].items():
        unit = SubElement(node, "Unit", name=name)
        SubElement(unit, "BaseUnit", base)
        shown = (display[v["name"]] for v in VARIABLES if v["unit"] == name and v["name"] in display)
        for about in {given["name"]: given for given in shown}.values():
            SubElement(unit, "DisplayUnit", about)
    return node
