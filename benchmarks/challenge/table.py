"""The scoreboard as text and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.challenge import ways
from benchmarks.challenge.match import judged
from benchmarks.challenge.measuring import Measuring
from benchmarks.challenge.reliability import rows
from benchmarks.challenge.score import Marked, failures, scoreboard


def text(marked: Sequence[Marked], seed: int, count: int) -> str:
    """The scoreboard for a terminal."""
    rows = scoreboard(marked)
    wide = max(len(r.what) for r in rows)
    lines = [f"challenge of {count} records, seed {seed}", ""]
    lines += [f"{r.what:<{wide}}  {r.value}" + (f"   (target: {r.target})" if r.target else "") for r in rows]
    if by_way := ways.rows(marked):
        lines += ["", *by_way]
    lost = failures(marked)
    if lost:
        lines += ["", "answers that are not right:"]
        lines += [" | ".join(line) for line in map(_line, lost)]
    return "\n".join(lines)


def markdown(marked: Sequence[Marked], seed: int, count: int, every: bool = False) -> str:
    """The scoreboard for the documentation; every: whether all records are listed, or those not right."""
    lines = [f"Seed {seed}, {len(marked)} of {count} records.", "", "| | found | target |", "|---|---|---|"]
    lines += [f"| {r.what} | {r.value} | {r.target} |" for r in scoreboard(marked)]
    if by_way := ways.rows(marked):
        lines += ["", "By the way in which they are measured:", "", *by_way]
    if said := rows(marked):
        lines += ["", "Right answers by the probability that they state:", "", *said]
    listed = sorted(marked, key=lambda m: m[0].name) if every else failures(marked)
    if listed:
        head = "| record | group | truth | SNR (after calibration) | grade | answer | s |"
        lines += ["", "All records:" if every else "Answers that are not right:", "", head]
        lines.append("|---|---|---|---|---|---|---|")
        lines += ["| " + " | ".join(_line(m)) + " |" for m in listed]
    return "\n".join(lines) + "\n"


def _line(m: Marked) -> list[str]:
    t, a = m
    label = f"{t.system}: {t.label}"
    ratio = f"{t.largest_snr:.2g}" if t.items else ""
    ratio += f" ({min(t.left):.2g})" if t.left else ""
    group = t.group if t.way == Measuring.name else f"{t.group}, {t.way}"
    return [t.name, group, label, ratio, judged(t, a), a.label.replace("|", "/"), f"{a.seconds:.0f}"]
