"""Tasks on workers of dask.distributed; the only file that knows this library.

The workers are processes of one thread each. A worker that is killed is replaced, and its task is given to
another one. What was finished lies in the store, so that nothing else has to survive.
"""

import logging
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from secrets import token_hex
from threading import Thread
from typing import Any

from joblib import cpu_count

from fmus.errors import BadInput
from fmus.files import DISK, write_at_once
from scenarios.tasks.hashes import hash_of, hash_of_program
from scenarios.tasks.store import BUILDS, Answer, Store
from scenarios.tasks.undisturbed import undisturbed

try:
    import dask
    from distributed import Client, LocalCluster, as_completed, get_worker
    from distributed.comm import CommClosedError
    from distributed.diagnostics.plugin import WorkerPlugin
except ImportError as missing:
    raise BadInput(
        f"this command needs the extra 'fleet' ({missing}); install it in the folder of railfmi with: "
        "pip install '.[fleet]'"
    ) from missing

CONNECTING = 30  # s, to reach a scheduler
FIRST_WORKER = 120  # s, until a scheduler has at least one worker
CLOSING, HURRY = 30, 2  # s, for workers to end; after an interrupt
SHIPPED = "shipped"  # folder in that of a worker
SETTINGS = {
    "distributed.worker.daemon": False,  # the FMUs of a worker run in processes of their own
    "distributed.worker.memory.target": False,  # a task keeps nothing in the worker that could be spilled
    "distributed.worker.memory.spill": False,
    "distributed.scheduler.worker-ttl": None,  # a long call of an FMU is no dead worker
    "distributed.admin.tick.limit": "1h",  # nor is it worth a warning
    "distributed.comm.timeouts.connect": f"{CONNECTING}s",
}
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Task:
    """A task: its key, a checksum of all that its answer follows from, and what the work is given."""

    key: str
    given: Mapping[str, Any]


@dataclass(frozen=True)
class Place:
    """Where a worker works: a folder for builds, and the files that were shipped to it, by checksum."""

    builds: Path
    shipped: Path

    def fmu(self, checksum: str) -> Path:
        """The FMU with this checksum."""
        return next((self.shipped / checksum).iterdir())

    def without(self, text: str) -> str:
        """A message without the folders of the worker, which are others for each."""
        for folder in (self.shipped, self.builds):
            for part in sorted({str(p.parent) for p in folder.rglob("*.fmu")}, key=len, reverse=True):
                text = text.replace(f"{part}/", "")
        return text


class Passing(Exception):
    """A task could not be done now, for a reason that may pass; it is tried again by the next run."""


def may_pass(error: Exception) -> bool:
    """Whether a task failed for a reason that may pass, such as a full disk, also where others tell of it."""
    if isinstance(error, (OSError, MemoryError, Passing)):
        return True
    return any(os.strerror(number) in str(error) for number in DISK)


Work = Callable[[Mapping[str, Any], Place], Answer]  # a function of a module, so that workers find it


@dataclass(frozen=True)
class Crew:
    """Who does the tasks: so many processes here, or the workers of the scheduler at an address.

    files: files that each worker gets once, by checksum. builds: name of the folder of the FMUs that they
    build, which are programs: a name that nobody knows before, so that none is found there and run.
    """

    workers: int | None = None
    scheduler: str | None = None
    files: Mapping[str, Path] = field(default_factory=dict)
    builds: str = field(default_factory=token_hex)


class Shipment(WorkerPlugin):  # type: ignore[misc]  # the library is not followed
    """Files that each worker gets once, also a worker that starts later."""

    def __init__(self, files: Mapping[str, tuple[str, bytes]]) -> None:
        self.files = files
        self.name = f"railfmi-{hash_of(sorted(files))}"  # others may use the same workers

    def setup(self, worker: Any) -> None:
        """Write the files into the worker's own folder."""
        for checksum, (name, data) in self.files.items():
            target = Path(worker.local_directory) / SHIPPED / checksum / name
            if not target.exists():
                write_at_once(target, data)


def run(tasks: Sequence[Task], work: Work, store: Store, crew: Crew, tell: Tell, what: str) -> dict[str, str]:
    """Do all tasks that are not finished; returns the reasons why some are still not, by key.

    what: word for the tasks in the progress. Raises BadInput if the scheduler cannot be reached, or is lost.
    After Ctrl-C or an error, what was finished is kept.
    """
    left = [t for t in {t.key: t for t in tasks}.values() if store.read(t.key) is None]
    if not left:
        return {}
    done, failed = len(tasks) - len(left), dict[str, str]()
    tell(f"starting the workers; {done} of {len(tasks)} {what} are finished already")
    with _lost_is_told(crew), _silent(), _client(crew) as client:
        files = {k: (file.name, file.read_bytes()) for k, file in crew.files.items()}
        client.register_plugin(Shipment(files))
        names = {f"railfmi-{hash_of([str(store.folder), t.key])}": t.key for t in left}
        futures = client.map(
            _perform, left, work=work, folder=str(store.folder), builds=crew.builds,
            program=hash_of_program(), key=[*names],
        )  # fmt: skip
        tell(f"{what}, {done} of {len(tasks)}")
        waiting = as_completed(futures, loop=client.loop)
        futures.clear()  # an answer is let go once it is here
        for future in waiting:
            _take(future, names[future.key], store, failed)
            done += 1
            tell(f"{what}, {done} of {len(tasks)}")
    return failed


@contextmanager
def _silent() -> Iterator[None]:
    """Without the library's own log, which shows a traceback where a scheduler is lost; that is told here."""
    names = [n for n in logging.root.manager.loggerDict if n.partition(".")[0] == "distributed"]
    before = {logger: logger.level for logger in map(logging.getLogger, names)}
    for logger in before:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in before.items():
            logger.setLevel(level)


@contextmanager
def _lost_is_told(crew: Crew) -> Iterator[None]:
    """One line where the scheduler was lost."""
    try:
        yield
    except CommClosedError as error:
        raise BadInput(
            f"--scheduler {crew.scheduler or 'of this machine'}: was lost; what was finished is kept: start "
            "it again, then the same command"
        ) from error


def _take(future: Any, key: str, store: Store, failed: dict[str, str]) -> None:
    """Keep an answer that a worker without the folder of the store brought, or the reason for none."""
    if future.status in ("cancelled", "lost"):
        raise CommClosedError(future.status)
    if future.status == "error":
        error = future.exception()
        killed = type(error).__name__ == "KilledWorker"
        failed[key] = (
            "each worker that took it was ended by the system, as where memory runs out" if killed
            else " ".join(str(error).split()) or type(error).__name__
        )  # fmt: skip
    elif store.read(key) is None:
        store.finish(key, future.result())


def _perform(task: Task, work: Work, folder: str, builds: str, program: str) -> Answer:
    """Do a task in a worker, unless it was finished meanwhile; the answer, with the time that it took."""
    store = Store(Path(folder))
    if hash_of_program() != program:
        raise Passing("the worker has another version of railfmi than the command; install the same on both")
    with store.claimed(task.key):
        if (kept := store.read(task.key)) is not None:
            return kept
        begun = time.monotonic()
        try:
            answer = work(task.given, _place(store, builds))
        except (OSError, MemoryError) as error:
            raise Passing(f"{type(error).__name__}: {error}") from None
        answer = {**answer, "seconds": round(time.monotonic() - begun, 3)}
        with suppress(OSError):  # who asked keeps it, or says that the disk is full and asks no more
            store.finish(task.key, answer)
    return answer


def _place(store: Store, builds: str) -> Place:
    """Builds are shared by the workers of a host, since a compiler makes them for its processor."""
    shared = store.folder.parent / BUILDS / builds / hash_of(os.uname()[:2])[:16]
    shared.mkdir(parents=True, exist_ok=True)
    return Place(shared, Path(get_worker().local_directory) / SHIPPED)


@contextmanager
def _client(crew: Crew) -> Iterator[Any]:
    """A client of the scheduler at the crew's address, or of one with workers that are started here."""
    with dask.config.set(SETTINGS), ExitStack() as stack:
        if crew.scheduler is not None:
            yield _reached(crew.scheduler, stack)
            return
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="railfmi_workers_"))
        with undisturbed():  # distributed can close a cluster that is whole, and fails at half of one
            cluster = LocalCluster(
                n_workers=crew.workers or cpu_count(), threads_per_worker=1, host="127.0.0.1",
                dashboard_address="127.0.0.1:0", local_directory=folder, silence_logs="CRITICAL",
            )  # fmt: skip
            stack.push(partial(_closed_at_the_end, cluster))
            client = Client(cluster, timeout=CONNECTING)
            stack.push(partial(_closed_at_the_end, client))
        yield client


def _closed_at_the_end(part: Any, kind: type[BaseException] | None, *_: object) -> None:
    """See _close; kind: of what ended the work, if it did not come to its end."""
    _close(part, CLOSING if kind is None else HURRY)


def _close(part: Any, patience: float = HURRY) -> None:
    """Close the client, or the workers and their scheduler."""
    with undisturbed(), suppress(TimeoutError):
        part.close(timeout=patience)


def _reached(address: str, stack: ExitStack) -> Any:
    """A client of the scheduler at an address, which has a worker; the stack closes it."""
    found = _connecting(address)
    stack.callback(found.add_done_callback, _close_found)
    try:
        client = found.result()
    except (OSError, ValueError, TimeoutError) as error:
        raise BadInput(
            f"--scheduler {address}: cannot be reached ({' '.join(str(error).split())}); start it with 'dask "
            "scheduler', or leave the option out for workers on this machine"
        ) from error
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER)
    except TimeoutError as error:
        raise BadInput(
            f"--scheduler {address}: has no workers; start some with 'dask worker {address} --nthreads 1 "
            "--nworkers=-1'"
        ) from error
    return client


def _connecting(address: str) -> "Future[Any]":
    """A client that is being connected, in a thread of its own.

    Where Ctrl-C breaks off the start of a client, the library waits a minute to close it. Here it breaks off
    the waiting alone: the thread ends with the process, or closes the client when it is connected after all.
    """
    found: Future[Any] = Future()

    def connect() -> None:
        try:
            found.set_result(Client(address, timeout=CONNECTING, set_as_default=False))
        except Exception as error:
            found.set_exception(error)

    Thread(target=connect, name="railfmi-connecting", daemon=True).start()
    return found


def _close_found(found: "Future[Any]") -> None:
    """Close the client, if there is one."""
    if found.exception() is None:
        _close(found.result())
