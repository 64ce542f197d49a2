"""MDF files of measuring and bus-logging systems, up to version 4: each group has a master channel."""

from collections.abc import Collection, Iterator
from functools import partial
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from traceback import walk_tb
from typing import Any, BinaryIO, ClassVar

import numpy as np
from numpy.typing import NDArray

from fmus.errors import BadInput
from fmus.taken import NUMBER, check_record
from scenarios.experiment.readers.channels import Channel, sheet_of
from scenarios.experiment.readers.reader import Reader, library
from scenarios.experiment.readers.sheet import Sheet


class Mdf(Reader):
    """Channels share their rows if their master channels are equal, in one group or in several."""

    kind: ClassVar[str] = "MDF"
    suffixes: ClassVar[tuple[str, ...]] = (".mf4", ".mdf")

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """All master channels are read for comparison, and only those other channels that are needed."""
        asammdf = library("asammdf", "asammdf", file)
        with file.open("rb") as stream, _opened(asammdf, stream, options) as source:
            groups = range(len(source.groups))
            for group in source.groups:  # their master channels are read whatever is wanted
                about = group.channel_group
                check_record(file, about.cycles_nr * max(about.samples_byte_nr, NUMBER))
            return sheet_of(file, [c for g in groups for c in _channels(file, source, g)], time, columns)


def _opened(asammdf: Any, stream: BinaryIO, options: dict[str, Any]) -> Any:
    """The library's object of a file.

    What numexpr does not take of a formula in the file, the library hands to SymPy where that is installed,
    which runs it as a program. It is kept from that.
    """
    for blocks in ("v4_blocks", "v2_v3_blocks"):
        import_module(f"asammdf.blocks.{blocks}").lambdify = None  # type: ignore[attr-defined]
    try:
        return asammdf.MDF(stream, **options)
    except Exception as error:
        # its object of a broken file fails once more when it is collected, and says so on the screen
        for frame, _ in walk_tb(error.__traceback__):
            half: Any = frame.f_locals.get("self")
            if type(half).__name__ == "MDF4":
                half.header = half.identification = None
        raise


def _channels(file: Path, source: Any, g: int) -> Iterator[Channel]:
    """The channels of group number g, its master among them."""
    if g in source.masters_db:
        _check_formulas(file, source.groups[g].channels[source.masters_db[g]])
    master = source.get_master(g)
    if not len(master):
        return
    raster = blake2b(master.tobytes()).digest()
    # version 3 has no names of groups, and in version 4 they may be left out
    group = getattr(source.groups[g].channel_group, "acq_name", None) or f"group {g}"
    for i, channel in enumerate(source.groups[g].channels):
        unit = source.get_channel_unit(group=g, index=i) or None
        load = partial(_values, file, source, g, i)
        yield Channel(channel.name, len(master), frozenset({raster}), load, group, unit)


def _values(file: Path, source: Any, g: int, i: int) -> NDArray[Any]:
    """The samples of channel i in group g (N,), nan where the file calls them invalid."""
    _check_formulas(file, source.groups[g].channels[i])
    # unless they are ignored there, the library leaves invalid samples out
    signal = source.get(group=g, index=i, ignore_invalidation_bits=True)
    values = np.asarray(signal.samples)
    if signal.invalidation_bits is None or values.dtype.kind not in "biuf":
        return values
    return np.where(signal.invalidation_bits, np.nan, values)


def _check_formulas(file: Path, channel: Any) -> None:
    """Raise BadInput for a conversion that is no arithmetic, for which the library would give raw values."""
    validate = library("numexpr", "asammdf", file).validate
    sample, waiting = np.zeros(1), [getattr(channel, "conversion", None)]
    known = {"X": sample, "X1": sample, "INF": np.inf, "NaN": np.nan}
    while waiting:
        block = waiting.pop()
        formula = getattr(block, "formula", "")
        if formula and validate(formula, known, {}) is not None:
            raise BadInput(
                f"{file}: channel '{channel.name}': its formula '{formula[:60]}' is no arithmetic of X, and "
                "cannot be evaluated; write it like 2*X**2 + 1, or export physical values"
            )
        waiting += (getattr(block, "referenced_blocks", None) or {}).values()
