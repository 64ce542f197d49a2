"""The published scoreboard, written by `python -m benchmarks.challenge.board FOLDER --commit HASH`.

FOLDER is that of a whole set. The scoreboard is kept in scoreboard.json and printed into docs/challenge.md.
Without a folder, the page is written anew, which is due when the code that answers has changed: the page says
so.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from textwrap import fill

from scipy.stats import binomtest

from benchmarks.challenge import ways
from benchmarks.challenge.code import ROOT, changed, digests, read_for
from benchmarks.challenge.draw import plans
from benchmarks.challenge.match import Answer
from benchmarks.challenge.reliability import diagram, rows
from benchmarks.challenge.run import Challenge
from benchmarks.challenge.score import Marked, scoreboard

KEPT = Path(__file__).with_name("scoreboard.json")
PAGE = ROOT / "docs" / "challenge.md"
DIAGRAM = ROOT / "docs" / "reliability.svg"
BEGIN, END = "<!-- scoreboard: begin -->\n", "<!-- scoreboard: end -->\n"
COUNT = re.compile(r"(\d+) of (\d+)")


@dataclass(frozen=True)
class Board:
    """A scoreboard: the set, the commit that was frozen before its seed was drawn, and what was counted.

    rows: quantity, value, target; before: values of the whole set before it, by quantity; reliable: the table
    of right answers by the probability that they state; ways: that of the ways of measuring, empty if there
    is one only; code: digests of the files that answer.
    """

    seed: int
    commit: str
    date: str
    records: int
    rows: tuple[tuple[str, str, str], ...]
    before: Mapping[str, str]
    before_seed: int
    before_commit: str
    reliable: tuple[str, ...]
    ways: tuple[str, ...]
    code: Mapping[str, str]

    @classmethod
    def kept(cls, path: Path = KEPT) -> Board:
        """The scoreboard from its file."""
        told = json.loads(path.read_text(encoding="utf-8"))
        tables = {name: tuple(told[name]) for name in ("reliable", "ways")}
        return cls(**{**told, **tables, "rows": tuple(map(tuple, told["rows"]))})

    def keep(self, path: Path = KEPT) -> None:
        """Write the scoreboard to its file."""
        path.write_text(json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def board_of(
    marked: Sequence[Marked], seed: int, commit: str, date: str, last: Board, code: Sequence[str]
) -> Board:
    """The scoreboard of a set; last: the one that it replaces; code: the files that answer."""
    found = tuple((r.what, r.value, r.target) for r in scoreboard(marked))
    before = {what: value for what, value, _ in last.rows}
    tables = tuple(rows(marked)), tuple(ways.rows(marked))
    return Board(
        seed, commit, date, len(marked), found, before, last.seed, last.commit, *tables, digests(code)
    )


def section(board: Board, different: Sequence[str]) -> str:
    """The section of the page; different: the files of the code that answers which have changed since."""
    lines = [
        *_wrapped(
            f"Commit {board.commit}, seed {board.seed}, all {board.records} records, {board.date}. The seed "
            "was drawn after the commit was frozen. Each record had one core, and two records ran at the "
            "same time (`--jobs 2 --cores 1`). The intervals are exact 95 % confidence intervals of the rate "
            "(Clopper-Pearson). "
            f'"Before" is the whole set before it (seed {board.before_seed}, commit {board.before_commit}).'
        ),
        *_wrapped(_state(board, different)),
        "| | found | rate | 95 % interval of the rate | asked for | before |",
        "|---|---|---|---|---|---|",
    ]
    others = ["| | found | asked for | before |", "|---|---|---|---|"]
    for what, value, target in board.rows:
        before = board.before.get(what, "")
        if m := COUNT.match(value):
            hits, total = map(int, m.groups())
            low, high = binomtest(hits, total).proportion_ci(0.95, "exact")
            rate = f"{100 * hits / total:.1f} %"
            short = COUNT.match(before)
            lines.append(
                f"| {what} | {hits} of {total} | {rate} | {100 * low:.1f} to {100 * high:.1f} % | {target} | "
                f"{short[0] if short else before} |"
            )
        elif what != "records":
            others.append(f"| {what} | {value} | {target} | {before} |")
    lines += ["", *others]
    if board.reliable:
        lines += [
            "",
            "Right answers by the probability that they state "
            "([what it is](close-loop.md#how-probable-an-answer-is)):",
            "",
            *board.reliable,
            "",
            f"![Share of right answers over the probability said, with 95 % intervals]({DIAGRAM.name})",
        ]
    if board.ways:
        lines += ["", "By the [way of measuring](#what-is-in-a-set):", "", *board.ways]
    return "\n".join(lines) + "\n"


def page(text: str, board: Board, different: Sequence[str]) -> str:
    """The page with its scoreboard replaced."""
    head, _, rest = text.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return head + BEGIN + section(board, different) + END + tail


def _state(board: Board, different: Sequence[str]) -> str:
    many = len(board.code)
    if not different:
        return f"**The code that answers is unchanged since that commit**: {many} files that an answer reads."
    there = [f for f in different if (ROOT / f).is_file()]
    gone = len(different) - len(there)
    more = f", and {gone} that no longer exist{'s' if gone == 1 else ''}" if gone else ""
    listed = ", ".join(f"`{f}`" for f in there) + more
    return (
        f"**The code that answers has changed since that commit**, in {len(different)} of the {many} files "
        f"that an answer reads: {listed}."
    )


def _wrapped(paragraph: str) -> list[str]:
    return [*fill(paragraph, 118, break_long_words=False, break_on_hyphens=False).split("\n"), ""]


def _marked(folder: Path, seed: int, count: int) -> list[Marked]:
    """Truth and answer of every record of a set. Raises ValueError if one has no answer."""
    challenge, chosen = Challenge(folder, seed), plans(seed, count)
    if missing := [p.name for p in chosen if not challenge.answered(p)]:
        raise ValueError(f"{folder}: {len(missing)} of {count} records have no answer; finish the set first")
    return [(truth, Answer.of(kept)) for truth, kept in map(challenge.one, chosen)]


def _quickest(folder: Path, marked: Sequence[Marked]) -> list[Path]:
    """The record of each system and group that was answered soonest."""
    found: dict[tuple[str, str], tuple[float, Path]] = {}
    for truth, answer in marked:
        key, at = (truth.system, truth.group), (answer.seconds, folder / "records" / truth.name)
        found[key] = min(found.get(key, at), at)
    return [record for _, record in found.values()]


def main() -> None:
    """Write scoreboard and page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.challenge.board", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="folder of a whole set, seed-SEED-COUNT")
    parser.add_argument("--commit", help="the commit that was frozen before the seed was drawn")
    parser.add_argument("--date", default="", help="day of the set, as the page prints it")
    a = parser.parse_args()
    board = Board.kept()
    if a.folder:
        if not a.commit:
            parser.error("--commit is missing")
        seed, count = map(int, a.folder.name.split("-")[1:3])
        marked = _marked(a.folder, seed, count)
        board = board_of(marked, seed, a.commit, a.date, board, read_for(_quickest(a.folder, marked)))
        board.keep()
        diagram(marked, DIAGRAM)
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), board, changed(board.code)), encoding="utf-8")


if __name__ == "__main__":
    main()
