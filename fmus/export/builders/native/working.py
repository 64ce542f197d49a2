"""Native FMUs for simulations by railfmi itself: quick to compile, libraries kept for the next record."""

import zipfile
from pathlib import Path

from fmus.export.builders.native.build import NO_TOKEN, identified, packed
from fmus.export.builders.native.code import sources
from fmus.export.builders.native.compilers import host
from fmus.export.builders.native.description2 import description2
from fmus.export.builders.native.libraries import library
from fmus.export.builders.native.table import table
from fmus.files import write_at_once
from fmus.model import Model, equations, joins

CALLED_BY_LANES = ("lanes_object.c", "lanes_called.c", "lanes.h", "quick.c")


def build_working(model: Model, out: Path, in_rows: bool = False) -> Path:
    """Write the file `out`, an FMI 2.0 FMU of a model for this machine, and return its path.

    in_rows: whether it will be simulated in rows (see Fmu.simulate_rows); an instance of its own takes longer
    then, and the library is compiled sooner.

    It computes the same numbers as the FMU of build_native, to the last bit. Directional derivatives,
    sources, page and record of provenance are left out, and nothing is compressed. Its library is taken
    from the user's cache folder if the same sources were compiled before. BadInput without a compiler.
    """
    made = equations(model)
    about = table(model, made)
    code = sources(about, made, 2, NO_TOKEN, working=True, in_rows=in_rows, joins=joins(model))
    files = identified(
        description2(about, NO_TOKEN, complete=False) | {n: text.encode() for n, text in code.items()}
    )
    apart = CALLED_BY_LANES if code.get("lanes_called.c") else ()
    built = library({name: files.pop(name) for name in code}, "fmu.c", apart=apart)
    files[f"binaries/{host().folder(2)}/{model.name}{host().suffix}"] = built
    write_at_once(out, packed(files, zipfile.ZIP_STORED))
    return out
