"""The summary page of a fleet: one self-contained file, with each figure also as a file beside it."""

from pathlib import Path
from typing import Any

from scenarios.closing.page.glossary import effect_words
from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import NOTHING, interval, number, quantity, short, unit, with_error
from scenarios.fleet.figures import course_plots, level_plots, map_plot
from scenarios.fleet.fleet import Assembled
from scenarios.fleet.result import quantity_words
from scenarios.output import written

HERE = Path(__file__).parent
LISTED = 200  # rows of a table on the page; the Parquet files have all
Row = dict[str, Any]


def write_page(folder: Path, found: Assembled) -> None:
    """Write fleet.html and its figures into a folder; the page loads no other file."""
    r = found.result
    overview = map_plot(found)
    page = rendered(
        HERE,
        "page.html.j2",
        result=r,
        map=[overview.embedded(folder)] if overview else [],
        courses=[p.embedded(folder) for p in course_plots(found)],
        levels=[p.embedded(folder) for p in level_plots(found)],
        drifts=[_drift(d, r.mileage_unit) for d in r.drifts[:LISTED]],
        deviates=[_level(x) for x in r.deviates[:LISTED]],
        effects=[_effect(e) for e in r.effects[:LISTED]],
        failed=r.failed[:LISTED],
        listed=LISTED,
    )
    written(folder / "fleet.html", page)


def _drift(d: Row, mileage_unit: str) -> Row:
    if d["form"] == "change":
        at = f"{short(d['change_low_95'], 6)} to {short(d['change_high_95'], 6)} {mileage_unit}"
        size, ends, of = (d["change_size"], d["change_std"]), "change_size", unit(d["unit"])
    else:
        at = "steadily"
        size, ends = (d["slope"], d["slope_std"]), "slope"
        of = f"{unit(d['unit']) or '1'}/{mileage_unit}"
    return {
        "vehicle": _placed(d),
        "quantity": f"{quantity_words(d)}, {at}",
        "course": f"{with_error(*size)} {of}",
        "interval": interval(d[f"{ends}_low_95"], d[f"{ends}_high_95"]),
        "q": f"{d['q_value']:.1g}",
    }


def _placed(row: Row) -> str:
    """A vehicle with the place of its records."""
    return f"{row['vehicle']} at {row['place']}" if row["place"] else str(row["vehicle"])


def _level(x: Row) -> Row:
    return {
        "vehicle": _placed(x),
        "quantity": quantity_words(x),
        "value": quantity(with_error(x["value"], x["std"]), x["unit"]),
        "class": f"{number(x['class_median'], 4)}, spread {number(x['class_spread'], 2)}",
        "distance": number(x["distance"], 2),
        "q": f"{x['q_value']:.1g}",
    }


def _effect(e: Row) -> Row:
    return {
        "effect": f"{effect_words(e['kind'])} at {e['location']}",
        "class": e["class"] or NOTHING,
        "size": f"{e['parameter']} = {quantity(with_error(e['size'], e['std']), e['unit'])}",
        "shown": len(e["shown"]),
        "absent": len(e["absent"]),
        "open": len(e["possible"]) + len(e["blind"]),
        "untraced": len(e["untraced"]),
        "share": "" if e["share"] is None else f"{e['share_low_95']:.0%} to {e['share_high_95']:.0%}",
        "vehicles": ", ".join(e["shown"][:10]) + (", …" if len(e["shown"]) > 10 else ""),
    }
