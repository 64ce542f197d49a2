"""A simulation of a foreign native FMU as close-loop makes it, beside the FMU's own calls from C."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.group import Group, Row, Work, agreed
from benchmarks.peers.bare_calls import BareCalls
from benchmarks.timing import Times, in_turns
from estimator.record import Array
from fmus.drive.model import Drive
from fmus.export.around.outside import laws
from fmus.export.builders.hypotheses import Effects, ForeignBuilder, ModelBuilder
from fmus.export.builders.native.build import build_native
from fmus.host.archive import describe
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu

DT = 1e-3  # s, as long as a coupling step
SAME = 1e-12  # of the largest value of an output: both set the same inputs and make the same steps
STEPS, CALLS = "its doStep alone, from C", "its set, doStep and get, from C"
OURS, LAW = "ours", "the law alone, from C"
EFFECTS = {"coulomb_friction": "F_c", "hysteresis": "F_h"}  # without memory and with it; the size of each
SIZE = 20.0  # N


@dataclass(frozen=True)
class Foreign:
    """An FMU as from outside: its file, its ports, the inputs that are driven, the outputs that are read."""

    title: str
    fmu: Path
    ports: tuple[PortNames, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


class ForeignGroup(Group):
    """Communication steps of 1 ms; the FMU stays open, so that unpacking and loading are not timed."""

    name = "foreign"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        for k, foreign in enumerate(_all(work)):
            folder = work.folder / f"foreign_{k}"
            builder = ForeignBuilder(foreign.fmu, foreign.ports, folder / "builds")
            yield from _without(foreign, ForeignBuilder(foreign.fmu, (), folder), "its file", work)
            yield from _without(foreign, builder, "no effect at its port", work)
            for kind in EFFECTS:
                yield from _with(foreign, builder, kind, work)


def _all(work: Work) -> Iterator[Foreign]:
    """A drive whose step costs next to nothing, by both versions of FMI; a vehicle; a wheelset."""
    port, folder = PortNames("carriage", "F_ext", "q_dot", "q"), work.folder / "foreign"
    for fmi in (2, 3):
        path = build_native(Drive(), folder / f"drive{fmi}.fmu", fmi=fmi)
        yield Foreign(f"drive, FMI {fmi}", path, (port,), ("F",), ("q", "q_dot", "q_ddot"))
    vehicle, wheelset = (ModelBuilder(name, folder / name) for name in ("vehicle7dof", "wheelset"))
    inputs = tuple(f"u_{wheel}{of}" for wheel in ("fl", "fr", "rl", "rr") for of in ("", "_dot"))
    yield Foreign("vehicle, FMI 2", vehicle(()), vehicle.ports[:1], inputs, ("z1", "phi_y1", "phi_x1"))
    inputs, outputs = ("y_irr", "y_irr_dot"), ("y", "psi", "y_dot", "psi_dot")
    yield Foreign("wheelset, FMI 2", wheelset(()), wheelset.ports[:1], inputs, outputs)


def _inputs(foreign: Foreign, t: Array) -> dict[str, Array]:
    """Every driven input a wave of its own, of the size of its nominal value."""
    known = describe(foreign.fmu).variables
    return {
        name: (known[name].nominal or 1.0) * np.sin((20 + 3 * k) * t + k)
        for k, name in enumerate(foreign.inputs)
    }


def _without(foreign: Foreign, builder: ForeignBuilder, title: str, work: Work) -> Iterator[Row]:
    """Without an effect, beside the steps alone and beside all calls that a master has to make."""
    bare = BareCalls.of(laws(describe(foreign.fmu), (), ()), work.folder / f"calls_{foreign.title}_{title}")
    yield from _rows(foreign, builder, (), {}, title, bare, work)


def _with(foreign: Foreign, builder: ForeignBuilder, kind: str, work: Work) -> Iterator[Row]:
    """With an effect at the first port; the cost of its law alone is taken off."""
    port = foreign.ports[0].name
    effects = ((kind, port),)
    made = laws(describe(foreign.fmu), foreign.ports, effects)
    bare = BareCalls.of(made, work.folder / f"calls_{foreign.title}_{kind}")
    values = {f"{kind}_{port}_{EFFECTS[kind]}": SIZE}
    yield from _rows(foreign, builder, effects, values, f"{kind} apart from its law", bare, work)


def _rows(
    foreign: Foreign, builder: ForeignBuilder, effects: Effects, values: dict[str, float], title: str,
    bare: BareCalls, work: Work,
) -> Iterator[Row]:  # fmt: skip
    t: Array = np.arange(work.of(20000, 1000) + 1) * DT
    inputs, outputs = _inputs(foreign, t), foreign.outputs
    held = {name: samples[:-1] for name, samples in inputs.items()}
    first = {name: float(samples[0]) for name, samples in inputs.items()}
    motion = [name for p in foreign.ports[:1] for name in p.motion]
    with Fmu(foreign.fmu) as alone, Fmu(builder(effects)) as fmu:
        found = fmu.simulate(t, held, outputs, {})[1:]
        agreed(found, bare.simulate(alone, t, held, outputs), SAME, f"{foreign.title}, {title}, {CALLS}")
        runs = {
            OURS: lambda: fmu.simulate(t, inputs, outputs, values),
            STEPS: lambda: bare.steps(alone, t, first),
            CALLS: lambda: bare.simulate(alone, t, held, outputs),
        }
        if effects:
            moved = np.ascontiguousarray(fmu.simulate(t, inputs, motion, values))
            z = np.array(fmu.read([*fmu.description.variables]))
            runs[LAW] = lambda: bare.arithmetic(moved, z, DT)
        times = dict(in_turns(runs, work.of(25, 3)).by_label)
    times[OURS] = times[OURS] - times.pop(LAW, 0.0)
    how = f"{len(inputs)} sampled inputs, {len(outputs)} outputs, steps of 1 ms; per step"
    for peer in (STEPS, CALLS):
        name = f"{foreign.title}: simulation, {title}"
        yield Times(times).row(name, OURS, peer, "µs", how, factor=1e6 / (len(t) - 1))
