"""The table of a fleet: a row for each thing found, in an order that depends on the fleet file alone."""

from collections.abc import Iterator, Mapping
from importlib.metadata import version
from typing import Any

import pyarrow as pa

from scenarios.fleet.planning import Job, Plan
from scenarios.tasks.hashes import hash_of_program
from scenarios.tasks.store import FAILED, Answer

Row = dict[str, Any]
TEXT, NUMBER = pa.string(), pa.float64()
SCHEMA = pa.schema(
    [
        ("command", TEXT), ("class", TEXT), ("vehicle", TEXT), ("place", TEXT), ("record", TEXT),
        ("mileage", NUMBER), ("model", TEXT), ("setup", TEXT), ("verdict", TEXT), ("kind", TEXT),
        ("location", TEXT), ("parameter", TEXT), ("size", NUMBER), ("std", NUMBER), ("low_95", NUMBER),
        ("high_95", NUMBER), ("unit", TEXT), ("probability", NUMBER), ("error_over_noise", NUMBER),
        ("prior", NUMBER), ("prior_std", NUMBER), ("own", NUMBER), ("own_std", NUMBER), ("held", TEXT),
        ("reason", TEXT), ("railfmi", TEXT), ("policy", TEXT), ("program_sha256", TEXT),
        ("model_sha256", TEXT), ("record_sha256", TEXT), ("setup_sha256", TEXT), ("task", TEXT),
    ]
)  # fmt: skip
FOUND = ("verdict", "kind", "location", "parameter", "size", "std", "low_95", "high_95", "unit",
         "probability", "error_over_noise", "prior", "prior_std", "own", "own_std", "held", "reason",
         "policy")  # fmt: skip


def rows_of(plan: Plan, answers: Mapping[str, Answer], reasons: Mapping[str, str]) -> list[Row]:
    """All rows; answers: by task; reasons: by task, why there is none. Triage leaves jobs without a row."""
    return [row for job in plan.jobs for row in _rows(job, answers, reasons)]


def _rows(job: Job, answers: Mapping[str, Answer], reasons: Mapping[str, str]) -> Iterator[Row]:
    common = _common(job)
    if job.task is None:
        yield {**common, "verdict": FAILED, "reason": job.reason}
    elif job.task.key in answers:
        for found in answers[job.task.key]["rows"]:
            yield {**common, **{name: found.get(name, common[name]) for name in FOUND}}
    elif job.task.key in reasons:
        yield {**common, "verdict": FAILED, "reason": reasons[job.task.key]}


def _common(job: Job) -> Row:
    """What a job's rows share; what is not said of it is empty."""
    r = job.record
    blank: Row = {f.name: None if f.type == NUMBER else "" for f in SCHEMA}
    return {
        **blank,
        "command": job.command,
        "model": job.model.name,
        "setup": job.setup,
        "railfmi": version("railfmi"),
        "program_sha256": hash_of_program(),
        "model_sha256": job.model.sha256,
        "record_sha256": job.record_sha256,
        "setup_sha256": job.setup_sha256,
        "task": job.task.key if job.task else "",
        **(
            {"class": r.kind, "vehicle": r.vehicle, "place": r.place, "record": r.id, "mileage": r.mileage}
            if r
            else {}
        ),
    }
