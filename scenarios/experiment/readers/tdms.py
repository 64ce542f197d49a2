"""TDMS files of LabVIEW and DIAdem: channels in groups, with a time channel or the times of a waveform."""

from collections.abc import Collection, Hashable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import pandas as pd

from scenarios.experiment.readers.channels import Channel, sheet_of
from scenarios.experiment.readers.reader import Reader, library
from scenarios.experiment.readers.sheet import Sheet

IMPLICIT = "time"  # the name of the times of waveforms, which have no channel
UNIT_KEYS = ("unit_string", "NI_UnitDescription")  # properties of a channel
UNSET = 1904  # the year in which the dates of LabVIEW begin
WAVEFORM = ("wf_increment", "wf_start_offset", "wf_start_time")  # what alike waveforms have in common


class Tdms(Reader):
    """Channels of a group with equal length share their rows, and so do waveforms with equal times.

    The times of waveforms become the column 'time' of their group, in s, unless the group already has one.
    Where a waveform has a start time, that is the date of 0 s, by which those of one file are put together.
    """

    kind: ClassVar[str] = "TDMS"
    suffixes: ClassVar[tuple[str, ...]] = (".tdms",)

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """Only the channels wanted are read from the disk."""
        nptdms = library("nptdms", "nptdms", file)
        with file.open("rb") as stream, nptdms.TdmsFile.open(stream, **options) as source:
            return sheet_of(file, [c for group in source.groups() for c in _channels(group)], time, columns)


def _channels(group: Any) -> Iterator[Channel]:
    """The channels of a group and the times of its waveforms, one for each kind of waveform."""
    implicit: dict[Hashable, Channel] = {}
    for c in group.channels():
        rasters: set[Hashable] = {(group.name, len(c))}
        if c.properties.get("wf_increment"):
            waveform = (*(c.properties.get(key) for key in WAVEFORM), len(c))
            rasters.add(waveform)
            begin = _begin(c.properties.get("wf_start_time"))
            times = Channel(IMPLICIT, len(c), frozenset({waveform}), c.time_track, group.name, "s", begin)
            implicit.setdefault(waveform, times)
        unit = next((str(c.properties[key]) for key in UNIT_KEYS if c.properties.get(key)), None)
        yield Channel(c.name, len(c), frozenset(rasters), c.read_data, group.name, unit)
    if IMPLICIT not in (c.name for c in group.channels()):
        yield from implicit.values()


def _begin(start: Any) -> "pd.Timestamp | None":
    """The start time of a waveform; None where nobody has set it."""
    date = pd.to_datetime(start)
    return date if date is not None and date.year > UNSET else None
