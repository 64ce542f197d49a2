"""Measure the speed of railfmi beside named peers; one table, stored with the machine: `make bench`.

Run: python -m benchmarks [--only GROUP ...] [--quick] [--out DIR] [--write docs]. The exit code is 0 if done,
1 if ours and a peer computed different results, 2 for bad input.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    for name in ONE_THREAD:  # before NumPy is loaded
        os.environ.setdefault(name, "1")
    from benchmarks.group import Disagreement
    from fmus.errors import BadInput

    given = _parsed(arguments)
    try:
        return _measured(given)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    except Disagreement as error:
        print(error, file=sys.stderr)
        return 1


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", nargs="+", default=[], metavar="GROUP", help="groups to measure")
    parser.add_argument("--quick", action="store_true", help="few rounds of short runs")
    parser.add_argument(
        "--out", type=Path, default=Path("out/benchmarks"), help="folder of the table and figure"
    )
    parser.add_argument("--write", type=Path, metavar="DOCS", help="also write speed.md and its files there")
    return parser.parse_args(arguments)


def _measured(given: argparse.Namespace) -> int:
    """Measure the chosen groups; what is measured is kept after every group."""
    from benchmarks.group import Row, Work, chosen
    from benchmarks.machine import described
    from benchmarks.table import PAGE, Results
    from fmus.errors import BadInput

    wanted = chosen(given.only)
    if given.write and given.only:
        raise BadInput("--write: the page holds all groups; leave out --only")
    if given.write and not given.write.is_dir():
        raise BadInput(f"--write {given.write}: is no folder; name that of the documents")
    results = Results(described(), given.quick)
    with tempfile.TemporaryDirectory(prefix="railfmi_bench_") as folder:
        work = Work(Path(folder), given.quick)
        for group in wanted:
            print(f"measuring {group.name}", file=sys.stderr, flush=True)
            for found in group().measure(work):
                results.add(group.name, found)
                if isinstance(found, Row):
                    print(f"  {found.name}, {found.peer}", file=sys.stderr, flush=True)
            results.write(given.out)
    print(results.text(), end="")
    if given.write:
        results.write(given.write)
        (given.write / PAGE).write_text(results.page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
