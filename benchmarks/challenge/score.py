"""The scoreboard: counts over truths and answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite

import numpy as np

from benchmarks.challenge.match import (
    CONFIDENT,
    Answer,
    judged,
    named,
)
from benchmarks.challenge.truth import SHARES, Truth

Marked = tuple[Truth, Answer]
BINS = (0.0, 0.3, 1.0, 3.0, 10.0, 30.0, inf)  # signal-to-noise ratio
WIDTH = 1.96  # standard errors to either side: 95 %


@dataclass(frozen=True)
class Row:
    """A line of the scoreboard: what, how many of how many, and what was asked for."""

    what: str
    value: str
    target: str = ""


def scoreboard(marked: Sequence[Marked]) -> list[Row]:
    """All figures that can be given for these records."""
    rows = [Row("records", str(len(marked)))]
    rows += false_finds(of(marked, "none"))
    rows += recognised(of(marked, "single"))
    rows += strangers(of(marked, "outside"))
    rows += lookalikes(of(marked, "confusable"))
    rows += sensors(of(marked, "sensor"))
    rows += doubles(of(marked, "double"))
    rows += gaps(marked) + coverage(marked) + times(marked)
    return rows


def of(marked: Sequence[Marked], group: str) -> list[Marked]:
    """Those of a group."""
    return [(t, a) for t, a in marked if t.group == group]


def share(hits: int, total: int) -> str:
    """So many of so many."""
    return f"{hits} of {total}" + (f" ({100 * hits / total:.0f} %)" if total else "")


def count(marked: Sequence[Marked], *words: str) -> int:
    """How many answers are judged so."""
    return sum(judged(t, a) in words for t, a in marked)


def false_finds(marked: Sequence[Marked]) -> list[Row]:
    """Records without an effect that were given one, or called unexplained."""
    if not marked:
        return []
    n = len(marked)
    return [
        Row("false finds: an effect named where there is none", share(count(marked, "wrong"), n), "2 of 100"),
        Row("called unexplained where there is nothing", share(count(marked, "abstained"), n)),
    ]


def recognised(marked: Sequence[Marked]) -> list[Row]:
    """Single effects right in kind and location, over the signal-to-noise ratio."""
    rows = []
    for low, high in pairwise(BINS):
        here = [(t, a) for t, a in marked if low <= t.largest_snr < high]
        if here:
            upper = f" to {high:g}" if isfinite(high) else " and more"
            rows.append(
                Row(f"single effects right, SNR {low:g}{upper}", share(count(here, "right"), len(here)))
            )
    clear = [(t, a) for t, a in marked if t.largest_snr >= 1]
    if clear:
        text = share(count(clear, "right"), len(clear))
        alone = sum(judged(t, a) == "right" and a.verdict in CONFIDENT for t, a in clear)
        top = sum(bool(named(t, a.names[:1])[0]) for t, a in clear if a.names)
        rows.append(Row("single effects right, SNR 1 and more", text, "92 %"))
        rows.append(Row("of these alone in the answer, not in a class", share(alone, len(clear))))
        rows.append(Row("of these first in the answer", share(top, len(clear))))
    if marked:
        rows.append(Row("single effects given a wrong name", share(confident(marked), len(marked))))
    return rows


def confident(marked: Sequence[Marked]) -> int:
    """Wrong names given without a doubt."""
    return sum(judged(t, a) == "wrong" and a.verdict in CONFIDENT for t, a in marked)


def strangers(marked: Sequence[Marked]) -> list[Row]:
    """Effects outside the vocabulary."""
    if not marked:
        return []
    n = len(marked)
    quiet = sum(a.verdict in ("no_discrepancy", "insufficient_excitation") for _, a in marked)
    return [
        Row("outside the vocabulary: wrong name without a doubt", share(confident(marked), n), "1 of 30"),
        Row("outside, called by what is nearly the same", share(count(marked, "part"), n)),
        Row("outside, unexplained", share(count(marked, "right"), n)),
        Row("outside, taken for noise", share(quiet, n)),
    ]


def lookalikes(marked: Sequence[Marked]) -> list[Row]:
    """Known confusions."""
    if not marked:
        return []
    return [
        Row("confusable: true name given, alone or in its class", share(count(marked, "right"), len(marked))),
        Row("confusable: wrong name without a doubt", share(confident(marked), len(marked))),
    ]


def sensors(marked: Sequence[Marked]) -> list[Row]:
    """Sensor faults: called so, of the right sensor, and of the right kind."""
    if not marked:
        return []
    n = len(marked)
    so = sum(
        a.verdict == "sensor_fault" and t.items[0].location in {p for _, p in a.names} for t, a in marked
    )
    return [
        Row("sensor faults called so, of the right sensor", share(so, n), "18 of 20"),
        Row("sensor faults right in kind and sensor, alone or in a class", share(count(marked, "right"), n)),
    ]


def doubles(marked: Sequence[Marked]) -> list[Row]:
    """Two effects at once."""
    if not marked:
        return []
    both = [(t, a) for t, a in marked if min(t.each, default=0.0) >= 1]
    rows = [Row("two effects, both named", share(count(marked, "right"), len(marked)))]
    rows.append(Row("two effects, one named", share(count(marked, "part"), len(marked))))
    if both:
        rows.append(Row("two of SNR 1 and more each, both named", share(count(both, "right"), len(both))))
    return rows


def closed(a: Answer) -> float:
    """Share of the gap closed on the output that missed its noise by most before, nan without one."""
    missed = {o: e["before"] / e["noise"] for o, e in a.error.items() if o in a.gap_closed and e["noise"]}
    if not missed or max(missed.values()) <= 1:
        return float("nan")
    return a.gap_closed[max(missed, key=lambda o: missed[o])]


def gaps(marked: Sequence[Marked]) -> list[Row]:
    """How far the named effects bring the error down to the noise."""
    shares = [closed(a) for t, a in marked if t.group != "none" and a.names and t.largest_snr >= 1]
    found = [s for s in shares if isfinite(s)]
    return (
        [Row("gap closed where something is named, median", f"{np.median(found):.1%}", "95 %")]
        if found
        else []
    )


def intervals(t: Truth, a: Answer) -> list[tuple[str, float]]:
    """Error over standard error of each parameter of the effects that are named as they were, by name."""
    found = []
    for item in t.items:
        for e in a.effects:
            if (e["kind"], e["location"]) != item.pair:
                continue
            for name, (value, error) in e["parameters"].items():
                true = item.parameters.get(name)
                if isinstance(true, float | int) and isfinite(error) and error > 0:
                    found.append((f"{e['kind']}.{name}", (value - true) / error))
    return found


def coverage(marked: Sequence[Marked]) -> list[Row]:
    """How often the 95 % interval of a parameter holds the true one, where the effect was named rightly."""
    good = [(t, a) for t, a in marked if judged(t, a) in ("right", "part") and len(a.names) <= len(t.items)]
    misses = [z for t, a in good for _, z in intervals(t, a)]
    if not misses:
        return []
    inside = sum(abs(z) <= WIDTH for z in misses)
    return [
        Row(
            "95 % intervals of effects' parameters that hold the true value",
            share(inside, len(misses)),
            "88 to 99 %",
        )
    ]


def times(marked: Sequence[Marked]) -> list[Row]:
    """Wall and processor time, and what failed."""
    rows = []
    for what, values in (
        ("wall time", [a.seconds for _, a in marked]),
        ("processor time", [a.cpu_seconds for _, a in marked if a.cpu_seconds]),
    ):
        if values:
            q = np.quantile(values, [0.5, 0.9, 1.0])
            target = "60 s on two cores" if what == "wall time" else ""
            rows.append(
                Row(
                    f"{what} a record: median, 90 %, longest", f"{q[0]:.0f}, {q[1]:.0f}, {q[2]:.0f} s", target
                )
            )
    splits = [a.split for _, a in marked if a.split]
    if splits:
        stages = dict.fromkeys(stage for split in splits for stage in split)
        mean = {stage: sum(split.get(stage, 0.0) for split in splits) / len(splits) for stage in stages}
        rows.append(Row("of it on average", ", ".join(f"{stage} {s:.1f} s" for stage, s in mean.items())))
    rows.append(
        Row("no answer (crash or time limit)", share(sum(bool(a.failure) for _, a in marked), len(marked)))
    )
    return rows


def failures(marked: Sequence[Marked]) -> list[Marked]:
    """All whose answer is not right, in the order of groups and ratios; those too small to see left out."""
    wrong = [
        (t, a)
        for t, a in marked
        if judged(t, a) != "right" and (t.group == "none" or t.largest_snr >= 1 or judged(t, a) == "wrong")
    ]
    return sorted(wrong, key=lambda m: (list(SHARES).index(m[0].group), -m[0].largest_snr))
