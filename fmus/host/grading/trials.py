"""The trials of `fmus.host.grading.check`: each runs an FMU and says in one sentence what came of it.

A module of its own because it is run as a process of its own.
"""

import json
import math
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np

from fmus.errors import BadInput
from fmus.host.apart.serving import limit_process
from fmus.host.archive import Archive, problems
from fmus.host.fmu import FmuError
from fmus.host.grading.bench import Bench, difference
from fmus.limits import MEMORY

Outcome: TypeAlias = tuple[bool | None, str]
RESTART = 1e-9  # relative; a restart may round where an uninterrupted run does not
CHANGES = "A run from the same start values does not repeat"
HIDDEN = "It has a hidden state"
SHARED = "Instances influence each other"


def is_valid(b: Bench) -> Outcome:
    """FMPy's validation of the model description."""
    found = problems(b.archive.path)
    if not found:
        return True, "Its model description is valid."
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return False, f"Its model description is not valid: {found[0].rstrip('.')}{more}."


def repeats(b: Bench) -> Outcome:
    """Reset, set states and parameters, initialise, run: twice the same to the last bit."""
    if not b.outputs:
        return False, "It has no output that is a number, so that nothing of it can be compared."
    with b.instance() as fmu:
        first, again = (b.from_start(fmu, b.half) for _ in range(2))
    gap = difference(b.outputs, first, again)
    if gap:
        return (
            False,
            f"{CHANGES}: {gap}; something survives the reset.",
        )
    if not np.isfinite(first).all():
        return False, "Its outputs are not finite from its own start values."
    return True, "A restart repeats a run exactly."


def restarts_anywhere(b: Bench, tolerance: float = RESTART) -> Outcome:
    """Restart from the states read in the middle of a run: it goes on as if never interrupted."""
    with b.instance() as fmu:
        b.from_start(fmu, b.half)
        t, states = fmu.time, dict(zip(b.states, fmu.read(b.states), strict=True))
        straight = b.run(fmu, b.half, 2 * b.half)
        fmu.restart(t, **{**b.start, **b.inputs(b.half), **states})
        restarted = b.run(fmu, b.half, 2 * b.half)
    gap = difference(b.outputs, straight, restarted, tolerance)
    shown = ", ".join(b.states)
    if not b.states and not gap:
        return None, "It shows no state that could be set before a start, and its outputs do not miss one."
    if not gap:
        return (
            True,
            f"A restart from its states goes on as if nothing had happened; no state is hidden ({shown}).",
        )
    if not b.states:
        return None, f"It shows no state that could be set before a start; a restart begins anew ({gap})."
    return False, f"{HIDDEN}: restarted from those it shows ({shown}) it differs, {gap}."


def instances_keep_apart(b: Bench) -> Outcome:
    """Three at once, stepped in turn with inputs of their own, against each alone."""
    if b.archive.description.once_per_process:
        return None, "It allows one instance in a process, and says so."
    scales = (1.0, 0.5, -0.5)
    with b.instance() as fmu:
        alone = [b.from_start(fmu, b.half, scale) for scale in scales]
    with b.instance() as one, b.instance() as two, b.instance() as three:
        several = list(zip((one, two, three), scales, strict=True))
        for fmu, scale in several:
            b.restart(fmu, scale)
        rows = [[b.run(fmu, k, k + 1, scale)[0] for fmu, scale in several] for k in range(b.half)]
    together = np.swapaxes(np.array(rows), 0, 1)
    for number, (expected, found) in enumerate(zip(alone, together, strict=True), 1):
        gap = difference(b.outputs, expected, found)
        if gap:
            return False, f"{SHARED}: of three at once, number {number} is off, {gap}."
    return True, "Three instances at once do not influence each other."


def saves_its_state(b: Bench) -> Outcome:
    """Save, go on, go back, go on again: the same to the last bit; also through bytes."""
    if not b.archive.description.saves_state:
        return None, "It does not offer to save and restore its state; a restart does that here."
    with b.instance() as fmu:
        b.from_start(fmu, b.short)
        t, state = fmu.time, fmu.save()
        straight = b.run(fmu, b.short, b.half)
        ways = {"going back to a saved state": state}
        if b.archive.description.serialises_state:
            ways["going back to a state saved as bytes"] = fmu.deserialised(fmu.serialised(state))
        for way, saved in ways.items():
            b.restart(fmu, -0.5)
            b.run(fmu, 0, b.short, -0.5)
            fmu.restore(saved)
            fmu.time = t
            gap = difference(b.outputs, straight, b.run(fmu, b.short, b.half))
            if gap:
                return False, f"What it saves is not all of its state: after {way} it differs, {gap}."
        for saved in ways.values():
            fmu.forget(saved)
    bytes_too = ", also as bytes" if len(ways) > 1 else "; as bytes it does not offer it"
    return True, f"It saves and restores all of its state{bytes_too}."


def takes_tunable_parameters(b: Bench) -> Outcome:
    """Each tunable parameter changed a little between two steps."""
    tunable = b.tunable()
    if not tunable:
        return None, "It has no tunable parameter."
    idle = []
    with b.instance() as fmu:
        base = b.from_start(fmu, b.short)
        late = base[b.short // 2 :]
        for name, value in tunable.items():
            b.from_start(fmu, b.short // 2)
            try:
                fmu.set(**{name: value})
                changed = b.run(fmu, b.short // 2, b.short)
            except FmuError as error:
                return (
                    False,
                    f"It refuses to change the tunable parameter '{name}' while running: {_said(error)}.",
                )
            if not difference(b.outputs, late, changed):
                idle.append(name)
        for name in idle:
            b.restart(fmu, 1.0, {name: tunable[name]})
            if difference(b.outputs, base, b.run(fmu, 0, b.short)):
                return False, f"It ignores a change of the tunable parameter '{name}' while running."
    acting = f"{len(tunable) - len(idle)} of {len(tunable)} change this short run"
    return True, f"It takes changes of its tunable parameters while running ({acting})."


def refuses_politely(b: Bench) -> Outcome:
    """NaN and a step back in time: refused with a reason, and a reset mends it."""
    name = next(iter([*b.tunable(), *b.description.inputs]), None)
    wrong: dict[str, tuple[dict[str, float], float]] = {"a step back in time": ({}, -b.dt)}
    if name:
        wrong[f"NaN in '{name}'"] = ({name: math.nan}, b.dt)
    taken, reasons = [], []
    with b.instance() as fmu:
        expected = b.from_start(fmu, b.short)
        for what, (values, dt) in wrong.items():
            b.from_start(fmu, b.short)
            try:
                fmu.set(**values)
                fmu.step(dt)
                taken.append(what)
            except FmuError as error:
                reasons.append(_said(error))
            try:
                again = b.from_start(fmu, b.short)
            except FmuError as error:
                return False, f"After {what} no reset helps: {_said(error)}."
            gap = difference(b.outputs, expected, again)
            if gap:
                return False, f"After {what} a reset does not bring back the run from its start: {gap}."
    if taken:
        return None, f"It takes {' and '.join(taken)} without a word; a reset mends it."
    return True, f"It refuses {' and '.join(wrong)} with a reason ({reasons[-1]}), and a reset mends it."


def _said(error: FmuError) -> str:
    return str(error).partition(": ")[2].rstrip(".")


TRIALS: dict[str, Callable[[Bench], Outcome]] = {
    "valid": is_valid,
    "repeatable": repeats,
    "restart": restarts_anywhere,
    "instances": instances_keep_apart,
    "saved state": saves_its_state,
    "tunable parameters": takes_tunable_parameters,
    "refusals": refuses_politely,
}


def main(path: str, results: str, first: str) -> None:
    """Write an outcome a line, as JSON, of the trials from number `first` on."""
    with Path(results).open("a", encoding="utf-8") as out:

        def write(**line: bool | str | None) -> None:
            out.write(json.dumps(line) + "\n")
            out.flush()

        try:
            with Archive(path) as archive:
                bench = Bench(archive)
                for title, trial in list(TRIALS.items())[int(first) :]:
                    passed, sentence = _outcome(trial, bench)
                    write(title=title, passed=passed, sentence=sentence)
        except BadInput as error:
            write(unusable=str(error))
        except MemoryError:
            sys.exit(f"it needs more than {MEMORY:g} GB of memory")
        except Exception:
            write(traceback=traceback.format_exc())


def _outcome(trial: Callable[[Bench], Outcome], bench: Bench) -> Outcome:
    try:
        return trial(bench)
    except FmuError as error:
        return False, f"It refused a call: {_said(error)}."


if __name__ == "__main__":
    limit_process(MEMORY)
    main(*sys.argv[1:])
