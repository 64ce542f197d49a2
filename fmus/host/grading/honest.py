"""Whether an FMU is a function of what is set in it, without which estimates from it mean nothing.

The trials are those of `railfmi check`. Their outcome is kept in the user's cache, by the content of the FMU.
"""

import contextlib
import json
import os
from functools import partial
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from platformdirs import user_cache_path

from fmus.errors import BadInput
from fmus.host.apart.isolation import Isolation
from fmus.host.archive import Archive
from fmus.host.fmu import FmuError
from fmus.host.grading.bench import Bench
from fmus.host.grading.trials import (
    CHANGES,
    HIDDEN,
    SHARED,
    instances_keep_apart,
    repeats,
    restarts_anywhere,
)
from fmus.limits import PROBED, RESTARTS

TRIED = (repeats, partial(restarts_anywhere, tolerance=RESTARTS), instances_keep_apart)
WRONG = (CHANGES, HIDDEN, SHARED)  # beginnings of the sentences that count; an FMU may refuse its own start


def check_honest(fmu: Path, isolation: Isolation) -> None:
    """Raise BadInput for an FMU that does not repeat, hides a state or shares it between instances.

    It is tried out in a process of its own; FmuEnded where it crashes there or passes a limit.
    """
    with Archive(fmu, isolation) as archive:  # also checks that it is an FMU
        key = sha256(version("railfmi").encode() + fmu.read_bytes()).hexdigest()
        file = folder() / f"{key}.json"
        said = _kept(file)
        if said is None:
            said = archive.called(objection)
            _keep(file, said)
    if said:
        raise BadInput(
            f"{fmu}: {said[:1].lower()}{said[1:].rstrip('.')}; so nothing can be estimated from it; "
            "mend the FMU ('railfmi check' shows all trials)"
        )


def objection(archive: Archive) -> str:
    """The sentence of the first trial that an FMU fails; empty if there is none."""
    bench = Bench(archive)
    for trial in TRIED:
        with contextlib.suppress(FmuError):  # it needs other start values than its own
            passed, sentence = trial(bench)
            if passed is False and sentence.startswith(WRONG):
                return sentence
    return ""


def folder() -> Path:
    """Where outcomes are kept."""
    return user_cache_path("railfmi") / "trials"


def _kept(file: Path) -> str | None:
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return said if isinstance(said, str) else None


def _keep(file: Path, said: str) -> None:
    """A cache that cannot be written costs time and nothing else."""
    part = file.with_name(f".{file.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps(said), encoding="utf-8")
        part.replace(file)
        kept = sorted(file.parent.glob("*.json"), key=lambda f: f.stat().st_mtime)
        for old in kept[:-PROBED]:
            old.unlink(missing_ok=True)
