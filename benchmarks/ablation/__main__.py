"""What each limit of the policy does: `python -m benchmarks.ablation --seed 20 --count 48`.

The chain answers each record of a challenge once, and its fits are kept. Then every limit of detection and
decision is set to nothing, half, double and without end, one at a time, and the same fits are judged again.
"""

from __future__ import annotations

import argparse
import json
import secrets
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks.ablation.variants import FACTORS
from benchmarks.challenge.draw import Plan, plans
from benchmarks.challenge.match import Answer, judged
from benchmarks.challenge.run import Challenge
from benchmarks.challenge.truth import Truth

WORDS = ("right", "part", "abstained", "wrong")
Answers = dict[str, dict[str, Any]]


def main(arguments: Sequence[str] | None = None) -> None:
    """Answer all records and write the table; interrupted, it goes on with the same command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ablation", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/ablation"), help="folder of all sets")
    parser.add_argument("--seed", type=int, help="of the set; a fresh one is drawn without")
    parser.add_argument("--count", type=int, default=48, help="records, in the shares of the challenge")
    parser.add_argument("--jobs", type=int, default=2, help="records at a time")
    a = parser.parse_args(arguments)
    seed = secrets.randbelow(10**6) if a.seed is None else a.seed
    challenge = Challenge(a.out / f"seed-{seed}-{a.count}", seed)
    asked = list(plans(seed, a.count))
    with ThreadPoolExecutor(a.jobs) as pool:
        found = list(pool.map(lambda plan: _answered(challenge, plan), asked))
    done = [(truth, answers) for truth, answers in found if answers]
    table = markdown(done, seed, len(asked))
    (challenge.folder / "ablation.md").write_text(table, encoding="utf-8")
    print(table)


def _answered(challenge: Challenge, plan: Plan) -> tuple[Truth, Answers]:
    """A record's truth and all answers to it; no answers where the chain failed."""
    truth, out = challenge.truth(plan), challenge.folder / "ablated"
    file = out / f"{plan.name}.json"
    if not file.exists():
        out.mkdir(parents=True, exist_ok=True)
        record = str(challenge.folder / "records" / plan.name)
        command = [sys.executable, "-m", "benchmarks.ablation.answer", record, str(out)]
        if subprocess.run(command, stdout=subprocess.DEVNULL).returncode:
            print(f"{plan.name}: no answer", file=sys.stderr, flush=True)
            return truth, {}
        print(f"{plan.name}: answered", file=sys.stderr, flush=True)
    answers: Answers = json.loads(file.read_text(encoding="utf-8"))["answers"]
    return truth, answers


def word(truth: Truth, told: list[Any]) -> str:
    """One word on an answer; see benchmarks.challenge.match.judged."""
    verdict, names = told
    if verdict == "would be searched":
        return verdict
    return judged(truth, Answer(verdict, tuple((kind, at) for kind, at in names)))


def markdown(found: Sequence[tuple[Truth, Answers]], seed: int, count: int) -> str:
    """Counts of the default, and by how much each change of a limit moves them."""
    usual = Counter(word(t, a["default"][""]) for t, a in found)
    lines = [
        f"Seed {seed}, {len(found)} of {count} records. Default: "
        + ", ".join(f"{usual[w]} {w}" for w in WORDS) + ".", "",
        "| limit | " + " | ".join(FACTORS) + " |", "|---|" + "---|" * len(FACTORS),
    ]  # fmt: skip
    for name in (n for n in found[0][1] if n != "default"):
        cells = [_change(found, name, how) for how in FACTORS]
        lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _change(found: Sequence[tuple[Truth, Answers]], name: str, how: str) -> str:
    """How many records get another word, as "right to wrong: 2"; nothing where none does."""
    moves: Counter[str] = Counter()
    for truth, answers in found:
        before, after = (word(truth, answers[n][w]) for n, w in (("default", ""), (name, how)))
        if before != after:
            moves[f"{before} to {after}"] += 1
    return "; ".join(f"{move}: {n}" for move, n in sorted(moves.items()))


if __name__ == "__main__":
    main()
