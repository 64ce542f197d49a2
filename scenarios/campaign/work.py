"""What a worker does with one point of a campaign: simulate the scenario, and measure."""

import os
from collections.abc import Mapping
from contextlib import ExitStack
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.host.apart.isolation import Isolation
from fmus.host.apart.room import closing_rooms
from scenarios.experiment.validation import of_file, read_table
from scenarios.simulating.building import Builder
from scenarios.simulating.case import prepared
from scenarios.simulating.declaration import Declaration
from scenarios.simulating.expression import expression
from scenarios.tasks.running import Place, may_pass
from scenarios.tasks.store import FAILED, Answer


def simulated(given: Mapping[str, Any], place: Place) -> Answer:
    """The answer of a point: its measures, or the reason why there are none.

    given: `table` (the scenario with the values of the point), `file`, `measure`, `fmus` (checksums by name)
    and `isolation`. Raises the error of a reason that may pass.
    """
    try:
        values = _measured(given, place)
        missing = [name for name, value in values.items() if value is None]
        reason = f"not finite: {', '.join(missing)}" if missing else ""
        return {"verdict": "done", "values": values, "reason": reason}
    except Exception as error:  # whatever one point does, it is one row
        if may_pass(error):
            raise
        said = str(error) if isinstance(error, BadInput) else f"{type(error).__name__}: {error}"
        return {"verdict": FAILED, "reason": place.without(" ".join(said.split())), "values": {}}


@cache
def _builder(builds: Path) -> Builder:
    """The builder of this process, which builds each FMU once."""
    folder = builds / f"process-{os.getpid()}"
    folder.mkdir(parents=True, exist_ok=True)
    return Builder(folder)


def _measured(given: Mapping[str, Any], place: Place) -> dict[str, float | None]:
    """The measures by name; None for one that is not finite."""
    file = Path(given["file"])
    isolation = Isolation(**given["isolation"]) if given["isolation"] else None
    with of_file(file):
        d = _shipped(read_table(Declaration, given["table"]), given["fmus"], place)
        formulas = {name: expression(text, f"measure '{name}'") for name, text in given["measure"].items()}
        with ExitStack() as stack:
            stack.enter_context(closing_rooms())
            case = prepared(d, file, formulas.values(), _builder(place.builds), stack, isolation)
            signals = case.run(None).signals
            found = {}
            for name, formula in formulas.items():
                value = formula.value(lambda signal: signals[signal])
                if value.is_signal:
                    raise BadInput(f"{formula.where} is a signal; measure its max, rms, last ...")
                found[name] = value.number()
    return {name: value if isfinite(value) else None for name, value in found.items()}


def _shipped(d: Declaration, fmus: Mapping[str, str], place: Place) -> Declaration:
    """The scenario with the FMUs that were shipped in place of those beside its file."""
    members = {}
    for name, member in d.fmus.items():
        checksum = fmus.get(member.fmu or "")
        other = {"fmu": str(place.fmu(checksum))} if checksum else {}
        members[name] = member.model_copy(update=other)
    return d.model_copy(update={"fmus": members})
