"""The page of a plan: one self-contained file, with each figure also as a file beside it."""

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from estimator.closeloop.planning.plan import Plan
from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import NOTHING, number, percent, quantity, short, unit
from scenarios.output import written
from scenarios.planning.figures import size_plot, split_plot
from scenarios.planning.result import PlanResult

HERE = Path(__file__).parent
BEST = 4  # sensors and changes of inputs that are listed for a class; plan.json has all
PERCENT = 5e-3  # share from which on one decimal of a percentage is enough
Row = dict[str, Any]


def write_page(folder: Path, found: Plan, result: PlanResult) -> None:
    """Write plan.html and its figures into a folder; the page loads no other file."""
    known = found.question.problem.plant.fmu.description.variables
    plots = [size_plot(result), split_plot(result)]
    sizes, splits = ([p.embedded(folder)] if p else [] for p in plots)
    page = rendered(
        HERE,
        "page.html.j2",
        result=result,
        sensors=[_sensor(name, told, known[name].unit) for name, told in result.noise.items()],
        classes=[_class(c, {n: v.unit for n, v in known.items()}) for c in result.classes],
        visible=[_visible(v) for v in result.visible],
        sizes=sizes,
        splits=splits,
        version=version("railfmi"),
    )
    written(folder / "plan.html", page)


def _sensor(name: str, told: Row, of: str | None) -> Row:
    return {
        "name": name,
        "noise": quantity(number(told["std"]), of),
        "how": "declared" if told["declared"] else "assumed",
    }


def _class(c: Row, units: dict[str, str | None]) -> Row:
    return {
        "effects": c["effects"],
        "margin": number(c["margin"], 2),
        "score": number(c["score"], 2),
        "size": "" if c["size"] is None else number(c["size"], 2),
        "seconds": "" if c["seconds"] is None else f"{short(c['seconds'], 3)} s",
        "splitters": list(_splitters(c, units)),
    }


def _splitters(c: Row, units: dict[str, str | None]) -> Iterator[Row]:
    for kind, words in (("sensors", "measure"), ("excitations", "input")):
        for s in c[kind][:BEST]:
            noise = f", noise {quantity(number(s['noise']), units.get(s['what']))}" if "noise" in s else ""
            yield {
                "what": f"{words} {s['what']}{noise}",
                "pairs": f"{s['pairs']} of {c['pairs']}",
                "margin": number(s["margin"], 2),
                "score": number(s["score"], 2),
            }


def _visible(v: Row) -> Row:
    def told(key: str) -> str:
        return NOTHING if v[key] is None else number(v[key])

    return {
        "effect": f"{v['kind']} @ {v['location']}",
        "parameter": v["parameter"],
        "unit": unit(v["unit"]) or "1",
        "detected": told("detected"),
        "smallest": told("smallest"),
        "largest": told("largest"),
        "output": v["output"],
        "share": NOTHING if v["share"] is None else _share(v["share"]),
        "shape": ", ".join(f"{n} = {short(x, 3)}" for n, x in v["shape"].items()) or NOTHING,
    }


def _share(share: float) -> str:
    """A share in percent, also a very small one."""
    return percent(share) if share > PERCENT else f"{number(100 * share, 2)}\u00a0%"
