"""Close the loop on the measured benchmarks whose data are available, and print a table of the results.

Run: python -m benchmarks.measured DATA_FOLDER --out DIR [--only NAME ...]. The exit code is 0 if done, 1 if
an effect was misnamed or an error is above its target, 2 for bad input.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import benchmarks.measured
from benchmarks.measured.benchmark import Benchmark
from benchmarks.measured.outcome import Outcome, table
from fmus.errors import BadInput, did_you_mean
from scenarios import close_loop


def benchmarks_here() -> dict[str, Benchmark]:
    """All measured benchmarks by name, most important first; every module of this package may define one."""
    package = benchmarks.measured
    names = [m.name for m in iter_modules(package.__path__) if not m.name.startswith("_")]
    found = [vars(import_module(f"{package.__name__}.{name}")).get("BENCHMARK") for name in names]
    known = [b for b in found if isinstance(b, Benchmark)]
    return {b.name: b for b in sorted(known, key=lambda b: b.rank)}


def measure(benchmark: Benchmark, data: Path, out: Path) -> Outcome:
    """Prepare a benchmark in `out`/NAME and close the loop on it in one process."""
    work = out / benchmark.name
    begun = time.process_time()

    def tell(what: str) -> None:
        print(
            f"{benchmark.name:16} {time.process_time() - begun:6.0f} s  {what}", file=sys.stderr, flush=True
        )

    result = close_loop(benchmark.prepare(data, work), work / "result", tell=tell, jobs=1)
    return Outcome(benchmark, result, time.process_time() - begun)


def chosen(names: Sequence[str]) -> list[Benchmark]:
    """Benchmarks by name, all if none is given; raises BadInput for an unknown name."""
    known = benchmarks_here()
    for name in names:
        if name not in known:
            raise BadInput(f"--only {name}: is no measured benchmark; {did_you_mean(name, known)}")
    return [known[name] for name in names] if names else list(known.values())


def run(data: Path, out: Path, names: Sequence[str]) -> list[Outcome]:
    """Close the loop on the chosen benchmarks whose data are available; writes table.md and table.json.

    Raises BadInput if there are none, or if a named one has no data.
    """
    wanted = chosen(names)
    here = [b for b in wanted if names or not b.missing_files(data)]
    if not here:
        raise BadInput(f"{data}: holds no data of a measured benchmark; see docs/benchmarks.md for its files")
    outcomes: list[Outcome] = []
    for benchmark in here:
        outcomes.append(measure(benchmark, data, out))
        (out / "table.md").write_text(table(outcomes), encoding="utf-8")
        found = {o.benchmark.name: o.as_json() for o in outcomes}
        (out / "table.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    return outcomes


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.measured", description=__doc__)
    parser.add_argument("data", type=Path, help="folder with the CSV files of the benchmarks")
    parser.add_argument(
        "--out", type=Path, required=True, help="folder for experiments, results and the table"
    )
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="benchmarks to run")
    given = parser.parse_args(arguments)
    try:
        outcomes = run(given.data, given.out, given.only)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    print(table(outcomes), end="")
    return 1 if any(o.answer in ("misnamed", "error above target") for o in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
