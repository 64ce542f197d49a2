"""Make a blind set from a seed, close the loop on each record, print the scoreboard: `make challenge`."""

from __future__ import annotations

import argparse
import secrets
import signal
from collections.abc import Sequence
from pathlib import Path

from benchmarks.challenge.ablation import table
from benchmarks.challenge.draw import plans
from benchmarks.challenge.match import Answer
from benchmarks.challenge.measuring import EACH, WAYS, Measuring
from benchmarks.challenge.reliability import diagram
from benchmarks.challenge.run import Challenge, run
from benchmarks.challenge.table import markdown, text
from benchmarks.challenge.truth import SHARES, SYSTEMS


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the challenge; after an interruption, the same command continues it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.challenge", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/challenge"), help="folder of all sets")
    parser.add_argument("--seed", type=int, help="seed of the set; by default a new one is drawn")
    parser.add_argument(
        "--count", type=int, default=sum(SHARES.values()), help="number of records, in the same shares"
    )
    parser.add_argument("--jobs", type=int, default=1, help="records that are closed at the same time")
    parser.add_argument("--cores", type=int, default=0, help="processes per record; 0: all cores")
    parser.add_argument("--limit", type=float, default=1800.0, help="time limit per record, s")
    parser.add_argument("--systems", nargs="*", default=SYSTEMS, choices=SYSTEMS, help="systems to include")
    parser.add_argument("--groups", nargs="*", default=[*SHARES], choices=SHARES, help="groups to include")
    parser.add_argument(
        "--measured",
        default=Measuring.name,
        choices=(*WAYS, EACH),
        help="how the records are measured; each: in all ways but white noise in turn",
    )
    parser.add_argument("--only-make", action="store_true", help="write the records without closing them")
    parser.add_argument("--so-far", action="store_true", help="the scoreboard of the records closed so far")
    parser.add_argument("--ablate", action="store_true", help="also tell what each limit of the policy does")
    a = parser.parse_args(arguments)
    for stopping in (signal.SIGINT, signal.SIGTERM):  # both also end the process of the record
        signal.signal(stopping, signal.default_int_handler)
    seed = secrets.randbelow(10**6) if a.seed is None else a.seed
    chosen = [p for p in plans(seed, a.count, a.measured) if p.system in a.systems and p.group in a.groups]
    name = f"seed-{seed}-{a.count}" + (f"-{a.measured}" if a.measured != Measuring.name else "")
    challenge = Challenge(a.out / name, seed, a.limit, a.cores, a.ablate)
    print(f"seed {seed}: {len(chosen)} records in {challenge.folder}", flush=True)
    if a.only_make:
        for plan in chosen:
            challenge.truth(plan)
        return
    if a.so_far:
        chosen = [p for p in chosen if challenge.answered(p)]
    found = run(challenge, chosen, a.jobs, lambda line: print(line, flush=True))
    marked = [(truth, Answer.of(kept)) for truth, kept in found]
    every = markdown(marked, seed, a.count, every=True)
    (challenge.folder / "all.md").write_text(every, encoding="utf-8")
    (challenge.folder / "scoreboard.md").write_text(markdown(marked, seed, a.count), encoding="utf-8")
    diagram(marked, challenge.folder / "reliability.svg")
    print(text(marked, seed, a.count))
    answers = [(truth, kept["ablation"]) for truth, kept in found if "ablation" in kept]
    if answers:
        (challenge.folder / "ablation.md").write_text(table(answers, seed), encoding="utf-8")


if __name__ == "__main__":
    main()
