"""What a watch.toml may say: one class a table, one field a key."""

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, PlainValidator, model_validator

from estimator.monitoring.monitor import Settings
from scenarios.experiment.table import NotNegative, Positive, Table
from scenarios.experiment.validation import read_file, read_table
from scenarios.watching.triggers import TRIGGERS
from scenarios.watching.triggers.trigger import Trigger

ENDING = r"^\.[A-Za-z0-9]{1,8}(\.gz)?$"  # of a file
Count = Annotated[int, Field(strict=True, ge=0)]
Port = Annotated[int, Field(strict=True, ge=1, le=65535)]


class Mqtt(Table):
    """A broker, and the topic of which each message is one window, as a file with the ending `format`.

    password_file: a file that holds the password alone, so that no password stands in a watch.toml.
    """

    host: str
    topic: str
    port: Port = 1883
    format: Annotated[str, Field(pattern=ENDING)] = ".parquet"
    client: str = "railfmi-watch"
    user: str | None = None
    password_file: str | None = None
    certificates: str | None = None


class Stream(Table):
    """Where the windows come from: a folder that grows, or a broker.

    pattern: of the names of the files; settle: a file counts as complete that has not changed for so many s;
    hold: how many later windows are held back while one is missing; continues: whether the time of each
    window counts from its own begin and windows follow one another without a gap.
    """

    folder: str | None = None
    mqtt: Mqtt | None = None
    pattern: str = "*"
    settle: NotNegative = 1.0
    hold: Count = 4
    continues: bool = False

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.folder is None) == (self.mqtt is None):
            raise ValueError("needs exactly one of the keys 'folder' and 'mqtt'")
        return self


class Test(Table):
    """How the stream is tested; see estimator.monitoring.monitor.Settings for the meaning of the keys."""

    __test__ = False  # not a test class, whatever its name begins with
    false_alarms_per_hour: Annotated[float, Field(strict=True, gt=0, le=60)] = Settings.false_alarms_per_hour
    block: Positive = Settings.block
    learn: Positive = Settings.learn
    settle: NotNegative = Settings.settle
    quiet: NotNegative = Settings.quiet

    @property
    def settings(self) -> Settings:
        """As the monitor takes them."""
        return Settings(**dict(self))


class Trace(Table):
    """What is done on an alarm: the record from `before` s before the change until `after` s after the alarm
    is kept as an experiment, and close-loop runs on it unless `run` is false; of `most` events at most.
    """

    run: bool = True
    before: Positive = 30.0
    after: Positive = 20.0
    most: Count = 100


def _trigger(value: object) -> Trigger:
    if not isinstance(value, dict) or value.get("kind") not in TRIGGERS:
        raise ValueError(f"needs the key 'kind', one of {', '.join(TRIGGERS)}")
    return read_table(TRIGGERS[value["kind"]], {k: v for k, v in value.items() if k != "kind"}, "trigger")


class Watching(Table):
    """The keys of watch.toml."""

    experiment: str
    stream: Stream
    test: Test = Test()
    trace: Trace = Trace()
    trigger: tuple[Annotated[Trigger, PlainValidator(_trigger)], ...] = ()


class Watched(Watching):
    """A declaration with the file that it was read from."""

    file: Path

    @property
    def folder(self) -> Path:
        """The folder of the file, from which paths in it count."""
        return self.file.parent

    @property
    def trigger_columns(self) -> tuple[str, ...]:
        """The columns that triggers look at, each once."""
        return tuple(dict.fromkeys(c for t in self.trigger for c in t.columns))


def load_watching(path: str | Path) -> Watched:
    """Read a watch.toml, or that in a folder; raises BadInput with one line that names the file and key."""
    where = Path(path).absolute()
    file = where / "watch.toml" if where.is_dir() else where
    declared: dict[str, Any] = dict(read_file(Watching, file, "a watch.toml"))
    return Watched.model_construct(**declared, file=file)
