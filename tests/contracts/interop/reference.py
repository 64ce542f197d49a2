"""The Reference-FMUs through check, run and compare: `python -m tests.contracts.interop.reference FOLDER`.

FOLDER holds the FMUs as `2/NAME.fmu` and `3/NAME.fmu`, and their authors' results of the default experiment
as `NAME_out.csv`; names after it take those FMUs alone. The outcome is kept in reference.json and shown in
docs/compatibility.md.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
from fmpy import read_model_description
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fmus.host.archive import describe
from fmus.host.master.recording import read_recording
from scenarios.simulating.expression import in_formula
from tests.contracts.interop.record import PAGE, shown
from tests.helpers.paths import ROOT

RESULTS = Path(__file__).with_name("reference.json")
BEGIN, END = "<!-- reference: begin -->\n", "<!-- reference: end -->\n"
STEP = 0.1  # s, where the default experiment names none
ROWS = 401  # of the record that compare is given; an experiment has at least 50 in each part
LIMIT = 200  # s, for one command
REFUSED = "refused: "
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """What the three commands made of one FMU."""

    name: str
    fmi: int
    check: (
        str  # titles of the checks that failed; empty where all passed; why it is no FMU for these commands
    )
    run: float | None  # largest difference from the right answer, of an output's largest value
    said: str  # why it did not run
    compare: str  # how the command ended with the other version of FMI


def outcome(folder: Path, fmi: int, name: str) -> Outcome:
    """The three commands with one FMU."""
    fmu = folder / str(fmi) / f"{name}.fmu"
    check = _check(fmu)
    if check.startswith(REFUSED):
        return Outcome(name, fmi, check, None, "refused", "refused")
    wanted = SOLVED[name]() if name in SOLVED else _results(folder / f"{name}_out.csv")
    with tempfile.TemporaryDirectory() as work:
        run, said = _run(fmu, wanted, Path(work))
        compare = _compare(folder, name, wanted, Path(work))
    return Outcome(name, fmi, check, run, said, compare)


def _robertson() -> pd.DataFrame:
    """Robertson's problem by an implicit solver, as the readme of the FMU writes it, for 1 s.

    The file of results that comes with the FMU (0.0.41) is that of a bouncing ball.
    """
    times = np.linspace(0.0, 1.0, 11)  # s

    def rates(_: float, y: Array) -> Array:
        slow, quick = 0.04 * y[0] - 1e4 * y[1] * (1.0 - y[0] - y[1]), 3e7 * y[1] ** 2
        return np.array([-slow, slow - quick])

    y = solve_ivp(rates, (0.0, 1.0), [1.0, 0.0], "Radau", times, rtol=1e-10, atol=1e-14).y
    return pd.DataFrame({"time": times, "y1": y[0], "y2": y[1], "y3": 1.0 - y[0] - y[1]})


SOLVED: Mapping[str, Callable[[], pd.DataFrame]] = MappingProxyType({"Roberts": _robertson})


def _command(*arguments: str | Path) -> tuple[int, dict[str, object], str]:
    """Exit code, the answer, and the last line of what was said."""
    call = [sys.executable, "-m", "scenarios.cli", *map(str, arguments), "--json"]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT)
    said = (done.stderr + done.stdout).strip().splitlines()
    answer = json.loads(done.stdout) if done.stdout.lstrip().startswith("{") else {}
    reasons = [line for line in done.stderr.splitlines() if line.startswith("railfmi:")]
    return done.returncode, answer, (reasons or said or [""])[-1]


def _check(fmu: Path) -> str:
    code, answer, said = _command("check", fmu)
    if code == 2:
        return REFUSED + said.replace(f"railfmi: {fmu}: ", "").split(";")[0]
    checks = answer["result"]["checks"]  # type: ignore[index]
    return ", ".join(c["title"] for c in checks if c["passed"] is False)


def _outputs(fmu: Path) -> dict[str, str | None]:
    """Outputs that are numbers or truths, arrays by their elements, with their units."""
    about = describe(fmu).widened
    return {name: about.variables[name].unit for name in about.outputs}


def _results(file: Path) -> pd.DataFrame:
    """The authors' results as numbers: truths as 0 and 1, arrays by their elements."""
    table = pd.read_csv(file)
    found = {}
    for name in table:
        words = table[name].astype(str).str.split()
        for i in range(words.str.len().max()):
            column = words.str[i].replace({"true": "1", "false": "0", "True": "1", "False": "0"})
            numbers = pd.to_numeric(column, errors="coerce")
            if numbers.notna().all():
                found[name if words.str.len().max() == 1 else f"{name}[{i + 1}]"] = numbers.astype(float)
    return pd.DataFrame(found)


def _times(fmu: Path, wanted: pd.DataFrame) -> tuple[float, float]:
    """Step and end of the default experiment, s."""
    about = read_model_description(fmu, validate=False).defaultExperiment
    step = float(about.stepSize) if about and about.stepSize else STEP
    return step, float(wanted["time"].iloc[-1])


def _run(fmu: Path, wanted: pd.DataFrame, work: Path) -> tuple[float | None, str]:
    step, stop = _times(fmu, wanted)
    names = [n for n in _outputs(fmu) if n in wanted]
    recorded = ", ".join(f'"it.{n}"' for n in names)
    lines = [
        'id = "it"',
        'question = "Does it give what its authors say?"',
        f"duration = {stop!r}",
        f"step = {step!r}",
        "[fmus.it]",
        f'fmu = "{fmu}"',
        "[record]",
        *([f"names = [{recorded}]"] if names else []),
        'format = "csv"',
        "[[expect]]",
        f"that = 'max(abs({in_formula(f'it.{names[0]}')})) < 1e300'" if names else 'that = "1 > 0"',
        'because = "it runs"',
    ]
    (work / "it.toml").write_text("\n".join(lines) + "\n")
    code, _, said = _command("run", work / "it.toml", "--out", work / "out")
    if code:
        return None, said.replace(f"railfmi: {work}/it.toml: ", "").split("; what was recorded")[0]
    if not names:
        return None, "runs; no results of its authors"
    [file] = (work / "out").rglob("*.csv")
    found = read_recording(file).data
    worst = 0.0
    for name in names:
        column = found[f"it.{name}"].to_numpy()
        times = found["time"].to_numpy()
        there = [abs(times - t).argmin() for t in wanted["time"]]
        size = max(abs(wanted[name]).max(), 1e-9)
        worst = max(worst, float(abs(column[there] - wanted[name]).max() / size))
    return worst, ""


def _compare(folder: Path, name: str, wanted: pd.DataFrame, work: Path) -> str:
    """How compare ends with the FMUs of both versions, or with the only one and itself."""
    both = [folder / str(fmi) / f"{name}.fmu" for fmi in (2, 3)]
    there = [f for f in both if f.exists()]
    both = there * 2 if len(there) == 1 else there  # with itself
    units = [_outputs(fmu) for fmu in both]
    names = [n for n in units[0] if n in units[1] and n in wanted]
    if not names:
        return "no results of its authors"
    stop = float(wanted["time"].iloc[-1])
    times = np.linspace(0.0, stop, ROWS)
    rows = {n: np.interp(times, wanted["time"], wanted[n]) for n in names}
    pd.DataFrame({"time": times, **rows}).to_csv(work / "rows.csv", index=False)
    lines = [
        'id = "it"',
        f'fmu = "{both[0]}"',
        'data = "rows.csv"',
        'time = "time"',
        "[split]",
        f"identify = [0.0, {stop / 2!r}]",
        f"test = [{stop / 2!r}, {stop!r}]",
        *(f'[outputs."{n}"]\ncolumn = "{n}"\n{_stated(units[0][n])}' for n in names),
    ]
    (work / "experiment.toml").write_text("\n".join(lines) + "\n")
    code, _, said = _command("compare", *both, work / "experiment.toml", "--out", work / "compared")
    return {0: "agree", 1: "differ"}.get(code, said.replace(f"railfmi: {work}/experiment.toml: ", ""))


def _stated(unit: str | None) -> str:
    """The unit of a column in the experiment: that of the FMU, or none in both."""
    return f'unit = "{unit}"' if unit else 'unit = "1"\nmodel_unit = "1"'


def stored(file: Path = RESULTS) -> list[Outcome]:
    """The outcomes that were recorded."""
    return [Outcome(**row) for row in json.loads(file.read_text())]


def table(outcomes: Sequence[Outcome]) -> str:
    """The rows of the page."""
    lines = [
        "| FMU | FMI | `check` | `run`: difference from the right answer | `compare` of both versions |",
        "|---|---|---|---|---|",
    ]
    for o in outcomes:
        run = o.said if o.run is None else shown(o.run)
        check = o.check if o.check.startswith(REFUSED) else f"failed: {o.check}" if o.check else "passed"
        lines.append(f"| {o.name} | {o.fmi}.0 | {check} | {run} | {o.compare} |")
    return "\n".join(lines) + "\n"


def main(folder: Path, only: Sequence[str] = ()) -> None:
    """Record the FMUs of a folder, all or those of some names, and put the table into the page."""
    kept = {(o.fmi, o.name): o for o in (stored() if only else [])}
    for fmi in (2, 3):
        for fmu in sorted((folder / str(fmi)).glob("*.fmu")):
            if not only or fmu.stem in only:
                kept[fmi, fmu.stem] = outcome(folder, fmi, fmu.stem)
                print(kept[fmi, fmu.stem], flush=True)
    found = [kept[key] for key in sorted(kept)]
    RESULTS.write_text("[\n" + ",\n".join(json.dumps(asdict(o)) for o in found) + "\n]\n")
    before, rest = PAGE.read_text().split(BEGIN)
    PAGE.write_text(before + BEGIN + "\n" + table(found) + "\n" + END + rest.split(END)[1])


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), sys.argv[2:])
