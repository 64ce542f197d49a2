"""The result of close-loop as lines for the command line."""

from collections.abc import Iterator, Mapping

from scenarios.closing.result import Result, none_of_these
from scenarios.closing.several_results import (
    Carried,
    Joint,
    Results,
    effect_text,
)
from scenarios.drawing.typography import aligned, chance

SHOWN = ("experiment", "verdict", "gap closed", "output", "before", "after", "noise", "seconds", "effects")

TOLD = ("confirmed", "agrees", "differs", "surpassed")  # transfers printed here; the page shows all


def lines_of(result: Result) -> Iterator[str]:
    """The verdict, effects and errors of one experiment."""
    yield f"{result.verdict}: {result.reason}"
    if result.weighed:
        yield f"  {probable(result.probability)}"
    for found in result.effects:
        values = ", ".join(f"{n} = {v:.4g} ± {e:.2g}" for n, (v, e) in found.parameters.items())
        yield f"  {found.kind} at {found.location}: {values}"
    for name, error in result.error.items():
        before, after, noise = (f"{error[k]:.3g}" for k in ("before", "after", "noise"))
        yield f"  {name}: error {before} before, {after} after, noise {noise}"
    if result.next_experiment:
        aim = "to tell them apart" if result.verdict == "ambiguous" else "to find out more"
        yield f"  {aim}: {result.next_experiment}"


def probable(said: Mapping[str, float], most: int = 3) -> str:
    """The most probable answers in words, and what is left for none of these."""
    first = [f"{label.replace('_', ' ')} {chance(p)}" for label, p in list(said.items())[:most]]
    return "probability: " + ", ".join([*first, f"none of these {chance(none_of_these(said))}"])


def table_of(found: Results) -> Iterator[str]:
    """The table of several experiments, followed by the comparison between them."""
    rows = []
    for row, result in zip(found.table, found.results, strict=True):
        gap = f"{100 * float(row['gap_closed']):.1f} %" if row["gap_closed"] != "" else "-"
        errors = [f"{row[k]:.3g}" for k in ("before", "after", "noise")]
        effects = [effect_text(e).replace("+-", "±") for e in result.effects] or ["-"]
        first = [result.experiment, result.verdict, gap, str(row["output"]), *errors]
        rows.append([*first, f"{result.wall_seconds:.0f}", effects[0]])
        rows += [[""] * (len(SHOWN) - 1) + [e] for e in effects[1:]]
    yield from aligned([list(SHOWN), *rows])
    for name, sentence in found.together.items():
        yield f"{name}: {sentence}"
    for c in found.transfers:
        if c.status in TOLD:
            yield f"  {_carried(c)}"
    for j in found.joint:
        yield from _joint(j)


def _carried(c: Carried) -> str:
    closed = 100 * min(c.gap_closed.values(), default=0.0)
    gap = f", gap closed {closed:.1f} % or more" if c.status == "confirmed" else ""
    return f"{c.source} to {c.target}, {c.status}: {c.reason}{gap}"


def _joint(j: Joint) -> Iterator[str]:
    yield f"joint fit: {j.reason}"
    for name, (value, error) in j.parameters.items():
        alone = ", ".join(f"{e} {j.alone[e][name][0]:.4g} ± {j.alone[e][name][1]:.2g}" for e in j.experiments)
        yield f"  {name} = {value:.5g} ± {error:.2g} ({alone})"
