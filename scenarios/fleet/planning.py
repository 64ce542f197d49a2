"""From a fleet file to its tasks: which command on which record, with which model and which setup."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fmus.errors import BadInput, did_you_mean
from fmus.host.apart.isolation import Isolation
from fmus.host.archive import describe
from fmus.taken import check_file
from scenarios.experiment.declaration import Declaration as Experiment
from scenarios.experiment.experiment import check_names, placed
from scenarios.experiment.validation import of_file, read_file, read_table, read_toml
from scenarios.fleet.declaration import Command, Declaration, Setup
from scenarios.fleet.records import FleetRecord, read_records, with_record
from scenarios.tasks.hashes import hash_of, hash_of_data, hash_of_file, hash_of_program
from scenarios.tasks.running import Task

ORDER: tuple[Command, ...] = ("check", "estimate", "close-loop")
OWN = ("id", "data", "model", "fmu")  # keys of an experiment that the record and the model take the place of


@dataclass(frozen=True)
class FleetModel:
    """A model; fmu: its file, None for one of ours; sha256: of the file, or of name and program."""

    name: str
    model: str | None
    fmu: Path | None
    sha256: str


@dataclass(frozen=True)
class Job:
    """A command with a model and a setup on a record, or on the model alone; task: None if it cannot be done.

    reason: why it cannot be done; triaged: whether it is done only where the estimate is rejected.
    """

    command: Command
    model: FleetModel
    setup: str
    setup_sha256: str
    record: FleetRecord | None = None
    record_sha256: str = ""
    task: Task | None = None
    reason: str = ""
    triaged: bool = False


@dataclass(frozen=True)
class Plan:
    """All jobs of a fleet in the order in which their rows are written."""

    file: Path
    declared: Declaration
    records: list[FleetRecord]
    jobs: list[Job]

    @cached_property
    def files(self) -> dict[str, Path]:
        """The FMUs that workers need, by checksum."""
        return {j.model.sha256: j.model.fmu for j in self.jobs if j.model.fmu}


def load_fleet(path: Path) -> Declaration:
    """The declaration in a fleet file; BadInput names file and key."""
    with of_file(path):
        d = read_file(Declaration, path, "a fleet file")
        for name, setup in d.setups.items():
            for model in setup.models:
                if model not in d.models:
                    near = did_you_mean(model, d.models)
                    raise BadInput(f"key 'setups.{name}.models': there is no model '{model}'; {near}")
        return d


def plan_of(path: str | Path, isolation: Isolation | None) -> Plan:
    """The tasks of a fleet file; raises BadInput for what is wrong in it before any task is done.

    A record whose data cannot be read is no error of the fleet: its jobs carry the reason.
    """
    file = Path(path).absolute()
    d = load_fleet(file)
    records = read_records(d, file.parent / d.records)
    hashes = {r.data: _data_hash(r.data) for r in records}
    jobs = [
        job
        for name, setup in d.setups.items()
        for job in _Planned(file, d, name, setup, isolation).jobs(records, hashes)
    ]
    return Plan(file, d, records, jobs)


def _data_hash(data: Path) -> str | OSError:
    """The checksum of a record's data with the files beside them, or why there is none.

    A device or a pipe is not waited for.
    """
    try:
        check_file(data)
        return hash_of_data(data)
    except BadInput as error:
        return OSError(str(error).removeprefix(f"{data}: "))
    except OSError as error:
        return error


@dataclass(frozen=True)
class _Planned:
    """A setup on its way to jobs."""

    fleet: Path
    declared: Declaration
    name: str
    setup: Setup
    isolation: Isolation | None

    @property
    def limits(self) -> dict[str, float] | None:
        """The isolation as a table."""
        return asdict(self.isolation) if self.isolation else None

    @cached_property
    def file(self) -> Path:
        """The experiment of the setup."""
        where = self.fleet.parent / self.setup.experiment
        return where / "experiment.toml" if where.is_dir() else where

    @cached_property
    def table(self) -> dict[str, Any]:
        """The experiment as it is written; its keys are checked."""
        table = {"id": self.name, "data": "-", **read_toml(self.file, "an experiment.toml")}
        with of_file(self.file):
            e = read_table(Experiment, table)
            if e.split and e.split.files:
                raise BadInput("[split] names files, but a fleet's records have one each; give windows in s")
            if named := [name for name, other in e.files.items() if other.file is not None]:
                raise BadInput(
                    f"[files.{named[0]}] names a file, but a fleet's records have one each; add its channels"
                )
            if "close-loop" in self.setup.commands and e.split is None:
                raise BadInput("key 'split' is missing; close-loop needs it to set a test part apart")
            if "estimate" in self.setup.commands and e.estimate is None:
                raise BadInput("has no [estimate]; list there the parameters, states or inputs to find")
        return table

    @cached_property
    def models(self) -> list[FleetModel]:
        """The models of the setup, whose variables have the names that the experiment uses."""
        names = self.setup.models or tuple(self.declared.models)
        given = [(n, self.declared.models[n].model, self.declared.models[n].fmu, self.fleet) for n in names]
        if not given:
            model, fmu = self.table.get("model"), self.table.get("fmu")
            given = [(model or Path(str(fmu)).stem, model, fmu, self.file)]
        return [self._model(*entry) for entry in given]

    def _model(self, name: str, model: str | None, fmu: str | None, file: Path) -> FleetModel:
        if fmu is None:
            placed(read_table(Experiment, {**self._bare, "model": model}), file)  # BadInput if there is none
            return FleetModel(name, model, None, hash_of([model, hash_of_program()]))
        path = file.parent / fmu
        description = describe(path)
        if {"estimate", "close-loop"} & {*self.setup.commands}:
            check_names(placed(read_table(Experiment, {**self._bare, "fmu": fmu}), self.file), description)
        return FleetModel(name, None, path, hash_of_file(path))

    @property
    def _bare(self) -> dict[str, Any]:
        return {k: v for k, v in self.table.items() if k not in ("model", "fmu")}

    def jobs(self, records: list[FleetRecord], hashes: Mapping[Path, str | OSError]) -> Iterator[Job]:
        """The jobs of the setup: each model's check, then each record's commands."""
        mine = [r for r in records if r.setup in ("", self.name)]
        for command in (c for c in ORDER if c in self.setup.commands):
            said = {} if command == "check" else {k: v for k, v in self.table.items() if k not in OWN}
            options = hash_of([command, said, self.setup.seed, self.limits])
            for model in self.models:
                if command == "check":
                    yield self._job(command, model, options, {}, None, "")
                    continue
                for r in mine:
                    yield self._on_record(command, model, options, r, hashes[r.data])

    def _on_record(
        self, command: Command, model: FleetModel, options: str, r: FleetRecord, data: str | OSError
    ) -> Job:
        if isinstance(data, OSError):
            name = str(r.data).replace(f"{self.fleet.parent}/", "")
            reason = f"{name}: cannot be read ({data.strerror or data})"
            return Job(command, model, self.name, options, r, reason=reason)
        table = {k: v for k, v in with_record(self.table, r).items() if k not in ("model", "fmu")}
        given = {"table": table, "file": str(self.file), "data_sha256": data}
        return self._job(command, model, options, given, r, hash_of([data, r.declared]))

    def _job(
        self, command: Command, model: FleetModel, options: str, given: dict[str, Any],
        record: FleetRecord | None, record_sha256: str,
    ) -> Job:  # fmt: skip
        task = Task(
            hash_of([model.sha256, record_sha256, options, hash_of_program()]),
            {
                **given, "command": command, "model": model.model, "fmu": model.sha256 if model.fmu else "",
                "seed": self.setup.seed, "isolation": self.limits,
            },
        )  # fmt: skip
        triaged = command == "close-loop" and self.setup.triage
        return Job(command, model, self.name, options, record, record_sha256, task, triaged=triaged)
