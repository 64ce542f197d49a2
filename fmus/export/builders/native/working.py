"""Native FMUs for simulations by railfmi itself: quick to compile, libraries kept for the next record."""

import zipfile
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from fmus.effects.effect import Effect
from fmus.effects.site import CLOCK, WAY
from fmus.export.builders.native.build import NO_TOKEN, identified, packed
from fmus.export.builders.native.code import sources
from fmus.export.builders.native.compilers import command, host
from fmus.export.builders.native.description2 import description2
from fmus.export.builders.native.libraries import library
from fmus.export.builders.native.table import Table, table
from fmus.files import write_at_once
from fmus.model import Model, equations, joins, step_alone
from fmus.variables import Parameter, State

TOKEN = "token"  # a file beside the sources, which becomes what these are known by
CALLED_BY_LANES = ("lanes_object.c", "lanes_called.c", "lanes.h", "quick.c")


@dataclass(frozen=True)
class Working:
    """A model's library for this machine, with what describes it and what its code is known by."""

    table: Table
    token: str
    library: bytes
    brought: Mapping[str, tuple[type[Effect], str] | None]  # see Site.brought

    @classmethod
    def of(cls, model: Model, in_rows: bool = False) -> "Working":
        """See build_working."""
        command(None, [host()])  # without a compiler the work would be for nothing
        made = equations(model)
        about = table(model, made)
        by = _switches(model) if model.switched else []
        own = next((k for k, (first, end) in enumerate(by) if first < end), len(by))
        alone = step_alone(model, made, own) if joins(model) and 0 < own < len(by) else None
        code = sources(
            about, made, 2, NO_TOKEN,
            working=True, in_rows=in_rows, joins=joins(model), switched_by=by, alone=alone,
        )  # fmt: skip
        sealed = {n: text.encode() for n, text in code.items()} | {TOKEN: NO_TOKEN.encode()}
        sealed = identified(description2(about, NO_TOKEN, complete=False) | sealed)
        apart = CALLED_BY_LANES if code.get("lanes_called.c") else ()
        built = library({name: sealed[name] for name in code}, "fmu.c", apart=apart)
        return cls(about, sealed[TOKEN].decode(), built, model.brought)

    def write(self, out: Path, effects: Collection[tuple[type[Effect], str]] | None = None) -> None:
        """Write it as an FMU; effects: of those that it has, the ones that are known outside, by default all.

        The library is the same then; it keeps the others off.
        """
        about = self.table
        if effects is not None:
            idle = {CLOCK.name, WAY.name} - {name for effect, _ in effects for name in effect.asks}
            if any(effect.of_way for effect, _ in effects):
                idle.discard(WAY.name)
            gone = [n for n, by in self.brought.items() if n in idle or (by and by not in effects)]
            about = about.without(gone, [f"{effect.kind}@{place}" for effect, place in effects])
        files = description2(about, self.token, complete=False)
        files[f"binaries/{host().folder(2)}/{about.name}{host().suffix}"] = self.library
        write_at_once(out, packed(files, zipfile.ZIP_STORED))


def build_working(model: Model, out: Path, in_rows: bool = False) -> Path:
    """Write the file `out`, an FMI 2.0 FMU of a model for this machine, and return its path.

    in_rows: whether it will be simulated in rows (see Fmu.simulate_rows); an instance of its own takes longer
    then, and the library is compiled sooner.

    It computes the same numbers as the FMU of build_native, to the last bit. Directional derivatives,
    sources, page and record of provenance are left out, and nothing is compressed. Its library is taken
    from the user's cache folder if the same sources were compiled before. BadInput without a compiler.
    """
    Working.of(model, in_rows).write(out)
    return out


def _switches(model: Model) -> list[tuple[int, int]]:
    """See `sources`; an effect declares its amplitudes one after the other."""
    amplitudes: dict[tuple[type[Effect], str], list[int]] = {}
    for k, v in enumerate(model.settable()):
        by = model.brought.get(v.name)
        if (
            by
            and isinstance(v, Parameter)
            and by[0].is_amplitude(v.name.removeprefix(by[0].name_at(by[1], "")))
        ):
            amplitudes.setdefault(by, []).append(k)
    found = (amplitudes.get(by) if (by := model.brought.get(v.name)) else None for v in model.of(State))
    return [(min(own), max(own) + 1) if own else (0, 0) for own in found]
