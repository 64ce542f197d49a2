"""Run a fleet: its tasks on workers, then tables, findings and page from the finished tasks alone."""

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from fmus.host.apart.isolation import ISOLATED, Isolation
from scenarios.fleet.findings import Findings, findings_of
from scenarios.fleet.planning import Job, Plan, plan_of
from scenarios.fleet.pooling import Pooled, pooled
from scenarios.fleet.result import (
    DRIFTS,
    EFFECTS,
    LEVELS,
    RESULTS,
    FleetResult,
    failures_of,
    verdicts_of,
)
from scenarios.fleet.rows import SCHEMA, Row, rows_of
from scenarios.fleet.tables import (
    DRIFT_COLUMNS,
    EFFECT_COLUMNS,
    LEVEL_COLUMNS,
    drift_row,
    effect_row,
    level_row,
)
from scenarios.output import writable, written_at_once
from scenarios.tasks.hashes import hash_of_program
from scenarios.tasks.parquet import write_parts, write_table
from scenarios.tasks.store import BUILDS, FAILED, Answer, Store

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Assembled:
    """All that a fleet's finished tasks say."""

    plan: Plan
    rows: list[Row]
    findings: Findings
    effects: list[Pooled]
    result: FleetResult


def fleet(
    file: str | Path,
    out: str | Path,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    tell: Tell = lambda _: None,
    isolation: Isolation | None = ISOLATED,
) -> FleetResult:
    """Run `railfmi fleet` and return the result that is written as result.json.

    file: a fleet file; out: folder of the tables, the page, and the finished tasks, which a later run takes
    over. workers: processes on this machine, by default one per core; scheduler: address of a scheduler of
    dask.distributed, whose workers see the same folders, in place of them. retry_failed: also do tasks again
    that were answered with a reason. isolation: limits of the processes in which foreign FMUs run.
    Raises BadInput if the fleet file is wrong, or dask.distributed is missing; a record that cannot be used
    is a row with the reason. After Ctrl-C, or a kill, the same call goes on.
    """
    begun = time.monotonic()
    plan = plan_of(file, isolation)
    folder = writable(Path(out))
    store = Store.within(folder, RESULTS)
    if retry_failed:
        store.forget_failed(j.task.key for j in plan.jobs if j.task)
    reasons = _done(plan, store, workers, scheduler, tell)
    tell("writing the tables and the page")
    found = assembled(plan, store, reasons, time.monotonic() - begun)
    _write(folder, found)
    shutil.rmtree(folder / BUILDS, ignore_errors=True)
    return found.result


def _done(plan: Plan, store: Store, workers: int | None, scheduler: str | None, tell: Tell) -> dict[str, str]:
    """Do all tasks; returns the reasons of those that are still not done."""
    from scenarios.fleet.work import answered
    from scenarios.tasks.running import Crew, run

    crew = Crew(workers, scheduler, plan.files)
    try:
        first = [j.task for j in plan.jobs if j.task and not j.triaged]
        reasons = run(first, answered, store, crew, tell, "tasks")
        second = [j.task for j in rejected(plan, store) if j.task]
        return reasons | run(second, answered, store, crew, tell, "tasks after triage")
    finally:
        store.remove_builds(crew.builds)


def rejected(plan: Plan, store: Store) -> list[Job]:
    """The jobs behind a triage whose record was rejected by the estimate with the same model and setup."""
    verdicts = {
        _pair(j): (store.read(j.task.key) or {}).get("verdict")
        for j in plan.jobs
        if j.command == "estimate" and j.task
    }
    return [j for j in plan.jobs if j.triaged and verdicts.get(_pair(j)) in ("inconsistent", "diverged")]


def _pair(job: Job) -> tuple[str, str, str]:
    return job.setup, job.model.name, job.record.id if job.record else ""


def assembled(plan: Plan, store: Store, reasons: dict[str, str], seconds: float) -> Assembled:
    """All that the finished tasks of a plan say; seconds: what the run took."""
    wanted = [j for j in plan.jobs if not j.triaged] + rejected(plan, store)
    keys = {j.task.key for j in wanted if j.task}
    answers: dict[str, Answer] = {k: a for k in keys if (a := store.read(k)) is not None}
    rows = rows_of(plan, answers, reasons)
    findings, effects = findings_of(rows, plan.declared.level), pooled(plan, answers)
    tasks = {
        "planned": len(plan.jobs),
        "finished": len(answers),
        "failed": sum(a["verdict"] == FAILED for a in answers.values())
        + sum(j.task is None for j in plan.jobs),
        "left": len(keys - answers.keys()),
        "triaged out": len(plan.jobs) - len(wanted),
    }
    result = FleetResult(
        fleet=plan.declared.id,
        vehicles=len({r.vehicle for r in plan.records}),
        records=len(plan.records),
        tasks=tasks,
        verdicts=verdicts_of(rows),
        failed=failures_of(rows),
        drifts=[drift_row(d) for d in findings.drifts if d.drifts],
        deviates=[level_row(x) for x in findings.levels if x.deviates],
        effects=[effect_row(e) for e in effects],
        level=plan.declared.level,
        mileage_unit=plan.declared.mileage_unit,
        railfmi=version("railfmi"),
        program_sha256=hash_of_program(),
        wall_seconds=round(seconds, 1),
    )
    return Assembled(plan, rows, findings, effects, result)


def _write(folder: Path, found: Assembled) -> None:
    """Write all files; what says the result is written last, and the tables of an earlier run are removed."""
    from scenarios.fleet.page import write_page  # loads Matplotlib

    with written_at_once(folder) as part:
        write_tables(part, found)
        write_page(part, found)
        found.result.write(part / "result.json")
        (folder / "result.json").unlink(missing_ok=True)
        shutil.rmtree(folder / RESULTS, ignore_errors=True)


def write_tables(folder: Path, found: Assembled) -> None:
    """Write the tables; their bytes follow from the fleet's files and the program alone."""
    write_parts(folder / RESULTS, found.rows, SCHEMA, by="command")
    write_table(folder / DRIFTS, [drift_row(d) for d in found.findings.drifts], DRIFT_COLUMNS)
    write_table(folder / LEVELS, [level_row(x) for x in found.findings.levels], LEVEL_COLUMNS)
    write_table(folder / EFFECTS, [effect_row(e) for e in found.effects], EFFECT_COLUMNS)
