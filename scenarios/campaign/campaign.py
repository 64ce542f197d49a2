"""Run a campaign: its points on workers, then tables, indices and page from the finished tasks alone."""

import json
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from fmus.errors import BadInput
from fmus.host.apart.isolation import ISOLATED, Isolation
from scenarios.campaign.indices import Index, indices_of
from scenarios.campaign.planning import Plan, plan_of
from scenarios.campaign.result import CampaignResult, failures_of, measured
from scenarios.output import writable, written_at_once
from scenarios.tasks.hashes import hash_of_program
from scenarios.tasks.parquet import write_table
from scenarios.tasks.store import BUILDS, FAILED, Answer, Store

Tell = Callable[[str], None]
Row = dict[str, Any]
POINTS, INDICES = "points.parquet", "indices.parquet"
INDEX_COLUMNS = pa.schema(
    [
        ("measure", pa.string()), ("key", pa.string()),
        *((name + end, pa.float64()) for name in ("first", "total") for end in ("", "_low", "_high")),
        ("used", pa.int64()),
    ]
)  # fmt: skip


@dataclass(frozen=True)
class Assembled:
    """All that a campaign's finished tasks say."""

    plan: Plan
    rows: list[Row]
    result: CampaignResult


def campaign(
    file: str | Path,
    out: str | Path,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    tell: Tell = lambda _: None,
    isolation: Isolation | None = ISOLATED,
) -> CampaignResult:
    """Run `railfmi campaign` and return the result that is written as result.json.

    file: a campaign file; out: folder of the tables, the page, and the finished tasks, which a later run
    takes over. The other arguments are those of `fleet`. Raises BadInput if the file is wrong, if
    dask.distributed is missing, or if every point fails; a single point that fails is a row with the reason.
    """
    begun = time.monotonic()
    plan = plan_of(file, isolation)
    folder = writable(Path(out))
    store = Store.within(folder)
    if retry_failed:
        store.forget_failed(t.key for t in plan.tasks)
    from scenarios.campaign.work import simulated
    from scenarios.tasks.running import Crew, run

    crew = Crew(workers, scheduler, plan.files)
    try:
        reasons = run(plan.tasks, simulated, store, crew, tell, "points")
    finally:
        store.remove_builds(crew.builds)
    tell("writing the tables and the page")
    answers = {t.key: a for t in plan.tasks if (a := store.read(t.key)) is not None}
    found = assembled(plan, answers, reasons, time.monotonic() - begun)
    if found.result.tasks["failed"] == len(plan.tasks):
        raise BadInput(f"{plan.file}: every point failed, the first one so: {found.rows[0]['reason']}")
    _write(folder, found)
    shutil.rmtree(folder / BUILDS, ignore_errors=True)
    return found.result


def assembled(
    plan: Plan, answers: Mapping[str, Answer], reasons: Mapping[str, str], seconds: float
) -> Assembled:
    """All that the answers of a plan say; reasons: why tasks have none; seconds: what the run took."""
    d = plan.declared
    rows = [_row(plan, i, answers, reasons) for i in range(len(plan.points))]
    base = 2 * (d.n or 0) if d.sample == "sobol" else len(rows)
    failed = failures_of(rows)
    left = len(plan.tasks) - sum(t.key in answers for t in plan.tasks)
    result = CampaignResult(
        campaign=d.id,
        sample=d.sample,
        points=len(rows),
        tasks={
            "planned": len(rows),
            "finished": len(rows) - left,
            "failed": len(failed) - left,
            "left": left,
        },
        varied=list(d.vary),
        measured=[measured(name, [row[name] for row in rows[:base]]) for name in d.measure],
        indices=_indices(plan, rows),
        failed=failed,
        railfmi=version("railfmi"),
        program_sha256=hash_of_program(),
        wall_seconds=round(seconds, 1),
    )
    return Assembled(plan, rows, result)


def _row(plan: Plan, i: int, answers: Mapping[str, Answer], reasons: Mapping[str, str]) -> Row:
    key = plan.tasks[i].key
    answer = answers.get(key, {"verdict": FAILED, "reason": reasons.get(key, "not done"), "values": {}})
    return {
        "point": i,
        **{name: _plain(value) for name, value in plan.points[i].items()},
        **{name: answer["values"].get(name) for name in plan.declared.measure},
        "verdict": answer["verdict"],
        "reason": answer.get("reason", ""),
        "railfmi": version("railfmi"),
        "program_sha256": hash_of_program(),
        "task": key,
    }


def _plain(value: Any) -> float | str:
    """A value of a varied key as it stands in the table: a number, or its text."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return value if isinstance(value, str) else json.dumps(value, default=str)


def _indices(plan: Plan, rows: Sequence[Row]) -> list[Index]:
    d = plan.declared
    if d.sample != "sobol":
        return []
    columns = {
        m: np.array([np.nan if r[m] is None else r[m] for r in rows], dtype=np.float64) for m in d.measure
    }
    return [i for m, values in columns.items() for i in indices_of(m, list(d.vary), values, d.seed)]


def schema_of(plan: Plan) -> pa.Schema:
    """The columns of the points."""
    text, number = pa.string(), pa.float64()
    words = {
        name for name in plan.declared.vary if any(isinstance(_plain(p[name]), str) for p in plan.points)
    }
    return pa.schema(
        [
            ("point", pa.int64()),
            *((name, text if name in words else number) for name in plan.declared.vary),
            *((name, number) for name in plan.declared.measure),
            *((name, text) for name in ("verdict", "reason", "railfmi", "program_sha256", "task")),
        ]
    )


def write_tables(folder: Path, found: Assembled) -> None:
    """Write the tables; their bytes follow from the campaign's files and the program alone."""
    schema = schema_of(found.plan)
    words = [f.name for f in schema if f.type == pa.string() and f.name in found.plan.declared.vary]
    rows = [{**row, **{name: str(row[name]) for name in words}} for row in found.rows]
    write_table(folder / POINTS, rows, schema)
    write_table(folder / INDICES, [asdict(i) for i in found.result.indices], INDEX_COLUMNS)


def _write(folder: Path, found: Assembled) -> None:
    from scenarios.campaign.page import write_page  # loads Matplotlib

    with written_at_once(folder) as part:
        write_tables(part, found)
        write_page(part, found)
        found.result.write(part / "result.json")
        (folder / "result.json").unlink(missing_ok=True)
