"""The results in a folder and its subfolders, each as one entry of a list.

Commands write JSON with keys of their own. A kind of result is known by some of these keys; what it says in
one line follows from its function below. A file that cannot be read is an entry too, with the reason.
"""

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from fmus.taken import check_text
from scenarios.closing.page.glossary import values_words
from scenarios.estimating.result import main_values
from scenarios.output import FILES, WRITING

PAGES = (
    "report.html",
    "estimate.html",
    "conicity.html",
    "bifurcation.html",
    "wear.html",
    "plan.html",
    "norm.html",
    "fleet.html",
    "campaign.html",
    "index.html",
    "table.md",
)
Standing = Literal["good", "doubtful", "bad"]
Table = Mapping[str, Any]


@dataclass(frozen=True)
class Entry:
    """One result: the command that wrote it, its name, its answer in words, and where it lies.

    standing: good; doubtful if the record does not decide or a test failed; bad if nothing can be relied on.
    error_over_noise: of close-loop, the largest error after over noise of all outputs; page: the page beside
    the result, "" if there is none.
    """

    command: str
    name: str
    answer: str
    standing: Standing
    file: Path
    written: datetime
    seconds: float | None = None
    error_over_noise: float | None = None
    page: str = ""


@dataclass(frozen=True)
class Said:
    """What one kind of result says."""

    name: str
    answer: str
    standing: Standing
    error_over_noise: float | None = None


@dataclass(frozen=True)
class Kind:
    """A command, keys by which its results are known, and the function that reads one."""

    command: str
    keys: frozenset[str]
    read: Callable[[Table], Said] = field(repr=False)


def entries(folder: Path) -> Iterator[Entry]:
    """All results in a folder and below, in the order of their paths; links to folders are not followed."""
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(f for f in folders if not f.startswith((WRITING, ".")))
        for name in FILES:
            if name in files:
                yield entry(Path(here) / name)


def entry(file: Path) -> Entry:
    """The entry of one file; one that cannot be read has the reason as its answer."""
    written = datetime.fromtimestamp(file.lstat().st_mtime)
    try:
        table = _table(file)
        kind = next((k for k in KINDS if k.keys <= table.keys()), None)
        if kind is None:
            unknown = "a result that this version does not know"
            return Entry("other", file.parent.name, unknown, "doubtful", file, written)
        said = kind.read(table)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        why = f"cannot be read: {' '.join(str(error).split())[:200]}"
        return Entry("unreadable", file.parent.name, why, "bad", file, written)
    seconds = table.get("wall_seconds")
    page = next((p for p in PAGES if (file.parent / p).is_file()), "")
    return Entry(
        kind.command, said.name, said.answer, said.standing, file, written,
        float(seconds) if isinstance(seconds, int | float) else None, said.error_over_noise, page,
    )  # fmt: skip


def _table(file: Path) -> Table:
    check_text(file)
    table = json.loads(file.read_text(encoding="utf-8"))
    if not isinstance(table, dict):
        raise ValueError("no table of keys and values")
    return table


def _close_loop(t: Table) -> Said:
    effects = [values_words(e["kind"], e["location"], e["parameters"]) for e in t["effects"]]
    standing: Standing = "good"
    if t["verdict"] in ("ambiguous", "insufficient_excitation"):
        standing = "doubtful"
    if t["verdict"] == "unexplained":
        standing = "bad"
    ratios = [
        e["after"] / e["noise"] for e in t["error"].values() if e.get("noise") and e.get("after") is not None
    ]
    worst = max((r for r in ratios if math.isfinite(r)), default=None)
    told = str(t["verdict"]).replace("_", " ")
    return Said(t["experiment"], f"{told}: {'; '.join(effects)}" if effects else told, standing, worst)


def _estimate(t: Table) -> Said:
    if t["diverged"]:
        return Said(t["experiment"], "the filter diverged", "bad")
    doubt = "" if t["consistent"] else "; not consistent with the record"
    return Said(
        t["experiment"], main_values(t["estimated"]) + doubt, "good" if t["consistent"] else "doubtful"
    )


def _run(t: Table) -> Said:
    met = sum(bool(e["holds"]) for e in t["expectations"])
    return Said(
        t["scenario"], f"{met} of {len(t['expectations'])} expectations are met", "good" if t["ok"] else "bad"
    )


def _compare(t: Table) -> Said:
    worst = max((o["relative"] for o in t["outputs"].values() if o["relative"] is not None), default=None)
    said = "the FMUs agree" if t["ok"] else "the FMUs differ"
    more = "" if worst is None else f", by {worst:.2g} of an output's rms at most"
    return Said(t["experiment"], said + more, "good" if t["ok"] else "bad")


def _row(t: Table) -> Said:
    aimed = [f for f in t["findings"] if f["target"] is not None]
    met = sum(bool(f["met"]) for f in aimed)
    return Said(
        t["row"], f"{met} of {len(aimed)} figures of the source are met", "good" if t["ok"] else "bad"
    )


def _conicity(t: Table) -> Said:
    at = dict(zip(t["amplitude"], t["conicity"], strict=True))
    three = min(at, key=lambda a: abs(a - 0.003)) if at else None
    said = "none" if three is None or at[three] is None else f"{at[three]:.3f} at {three * 1e3:g} mm"
    return Said(f"{_both(t['wheel'])} on {_both(t['rail'])}", f"equivalent conicity {said}", "good")


def _bifurcation(t: Table) -> Said:
    critical = {name: t[f"{name}_critical"] for name in ("linear", "nonlinear")}
    said = [f"{name} critical {t['parameter']} {v['value']:.4g}" for name, v in critical.items() if v]
    name = f"{t['fmu']}, {t['parameter']} from {t['low']:g} to {t['high']:g}"
    return Said(name, ", ".join(said) or "rest stays as it is over the range", "good")


def _wear(t: Table) -> Said:
    deepest = max(max(s["worn_left"], s["worn_right"]) for s in t["states"])
    said = f"{deepest * 1e3:.2f} mm worn off after {t['km']:.0f} km"
    ended = f"; ended early, {t['ended']}" if t["ended"] else ""
    return Said(t["scenario"], said + ended, "doubtful" if ended else "good")


def _both(sides: Any) -> str:
    """A profile, or the two of unlike sides."""
    return " / ".join(dict.fromkeys(map(str, sides))) if isinstance(sides, list) else str(sides)


def _plan(t: Table) -> Said:
    alone, alike, hidden = (len(t[key]) for key in ("alone", "classes", "hidden"))
    said = f"{alone} effects are told from all others, {alike} groups are not, {hidden} effects stay hidden"
    return Said(t["experiment"], said, "good")


def _norm(t: Table) -> Said:
    rows = [*t["step1"], *t["step2"]]
    inside = sum(bool(row["passed"]) for row in rows)
    said = f"{inside} of {len(rows)} rows inside the windows of EN 15302"
    return Said(str(t["reader"]), said, "good" if t["ok"] else "bad")


def _several(t: Table) -> Said:
    return Said("several experiments", f"{len(t['results'])} experiments compared", "good")


def _fleet(t: Table) -> Said:
    drifting = len({d["vehicle"] for d in t["drifts"]})
    odd = len({d["vehicle"] for d in t["deviates"]})
    said = f"{t['records']} records of {t['vehicles']} vehicles: {drifting} drift or change, {odd} deviate, "
    failed = len(t["failed"])
    return Said(t["fleet"], f"{said}{failed} records without an answer", "doubtful" if failed else "good")


def _campaign(t: Table) -> Said:
    failed = len(t["failed"])
    said = f"{t['points']} points over {len(t['varied'])} keys, {failed or 'none'} without an answer"
    return Said(t["campaign"], said, "doubtful" if failed else "good")


KINDS = (
    Kind("close-loop", frozenset({"verdict", "effects", "error"}), _close_loop),
    Kind("close-loop", frozenset({"results", "together"}), _several),
    Kind("estimate", frozenset({"estimated", "consistent"}), _estimate),
    Kind("run", frozenset({"scenario", "expectations"}), _run),
    Kind("wear", frozenset({"states", "asked_km"}), _wear),
    Kind("compare", frozenset({"a_sha256", "outputs"}), _compare),
    Kind("row", frozenset({"row", "findings"}), _row),
    Kind("conicity", frozenset({"wheel_found", "conicity"}), _conicity),
    Kind("bifurcation", frozenset({"parameter", "crossings", "branches"}), _bifurcation),
    Kind("plan", frozenset({"visible", "classes"}), _plan),
    Kind("conicity-norm", frozenset({"step1", "reader"}), _norm),
    Kind("fleet", frozenset({"fleet", "drifts", "deviates"}), _fleet),
    Kind("campaign", frozenset({"campaign", "varied", "measured"}), _campaign),
)
