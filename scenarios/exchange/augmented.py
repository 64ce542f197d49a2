"""Write a foreign FMU and the effects found as an SSP package with the inputs of the experiment."""

import tempfile
from collections.abc import Iterator, Mapping
from itertools import chain
from math import ceil, floor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from estimator.record import Array, Record
from fmus.errors import BadInput
from fmus.export.around.effects_alone import EffectsAlone, Plugs
from fmus.export.builders.hypotheses import Effects, ForeignBuilder
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.export.provenance import Origin
from fmus.host.archive import describe
from fmus.host.description import FmuDescription
from scenarios.exchange.exporting import export_ssp
from scenarios.exchange.form import Kind
from scenarios.exchange.toml_text import toml_text
from scenarios.simulating.expression import in_formula

BASE, EFFECTS = "base", "effects"  # members of the system
TIME, DATA = "time", "record.csv"
MOST = 200_000  # numbers of the inputs that go into the package; a longer record is cut


def export_augmented(
    builder: ForeignBuilder,
    effects: Effects,
    record: Record,
    starts: Mapping[str, float],
    origin: Origin,
    out: Path,
) -> Path:
    """Write a package of the FMU and an FMU of the effects (kind, location) to `out`; returns its path.

    The package simulates the experiment's first record from its beginning.
    starts: start values by their names in the augmented FMU; origin: the experiment and its estimates.
    Raises BadInput if an effect changes a parameter during the run, as SSP cannot connect to parameters.
    """
    t = record.runs[0].t
    step = coupling_step(t, builder.coupling)
    model = builder.alone(effects, starts, step)
    with tempfile.TemporaryDirectory(prefix="railfmi_augmented_") as work:
        folder = Path(work)
        fmu, kind = _built(model, folder, origin)
        table = _scenario(builder.fmu, model, record, starts, step) | {"id": out.stem}
        table["fmus"] |= {EFFECTS: {"fmu": str(fmu)}} if model.plugs.through else {}
        u = pd.DataFrame(record.runs[0].u, columns=list(record.inputs))
        u.insert(0, TIME, t - t[0])
        u.to_csv(folder / DATA, index=False)
        file = folder / "scenario.toml"
        file.write_text(toml_text(table), encoding="utf-8")
        return export_ssp(file, out, kind)


def coupling_step(t: Array, longest: float) -> float:
    """Longest whole part of a sampling step, s, over which the FMU that carries the effects couples too."""
    sample = float(f"{np.median(np.diff(t)):.9g}")
    return sample / ceil(sample / longest - 1e-9)


def _built(model: EffectsAlone, folder: Path, origin: Origin) -> tuple[Path, Kind]:
    """The FMU of the effects: native, or a PythonFMU build if there is no compiler."""
    try:
        return build_native(model, folder, origin=origin), "native"
    except BadInput:
        return build_python(model, folder, origin), "python"


def _scenario(
    fmu: Path, model: EffectsAlone, record: Record, starts: Mapping[str, float], step: float
) -> dict[str, Any]:
    """The scenario of the first record, but for its name and the FMU of the effects."""
    t, base, plugs = record.runs[0].t, describe(fmu), model.plugs
    longest = MOST // (2 * max(len(record.inputs), 1)) * step
    outputs = [name for name in record.outputs if name in base.outputs]
    written = {name: in_formula(f"{BASE}.{name}") for name in outputs}
    panels = [{"draw": [written[name]], "label": name} for name in outputs]
    expected = [
        {"that": f"max(abs({written[name]})) < 1e300", "because": f"{name} stays finite"} for name in outputs
    ]
    return {
        "question": f"How does {base.name} behave with the effects found: {model.about}?",
        "duration": step * max(1, floor(min(t[-1] - t[0], longest) / step)),  # never past the record
        "step": step,
        "fmus": {BASE: _member(fmu, base, {**starts, **plugs.constant})},
        "connections": [*_wires(plugs)],
        "inputs": dict(chain.from_iterable(_inputs(plugs, name, u) for name, u in _columns(record))),
        "expect": expected,
        "figure": [{"name": "outputs", "title": f"{base.name} with the effects", "panels": panels}],
    }


def _member(fmu: Path, base: FmuDescription, values: Mapping[str, float]) -> dict[str, Any]:
    return {
        "fmu": str(fmu.resolve()),
        "parameters": {n: v for n, v in values.items() if n in base.parameters},
        "initial": {n: v for n, v in values.items() if n in base.states},
    }


def _wires(plugs: Plugs) -> Iterator[dict[str, Any]]:
    """Motion there, and back what acts; the motion is that before new inputs, as no port jumps with them."""
    for name in plugs.motion:
        yield {"from": f"{BASE}.{name}", "to": f"{EFFECTS}.{name}", "delayed": True}
    for name in plugs.through:
        yield {"from": f"{EFFECTS}.{name}", "to": f"{BASE}.{name}"}


def _columns(record: Record) -> Iterator[tuple[str, Array]]:
    return zip(record.inputs, record.runs[0].u.T, strict=True)


def _inputs(plugs: Plugs, name: str, u: Array) -> Iterator[tuple[str, Any]]:
    """The signal that drives an input, for each member that has this input."""
    given: Any = float(u[0]) if np.ptp(u) == 0 else {"data": DATA, "time": TIME, "column": name}
    if name in plugs.through:
        yield f"{EFFECTS}.{plugs.through[name]}", given
        return
    yield f"{BASE}.{name}", given
    if name in plugs.shared:
        yield f"{EFFECTS}.{name}", given
