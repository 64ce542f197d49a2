"""The C functions of a running FMU, for FMI 2.0 and 3.0, as the loops over copies call them."""

from collections.abc import Callable, Mapping
from ctypes import byref, c_bool, c_double, c_uint, c_void_p, cast
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.host.fmu import Fmu, FmuError
from fmus.host.instance import address_of
from fmus.host.status import CallFailed

ROLES = ("set", "get", "step", "reset", "setup", "enter", "exit", "restore")
NAMES = {
    "2.0": (
        "fmi2SetReal", "fmi2GetReal", "fmi2DoStep", "fmi2Reset", "fmi2SetupExperiment",
        "fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2SetFMUstate",
    ),
    "3.0": (
        "fmi3SetFloat64", "fmi3GetFloat64", "fmi3DoStep", "fmi3Reset", "",
        "fmi3EnterInitializationMode", "fmi3ExitInitializationMode", "fmi3SetFMUState",
    ),
}  # fmt: skip

Call = Callable[..., int]


@dataclass(frozen=True)
class Functions:
    """The functions of one FMU by role, and the component pointers of its instances."""

    fmi3: bool
    calls: dict[str, Any]  # ctypes functions
    components: tuple[int, ...]
    addresses: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))  # in order of ROLES


def functions(copies: list[Fmu]) -> Functions:
    """The functions of instances of one FMU, which must exist as long as the functions are used."""
    instances = [fmu.instance for fmu in copies]
    names = NAMES[copies[0].description.fmi_version[:3]]
    library = instances[0].library
    found = {role: getattr(library, n, None) for role, n in zip(ROLES, names, strict=True) if n}
    calls = {role: call for role, call in found.items() if call is not None}
    addresses = [cast(calls[role], c_void_p).value if role in calls else 0 for role in ROLES]
    return Functions(
        copies[0].description.fmi_version.startswith("3"),
        calls,
        tuple(instance.component for instance in instances),
        np.array(addresses, dtype=np.int64),
    )


def setter(f: Functions, component: int, references: NDArray[np.uint32], values: Any) -> Call:
    """A call that sets variables from a C array of doubles."""
    n, refs = len(references), (c_uint * len(references))(*references.tolist())
    size = (n,) if f.fmi3 else ()
    raw = f.calls["set"]
    return lambda: raw(c_void_p(component), refs, n, values, *size)


def getter(f: Functions, component: int, references: NDArray[np.uint32], values: Any) -> Call:
    """A call that reads variables into a C array of doubles."""
    n, refs = len(references), (c_uint * len(references))(*references.tolist())
    size = (n,) if f.fmi3 else ()
    raw = f.calls["get"]
    return lambda: raw(c_void_p(component), refs, n, values, *size)


def stepper(f: Functions, component: int, final: bool) -> Call:
    """A call (t, dt) that makes a step; a step that an FMI 3.0 FMU ends early counts as an error.

    final: whether no state from before the end of a step will come back.
    """
    raw = f.calls["step"]
    if not f.fmi3:
        return lambda t, dt: raw(c_void_p(component), c_double(t), c_double(dt), int(final))
    event, ends, early, reached = c_bool(), c_bool(), c_bool(), c_double()
    told = [byref(v) for v in (event, ends, early, reached)]

    def step(t: float, dt: float) -> int:
        status: int = raw(c_void_p(component), c_double(t), c_double(dt), final, *told)
        return 3 if ends.value or early.value else status

    return step


def entrance(f: Functions, component: int) -> Call:
    """A call (t0) that enters initialisation mode."""
    c, no = c_void_p(component), c_double(0.0)
    if f.fmi3:
        return lambda t0: f.calls["enter"](c, False, no, c_double(t0), False, no)

    def enter(t0: float) -> int:
        status: int = f.calls["setup"](c, 0, no, c_double(t0), 0, no)
        return status if status > 1 else int(f.calls["enter"](c))

    return enter


def saved_in_initialisation(fmu: Fmu, start: Mapping[str, float], t0: float) -> int:
    """Reset an instance, enter initialisation at t0 and save its state; returns the address of that state.

    Raises FmuError if the FMU refuses one of these calls.
    """
    instance = fmu.instance
    try:
        instance.enter(fmu.references(start), list(start.values()), t0)
        state = instance.state()
        instance.leave()
    except CallFailed as error:
        raise FmuError(f"{fmu.name}: {error}") from error
    fmu.time = t0
    return address_of(state)


def forget(fmu: Fmu, state: int) -> None:
    """Free a saved state."""
    fmu.forget(c_void_p(state))


def reason(fmu: Fmu, status: int) -> str:
    """The reason why an instance refused a direct call; after a fatal failure it is not freed."""
    fmu.instance.failed("a raw call", status)
    said = fmu.instance.messages
    return said[-1] if said else f"the FMU returned status {status} without a reason"
