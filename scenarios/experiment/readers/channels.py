"""Files with groups of channels and several times: the channels of one time become a sheet."""

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from numpy.typing import NDArray

from fmus.errors import BadInput
from fmus.taken import NUMBER, check_record
from scenarios.experiment.readers.sheet import Sheet


@dataclass(frozen=True)
class Channel:
    """A channel that is loaded only when it is needed.

    rasters: keys that are equal for channels with the same rows; group: empty if the file has no groups.
    begin: of a time channel, the date of 0 s where the file tells it.
    """

    name: str
    rows: int
    rasters: frozenset[Hashable]
    load: Callable[[], NDArray[Any]]  # (rows,)
    group: str = ""
    unit: str | None = None
    begin: pd.Timestamp | None = None

    @property
    def full_name(self) -> str:
        """The name with its group, for use if the name alone is ambiguous."""
        return f"{self.group}/{self.name}" if self.group else self.name


Named = Mapping[str, Sequence[Channel]]


def sheet_of(
    file: Path, channels: Sequence[Channel], time: str | None, columns: Collection[str] | None
) -> Sheet:
    """The channels with the same rows as `time`; without `time`, all channels must have the same rows."""
    named = _by_name(channels)
    axis = _axis(file, channels, named, time)
    if axis is None:
        return Sheet(file, pd.DataFrame(), tuple(named))
    found, apart = {}, {}
    for name in _names(channels) if columns is None else columns:
        here = [c for c in named.get(name, ()) if c.rasters & axis.rasters]
        if name == time:
            found[name] = axis
        elif len(here) > 1:
            raise BadInput(_ambiguous(file, "column", name, here))
        elif here:
            found[name] = here[0]
        elif name in named:
            rows = f"{named[name][0].rows} rows of its own, '{axis.full_name}' has {axis.rows}"
            apart[name] = f"is not sampled at the times named ({rows}); resample it to them"
    check_record(file, NUMBER * axis.rows * len(found))
    loaded = {name: c.load() for name, c in found.items()}
    single = {name: x for name, x in loaded.items() if x.ndim == 1 and x.dtype.names is None}
    apart |= dict.fromkeys(loaded.keys() - single.keys(), "holds an array in each row, and no single number")
    units = {name: c.unit for name, c in found.items() if c.unit}
    begins = {name: c.begin for name, c in found.items() if c.begin is not None}
    return Sheet(file, pd.DataFrame(single), tuple(named), units, apart, begins)


def _by_name(channels: Sequence[Channel]) -> Named:
    """Channels by name alone and by name with group."""
    named: dict[str, list[Channel]] = {}
    for c in channels:
        for name in dict.fromkeys((c.name, c.full_name)):
            named.setdefault(name, []).append(c)
    return named


def _names(channels: Sequence[Channel]) -> list[str]:
    """A name for each channel, with its group if the name alone is ambiguous."""
    plain = [c.name for c in channels]
    return [c.name if plain.count(c.name) == 1 else c.full_name for c in channels]


def _axis(file: Path, channels: Sequence[Channel], named: Named, time: str | None) -> Channel | None:
    """The channel that determines the rows: the time channel, if there is exactly one of this name."""
    if time is not None:
        found = named.get(time, ())
        if found and not frozenset.intersection(*(c.rasters for c in found)):
            raise BadInput(_ambiguous(file, "time", time, found))
        return found[0] if found else None
    if not channels:
        raise BadInput(f"{file}: holds no channel of numbers; record some")
    if not frozenset.intersection(*(c.rasters for c in channels)):
        raise BadInput(
            f"{file}: its channels have several times; export the channels that you need with one common time"
        )
    return channels[0]


def _ambiguous(file: Path, what: str, name: str, found: Sequence[Channel]) -> str:
    places = list(dict.fromkeys(c.full_name for c in found))
    if len(places) == 1:
        return f"{file}: {what} '{name}' stands {len(found)} times in one group with different rows; keep one"
    listed = ", ".join(f"'{place}'" for place in places[:6]) + (", ..." if len(places) > 6 else "")
    return f"{file}: {what} '{name}' may be {listed}; give the full name"
