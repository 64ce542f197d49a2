"""Counts of answers by the way in which the records are measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks.challenge.score import Marked, confident, count, of

CLEAR = 1.0  # signal-to-noise ratio from which a single effect counts


def rows(marked: Sequence[Marked]) -> list[str]:
    """A Markdown table with a row for each way; nothing if all records are measured in one."""
    ways = dict.fromkeys(t.way for t, _ in marked)
    if len(ways) < 2:
        return []
    head = ["measured", *COLUMNS]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for way in [*ways, "all"]:
        here = [(t, a) for t, a in marked if way in (t.way, "all")]
        lines.append("| " + " | ".join([way, *(column(here) for column in COLUMNS.values())]) + " |")
    return lines


def _of_none(word: str) -> Callable[[Sequence[Marked]], str]:
    return lambda marked: _share(count(of(marked, "none"), word), of(marked, "none"))


def _singles(marked: Sequence[Marked]) -> str:
    clear = [(t, a) for t, a in of(marked, "single") if t.largest_snr >= CLEAR]
    return _share(count(clear, "right"), clear)


def _right(group: str) -> Callable[[Sequence[Marked]], str]:
    return lambda marked: _share(count(of(marked, group), "right"), of(marked, group))


def _wrong(marked: Sequence[Marked]) -> str:
    effects = [(t, a) for t, a in marked if t.group != "none"]
    return _share(confident(effects), effects)


def _share(hits: int, of_these: Sequence[Marked]) -> str:
    return f"{hits} of {len(of_these)}"


COLUMNS: dict[str, Callable[[Sequence[Marked]], str]] = {
    "false finds": _of_none("wrong"),
    "unexplained without an effect": _of_none("abstained"),
    "single effects of SNR 1 and more": _singles,
    "outside: unexplained": _right("outside"),
    "confusable": _right("confusable"),
    "sensors": _right("sensor"),
    "two effects": _right("double"),
    "definite wrong names": _wrong,
}
