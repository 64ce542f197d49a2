"""A step of each model's native FMU, beside the generated C code alone, NumPy, and the PythonFMU build."""

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np

from benchmarks.group import Group, Row, Work, agreed
from benchmarks.peers.generated_c import Loops, begin, start_of
from benchmarks.timing import Run, in_turns
from fmus.contact.forces.laws import LAWS
from fmus.export.builders.hypotheses import ModelBuilder
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from fmus.models import MODELS
from fmus.variables import State
from fmus.wheelset.model import Wheelset

NAMES = ("testrig", "vehicle7dof", "wheelset")
DT, COPIES, SETTLED = (
    1e-3,
    15,
    200,
)  # s, no longer than an internal step; instances, as for seven unknowns of a filter; steps
TANH, BARE, PYTHON = "np.tanh of 1000 numbers", "bare generated C", "PythonFMU build"
NUMBERS, CALLS = np.linspace(-2.0, 2.0, 1000), 2000
FOUND = np.empty_like(NUMBERS)
SAME = 1e-6  # of the largest state: the tolerance of an internal step, of which the FMU may split the first


class StepGroup(Group):
    """Communication steps of 1 ms, called from C."""

    name = "step"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        steps = work.of(20000, 1000)
        for name in NAMES:
            with Fmu(work.fmu(name)) as fmu:
                loops = Loops.of(MODELS[name](), work.folder / f"loops_{name}")
                yield from _model(name, fmu, loops, steps, work.of(15, 3))
                if name == "wheelset":
                    yield from _laws(fmu, loops, work.of(2000, 100), work.of(9, 3))
                yield _rows(name, fmu, loops, steps)
            yield _laws_off(name, work, steps)
            yield _restarts(name, loops, work)


def _model(name: str, fmu: Fmu, loops: Loops, steps: int, rounds: int) -> Iterator[Row]:
    """The step beside the unit of the machine's speed and beside the bare code."""
    model = MODELS[name]()
    (x, u, p), states = begin(model), [v.name for v in model.of(State)]
    start = start_of(model)
    loops.steps(fmu, start, DT, 100)
    agreed(np.array(fmu.read(states)), loops.bare(x, u, p, DT, 100), SAME, f"{name}, bare generated C")
    times = in_turns(
        {
            "ours": lambda: loops.steps(fmu, start, DT, steps),
            BARE: lambda: loops.bare(x, u, p, DT, steps),
            TANH: tanh,
        },
        rounds,
    )
    per = 1e6 / steps
    how = "doStep of 1 ms of the native FMU, called from C"
    yield times.row(
        f"{name}: step", "ours", TANH, "µs", f"{how}; one call of NumPy on one core", factor=per,
        peer_factor=1e6 / CALLS,
    )  # fmt: skip
    yield times.row(
        f"{name}: step", "ours", BARE, "µs",
        f"{how}; CasADi's C code of the step function alone, same compiler and flags", factor=per,
    )  # fmt: skip


def tanh() -> None:
    """The unit of the machine's speed, into the same memory each time."""
    for _ in range(CALLS):
        np.tanh(NUMBERS, out=FOUND)


def _laws(fmu: Fmu, loops: Loops, steps: int, rounds: int) -> Iterator[Row]:
    """The wheelset's step with each creep law beside that with the default."""
    default = next(n for n, law in LAWS.items() if law.code == Wheelset.creep_law.start)
    start = start_of(Wheelset())

    def run(law: str) -> Run:
        return lambda: loops.steps(fmu, {**start, "creep_law": float(LAWS[law].code)}, DT, steps)

    times = in_turns({law: run(law) for law in LAWS}, rounds)
    for law in LAWS:
        if law != default:
            how = f"doStep of 1 ms of the native FMU with creep law {law}, and with the default, {default}"
            yield times.row(f"wheelset: step with {law}", law, default, "µs", how, factor=1e6 / steps)


def _rows(name: str, fmu: Fmu, loops: Loops, steps: int) -> Row:
    """Rows of values side by side through a record in one call, beside steps of one instance."""
    start, t = start_of(MODELS[name]()), DT * np.arange(steps + 1)
    states = [v.name for v in MODELS[name]().of(State)]
    found = fmu.simulate_rows(t[:101], {}, states, [start] * fmu.at_once)
    loops.steps(fmu, start, DT, 100)
    agreed(
        np.array([] if found is None else found[-1, -1]), np.array(fmu.read(states)), SAME, f"{name}, rows"
    )
    times = in_turns(
        {
            "ours": lambda: fmu.simulate_rows(t, {}, states[:1], [start] * fmu.at_once),
            "one instance": lambda: loops.steps(fmu, start, DT, steps),
        },
        9,
    )
    how = (
        f"{fmu.at_once} rows through {steps} steps of 1 ms in one call; doStep of one instance, called from C"
    )
    return times.row(
        f"{name}: row and step", "ours", "one instance", "µs", how, factor=1e6 / steps / fmu.at_once,
        peer_factor=1e6 / steps,
    )  # fmt: skip


def _laws_off(name: str, work: Work, steps: int) -> Row:
    """Rows of the library in which close-loop looks for effects, all of them off, beside the model alone."""
    build = ModelBuilder(name, work.folder / f"laws_{name}")
    start, t = start_of(MODELS[name]()), DT * np.arange(steps + 1)
    with Fmu(build(())) as alone, Fmu(build(build.offers[:1])) as library:
        asked = [v.name for v in MODELS[name]().of(State)]
        rows = [start] * alone.at_once
        found = [fmu.simulate_rows(t[:101], {}, asked, rows) for fmu in (library, alone)]
        agreed(np.array(found[0]), np.array(found[1]), SAME, f"{name}, laws off")
        times = in_turns(
            {
                "ours": lambda: library.simulate_rows(t, {}, asked[:1], rows),
                "without effects": lambda: alone.simulate_rows(t, {}, asked[:1], rows),
            },
            9,
        )
    how = f"{len(rows)} rows through {steps} steps of 1 ms; the library with effects that are off, and none"
    return times.row(
        f"{name}: row with effects that are off", "ours", "without effects", "µs", how,
        factor=1e6 / steps / len(rows),
    )  # fmt: skip


def _restarts(name: str, loops: Loops, work: Work) -> Row:
    """Restarts of several instances, as for the sigma points of a filter."""
    model, times = MODELS[name](), work.of(20, 2)
    start = start_of(model)
    with ExitStack() as stack:
        runs = {}
        for label, build in (("ours", "native"), (PYTHON, "PythonFMU")):
            archive = stack.enter_context(Archive(work.fmu(name, build)))
            fmus = [stack.enter_context(Fmu(archive)) for _ in range(COPIES)]
            # from a motion that has settled: at the first instant the rig takes ten times the internal steps
            loops.steps(fmus[0], start, DT, SETTLED)
            start = {n: fmus[0][n] for n in start}
            runs[label] = loops.restarts(fmus, start, DT, times)
        how = f"{COPIES} instances, called from C: reset, set all, initialise, step of 1 ms, read"
        return in_turns(runs, work.of(9, 3)).row(
            f"{name}: restart and step", "ours", PYTHON, "µs", how, factor=1e6 / times
        )
