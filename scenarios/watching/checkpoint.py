"""The checkpoint of a stream: one file, replaced after each window, that cannot execute anything."""

from dataclasses import dataclass, field
from hashlib import sha256
from importlib.metadata import version
from io import BytesIO
from pathlib import Path

from estimator.filters import carried
from estimator.monitoring import monitor
from estimator.monitoring.policy import POLICY as OF_TEST
from fmus import codec
from fmus.errors import BadInput
from fmus.export.provenance import checksum
from fmus.files import write_at_once
from scenarios.experiment.experiment import Experiment
from scenarios.tasks.hashes import hash_of_data
from scenarios.watching import commission
from scenarios.watching.capturing import Piece, Waiting
from scenarios.watching.declaration import Watched

FILE = "watch.checkpoint"


@dataclass(frozen=True)
class Counts:
    """What has been counted since the stream began."""

    windows: int = 0
    tested: int = 0
    learning: int = 0
    outside: int = 0
    past: int = 0
    unusable: int = 0
    gaps: int = 0
    diverged: int = 0
    samples: int = 0
    seconds: float = 0.0  # of record that was filtered
    log_likelihood: float = 0.0
    nis: float = 0.0  # sum over all samples
    freedom: float = 0.0
    alarms: int = 0


@dataclass(frozen=True)
class Checkpoint:
    """All that a restart needs; log: bytes of the log that belong to it."""

    commissioned: commission.Commissioned
    filter: carried.Kept | None
    monitor: monitor.State
    until: float  # s, of the last sample that was taken
    begun: bool  # whether the filter goes on, or begins anew at the next sample
    source: tuple[str, ...]
    counts: Counts
    log: int
    pieces: tuple[Piece, ...] = ()
    waiting: tuple[Waiting, ...] = ()
    estimates: dict[str, float] = field(default_factory=dict)
    alarms: tuple[str, ...] = ()


TYPES = (
    Checkpoint, Counts, Piece, Waiting, *carried.KEPT, *monitor.KEPT, *commission.KEPT,
)  # fmt: skip


def key_of(w: Watched, e: Experiment, fmu: Path | None) -> str:
    """What a checkpoint belongs to: this version, its limits, and all that files, FMU and record say.

    The record counts with the units beside it, by which windows are converted.
    """
    declared = sorted(e.model_dump(exclude={"file", "data_dir"}).items())
    said = repr((w.stream.continues, w.test, w.trigger, declared))
    whole = [
        version("railfmi"),
        OF_TEST.version,
        sha256(said.encode()).hexdigest(),
        *([checksum(fmu)] if fmu else []),
        *map(hash_of_data, e.every_file),
    ]
    return " ".join(whole)


def write(folder: Path, checkpoint: Checkpoint, key: str) -> None:
    """Replace the checkpoint in a folder; after a kill at any moment there is the old one or the new one."""
    stream = BytesIO()
    codec.write(stream, checkpoint, key, TYPES)
    write_at_once(folder / FILE, stream.getvalue())


def read(folder: Path, key: str) -> Checkpoint | None:
    """The checkpoint in a folder, None if there is none; BadInput for one that belongs to something else."""
    file = folder / FILE
    if not file.exists():
        return None
    try:
        with file.open("rb") as stream:
            found = codec.read(stream, key, TYPES)
    except (OSError, codec.Unreadable) as error:
        raise BadInput(
            f"{file}: {error}; the experiment, its record, the watch.toml, the FMU or railfmi have changed "
            "since; give another --out, or --anew to begin anew"
        ) from error
    if not isinstance(found, Checkpoint):
        raise BadInput(f"{file}: holds no checkpoint of a stream; give another --out")
    return found
