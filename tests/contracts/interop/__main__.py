"""Run all FMUs in all importers that are here, and write the results and the page anew.

python -m tests.contracts.interop [TOOL ...]: names as in docs/compatibility.md, all by default.
"""

import re
import sys
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from tests.contracts.interop.cases import Build, case, difference, expected, runs
from tests.contracts.interop.importer import Failed, Importer, importers, run
from tests.contracts.interop.record import Row, keep, write_page

FOLDER = re.compile(r"/\S*/")  # of this machine, which says nothing elsewhere


def measured(tool: type[Importer], build: Build, kind: str) -> tuple[float | None, str]:
    """Largest difference of a run; None and a sentence where the tool did not run the FMU."""
    asked = case(tool, build, kind)
    with tempfile.TemporaryDirectory() as folder:
        try:
            rows = run(tool, asked, Path(folder))
        except Failed as failed:
            return None, FOLDER.sub("", str(failed).splitlines()[-1])
    wanted = expected(build.model, tool.solver if kind == "ME" else "", tool.sets_start)
    return difference(rows, wanted, tool.resolution), ""


def rows_of(tool: type[Importer]) -> Iterator[Row]:
    """The rows of a tool, each as soon as it is there."""
    version, today = tool.version(), f"{datetime.now(UTC):%Y-%m-%d}"
    for build, kind in runs(tool):
        off, said = measured(tool, build, kind)
        yield Row(tool.name, version, build.model, build.build, build.fmi, kind, off, said, today)


def main(only: list[str]) -> None:
    """Record the tools of those names, all if there are none."""
    tools = importers()
    unknown = set(only) - {t.name for t in tools}
    if unknown:
        sys.exit(f"no tools {sorted(unknown)}; there are {[t.name for t in tools]}")
    for tool in tools:
        if only and tool.name not in only:
            continue
        if tool.missing():
            print(f"{tool.name}: left as it was, {tool.missing()}", flush=True)
            continue
        for row in rows_of(tool):
            keep([row])
            told = row.difference if row.difference is not None else row.said
            print(f"{tool.name}: {row.model} {row.build} FMI {row.fmi}.0 {row.kind}: {told}", flush=True)
    write_page(tools)


if __name__ == "__main__":
    main(sys.argv[1:])
