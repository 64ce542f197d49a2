"""A coupled run in the process of the FMUs: all of its loop is there, and its rows lie in shared memory."""

from collections.abc import Callable, Mapping
from typing import Any

from fmus.host.apart.room import Room
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from fmus.host.master.interrupt import stopped_by_ctrl_c
from fmus.host.master.march import Tell
from fmus.host.master.recording import Recorder, SharedCells, Stop

Marched = Callable[..., Stop | None]  # made there: a run into cells by their name, see Master


class Stopping:
    """A run in a room, to be stopped from here."""

    def __init__(self, room: Room) -> None:
        self._room, self._stopped = room, False

    @property
    def stopped(self) -> bool:
        """Whether it was stopped; once it is, that is so."""
        return self._stopped

    @stopped.setter
    def stopped(self, stopped: bool) -> None:
        self._stopped = stopped
        self._room.stop()


def run_elsewhere(
    room: Room,
    marched: Marched,
    fmus: Mapping[str, Archive | Fmu],
    options: Mapping[str, Any],
    duration: float,
    recorder: Recorder,
    cells: SharedCells,
    tell: Tell | None,
) -> Stop | None:
    """Run there; how it was stopped. FmuEnded if an FMU ends that process.

    Functions of this process that give inputs are called from there.
    """
    inputs = {n: room.function(s) if callable(s) else s for n, s in options["inputs"].items()}
    told = None if tell is None else room.function(tell)
    with stopped_by_ctrl_c(Stopping(room)):
        return room.call(marched, dict(fmus), {**options, "inputs": inputs}, duration, cells.name, told)
    return Stop(recorder.last)
