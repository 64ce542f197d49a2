"""What runs inside a PythonFMU build: copied into the FMU as a package, beside model.casadi and model.json.

It imports nothing of this repository. All that an instance knows is in one flat array of its
variables, so that there is no hidden state; no exception leaves it, since a host could not survive one.
"""

from __future__ import annotations

import json
import math
from array import array
from functools import wraps
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import casadi as cs
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
from pythonfmu.enums import Fmi2Initial, Fmi2Status, Fmi2Variability

HERE = Path(__file__).parent
MODEL: dict[str, Any] = json.loads((HERE / "model.json").read_text())
STEP, OUTPUTS = (
    cs.Function.deserialize((HERE / f"{name}.casadi").read_text()) for name in ("step", "outputs")
)
VARIABLES: list[dict[str, Any]] = MODEL["variables"]
SIZES: list[int] = MODEL["sizes"]  # how many states, inputs, parameters, outputs, in this order
SETTABLE = sum(SIZES[:3])
LIMITS = {
    i: (-math.inf if v["min"] is None else v["min"], math.inf if v["max"] is None else v["max"])
    for i, v in enumerate(VARIABLES)
    if v["causality"] in ("parameter", "input") and (v["min"], v["max"]) != (None, None)
}
TIME_TOLERANCE = 1e-9  # of a step, so that a whole number of internal steps is seen as one


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


class Slave(Fmi2Slave):  # type: ignore[misc]
    """One instance: values of all variables in the order of the model description."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.description, self.author = MODEL["description"], None
        self.guid, self.version = MODEL["guid"], MODEL["version"]
        self.values = array("d", [v["start"] for v in VARIABLES])
        self.failure = ""
        self._connect()

    def _connect(self) -> None:
        """Point the compiled functions at the array's memory; their buffers hold no value of their own."""
        memory, ends = memoryview(self.values), [0, *(sum(SIZES[: i + 1]) for i in range(4))]
        x, u, p, y = (memory[a:b] for a, b in zip(ends, ends[1:], strict=False))
        dt, x1 = array("d", [0.0]), array("d", bytes(8 * SIZES[0]))
        step, self._step = STEP.buffer()
        out, self._out = OUTPUTS.buffer()
        for i, part in enumerate((x, u, p, memoryview(dt))):
            step.set_arg(i, part)
        for i, part in enumerate((x, u, p)):
            out.set_arg(i, part)
        step.set_res(0, memoryview(x1))
        out.set_res(0, y)
        self._dt, self._x1, self._buffers, self.stale = dt, x1, (step, out), True

    def fail(self, reason: str) -> None:
        """Log a reason; the instance refuses to step until it is reset or restored."""
        self.failure = reason
        self.log(reason, Fmi2Status.discard)

    def get_real(self, vrs: list[int]) -> list[float]:
        """Values by reference; outputs are computed when first asked for after a change."""
        if self.stale:
            self._out()
            self.stale = False
        values = self.values
        try:
            return [values[i] for i in vrs]
        except Exception as error:
            self.fail(f"get_real: {error}")
            return [math.nan] * len(vrs)

    @caught
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set states, inputs and parameters; outputs cannot be set, limits and NaN stop the next step."""
        for i, value in zip(vrs, values, strict=True):
            if i >= SETTABLE:
                raise ValueError(f"{VARIABLES[i]['name']} is computed and cannot be set")
            if not math.isfinite(value):
                raise ValueError(f"{VARIABLES[i]['name']} = {value} is not a finite number")
            low, high = LIMITS.get(i, (-math.inf, math.inf))
            if not low <= value <= high:
                raise ValueError(f"{VARIABLES[i]['name']} = {value:g} is outside {low:g} to {high:g}")
            self.values[i] = value
        self.stale = True

    @caught
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by a communication step in equal internal steps; False leaves the state as it was."""
        if self.failure:
            self.log(self.failure, Fmi2Status.discard)
            return False
        if not step_size > 0:
            raise ValueError(f"step size {step_size} s is not positive")
        n, values, x1 = SIZES[0], self.values, self._x1
        steps = max(1, math.ceil(step_size / MODEL["step_size"] - TIME_TOLERANCE))
        self._dt[0] = step_size / steps
        before = values[:n]
        for _ in range(steps):
            self._step()
            values[:n] = x1
        self.stale = True
        if not all(map(math.isfinite, values[:n])):
            values[:n] = before
            self.log(f"the state is no longer finite after t = {current_time:g} s", Fmi2Status.discard)
            return False
        return True

    def _get_fmu_state(self) -> dict[str, Any]:
        return {"values": self.values.tolist(), "failure": self.failure}

    @caught
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.values[:] = array("d", state["values"])
        self.failure, self.stale = state["failure"], True

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
        root = super().to_xml(model_options or {})
        root.set("guid", str(self.guid))
        del root.attrib["generationDateAndTime"]  # the same source gives the same bytes
        root.set("variableNamingConvention", "flat")
        root.insert(list(root).index(root.find("LogCategories")), units_xml())
        for node, v in zip(root.iter("ScalarVariable"), VARIABLES, strict=True):
            real = node.find("Real")
            keys = ("unit", "min", "max", "nominal", "start")
            given = {k: v[k] for k in keys if v[k] is not None and (k != "start" or v["starts"])}
            for k, value in given.items():
                real.set(k, value if k == "unit" else repr(float(value)))
        unknowns = SubElement(root.find("ModelStructure"), "InitialUnknowns")
        for i in range(SETTABLE, len(VARIABLES)):
            SubElement(unknowns, "Unknown", index=str(i + 1))
        return root


def units_xml() -> Element:
    """<UnitDefinitions> from the exponents found when the FMU was built."""
    node = Element("UnitDefinitions")
    for name, base in MODEL["units"].items():
        SubElement(SubElement(node, "Unit", name=name), "BaseUnit", base)
    return node
