"""The page of several experiments: a table with links to the single reports, and their comparison."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from scenarios.closing.figures.common_values import common_plot
from scenarios.closing.page.glossary import effect_words, values_words
from scenarios.closing.result import Result
from scenarios.closing.several_results import Carried, Joint, Results
from scenarios.drawing.pages import rendered
from scenarios.drawing.sheet import Plot
from scenarios.drawing.typography import (
    NOTHING,
    number,
    percent,
    short,
    unit,
    with_error,
)
from scenarios.output import written

HERE = Path(__file__).parent
Values = dict[str, Any]


def write_page(folder: Path, found: Results) -> None:
    """Write index.html and its figures into the folder that contains the experiments' folders."""
    page = rendered(
        HERE,
        "several_page.html.j2",
        headline=_headline(found),
        interrupted=found.interrupted,
        rows=[_row(r, found) for r in found.results],
        together=found.together,
        transfers=[row for c in found.transfers for row in _transfer(c, found)],
        joints=[_joint(j, folder) for j in found.joint],
    )
    written(folder / "index.html", page)


def _headline(found: Results) -> str:
    counts = Counter(r.verdict.replace("_", " ") for r in found.results)
    every = len(found.results)
    said = ", ".join(f"{n} {verdict}" for verdict, n in counts.items())
    return f"{every} experiment{'s' if every != 1 else ''}: {said}"


def _row(r: Result, found: Results) -> Values:
    row = next(t for t in found.table if t["experiment"] == r.experiment)
    of, error = str(row["unit"]), r.error[str(row["output"])]
    return {
        "experiment": r.experiment,
        "link": quote(str(row["report"])),
        "verdict": r.verdict,
        "effects": [values_words(e.kind, e.location, e.parameters) for e in r.effects],
        "output": row["output"],
        "unit": unit(of),
        "before": number(error["before"]),
        "after": number(error["after"]),
        "noise": short(error["noise"], 3),
        "gap": percent(float(row["gap_closed"])) if row["gap_closed"] != "" else NOTHING,
        "seconds": f"{r.wall_seconds:.0f}",
    }


def label_words(label: str) -> str:
    """A label in words; the label is kind@location, or several of these joined by "+"."""
    return " and ".join(
        f"{effect_words(k)} at {at}" for k, _, at in (p.partition("@") for p in label.split(" + "))
    )


def _transfer(c: Carried, found: Results) -> Iterator[Values]:
    """One row per output, or one row without numbers if the effect could not be tested on the target."""
    free = [n.removeprefix(f"{_prefix(c.effect)}_") for n in c.free]
    shared: Values = {k: getattr(c, k) for k in ("source", "target", "status", "reason")}
    shared |= {"effect": label_words(c.effect), "free": ", ".join(free)}
    apart = NOTHING if c.distance is None else number(c.distance, 2)
    if not c.error:
        yield {**shared, "first": True, "figures": None, "apart": apart}
    units = found.units.get(c.target, {})
    for i, (output, e) in enumerate(c.error.items()):
        figures = {k: number(e[k]) for k in ("before", "transferred", "own")}
        figures |= {"output": output, "unit": unit(units.get(output)), "noise": short(e["noise"], 3)}
        gap = percent(c.gap_closed[output])
        yield {**shared, "first": i == 0, "apart": apart, "figures": figures, "gap": gap}


def _prefix(label: str) -> str:
    """The prefix of an effect's parameters in the FMU; several effects get one combined name."""
    return label.replace("@", "_").replace(" + ", "_")


def _joint(j: Joint, folder: Path) -> Values:
    prefix = _prefix(j.effect)
    plot = common_plot(prefix, label_words(j.effect), j.parameters, j.alone, j.units)
    return {
        "words": label_words(j.effect),
        "reason": j.reason,
        "experiments": j.experiments,
        "parameters": [
            {
                "name": n.removeprefix(f"{prefix}_"),
                "unit": unit(j.units.get(n)),
                "alone": [with_error(*j.alone[e][n]) if n in j.alone[e] else NOTHING for e in j.experiments],
                "together": with_error(v, s),
            }
            for n, (v, s) in j.parameters.items()
        ],
        "chi2": [(number(j.chi2_alone[e]), number(j.chi2[e])) for e in j.experiments],
        "rise": number(j.rise),
        "chance": number(j.p_value, 2),
        "caption": plot.caption,
        **_pictures(plot, folder),
    }


def _pictures(plot: Plot, folder: Path) -> Values:
    made = plot.embedded(folder)
    return {"figure": made["source"], "narrow": made["narrow"]}
