"""The scoreboard: counts of the grades of answers, and figures of errors, intervals and times."""

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
WIDTH = 1.96  # standard errors of a 95 % interval to either side


@dataclass(frozen=True)
class Row:
    """A line of the scoreboard: the quantity, its value and its target."""

    what: str
    value: str
    target: str = ""


def scoreboard(marked: Sequence[Marked]) -> list[Row]:
    """All lines of the scoreboard that these records allow."""
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
    """The records of a group."""
    return [(t, a) for t, a in marked if t.group == group]


def share(hits: int, total: int) -> str:
    """A count with its total and percentage, as text."""
    return f"{hits} of {total}" + (f" ({100 * hits / total:.0f} %)" if total else "")


def count(marked: Sequence[Marked], *words: str) -> int:
    """Number of answers with one of these grades."""
    return sum(judged(t, a) in words for t, a in marked)


def false_finds(marked: Sequence[Marked]) -> list[Row]:
    """Records without an effect for which an effect was named, or whose verdict is unexplained."""
    if not marked:
        return []
    n = len(marked)
    return [
        Row(
            "false finds: an effect named where there is none",
            share(count(marked, "wrong"), n),
            "at most 2 of 100",
        ),
        Row("unexplained where there is no effect", share(count(marked, "abstained"), n)),
    ]


def recognised(marked: Sequence[Marked]) -> list[Row]:
    """Single effects named with the right kind and location, by signal-to-noise ratio."""
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
        rows.append(Row("single effects right, SNR 1 and more", text, "at least 92 %"))
        rows.append(Row("of these alone in the answer, not in a class", share(alone, len(clear))))
        rows.append(Row("of these first in the answer", share(top, len(clear))))
    rows += after_calibration(marked, "single effects right, SNR 1 and more after calibration")
    if marked:
        rows.append(Row("single effects with a definite wrong name", share(confident(marked), len(marked))))
    return rows


def confident(marked: Sequence[Marked]) -> int:
    """Number of wrong names that were given as definite, not as a class."""
    return sum(judged(t, a) == "wrong" and a.verdict in CONFIDENT for t, a in marked)


def strangers(marked: Sequence[Marked]) -> list[Row]:
    """Mechanisms that are not in the library of effects."""
    if not marked:
        return []
    n = len(marked)
    quiet = sum(a.verdict in ("no_discrepancy", "insufficient_excitation") for _, a in marked)
    return [
        Row("outside the vocabulary: definite wrong name", share(confident(marked), n), "at most 1 of 30"),
        Row("outside the vocabulary: nearly equivalent effect", share(count(marked, "part"), n)),
        Row("outside the vocabulary: unexplained", share(count(marked, "right"), n)),
        Row("outside the vocabulary: taken for noise", share(quiet, n)),
    ]


def lookalikes(marked: Sequence[Marked]) -> list[Row]:
    """Effects that are known to be confused."""
    if not marked:
        return []
    return [
        Row("confusable: true name given, alone or in a class", share(count(marked, "right"), len(marked))),
        Row("confusable: definite wrong name", share(confident(marked), len(marked))),
    ]


def sensors(marked: Sequence[Marked]) -> list[Row]:
    """Sensor faults: recognised as such at the right sensor, and with the right kind."""
    if not marked:
        return []
    n = len(marked)
    so = sum(
        a.verdict == "sensor_fault" and t.items[0].location in {p for _, p in a.names} for t, a in marked
    )
    return [
        Row("sensor faults recognised, at the right sensor", share(so, n), "at least 18 of 20"),
        Row("sensor faults right in kind and sensor, alone or in a class", share(count(marked, "right"), n)),
    ]


def doubles(marked: Sequence[Marked]) -> list[Row]:
    """Records with two effects."""
    if not marked:
        return []
    both = [(t, a) for t, a in marked if min(t.each, default=0.0) >= 1]
    rows = [Row("two effects, both named", share(count(marked, "right"), len(marked)))]
    rows.append(Row("two effects, one named", share(count(marked, "part"), len(marked))))
    if both:
        rows.append(Row("two of SNR 1 and more each, both named", share(count(both, "right"), len(both))))
    return rows + after_calibration(marked, "two of SNR 1 and more each after calibration, both named")


def after_calibration(marked: Sequence[Marked], what: str) -> list[Row]:
    """How many are right of the records with effects of which each leaves the noise at least."""
    visible = [(t, a) for t, a in marked if min(t.left, default=0.0) >= 1]
    return [Row(what, share(count(visible, "right"), len(visible)))] if visible else []


def closed(a: Answer) -> float:
    """Share of the gap closed on the output with the largest error before over its noise; nan if none."""
    missed = {o: e["before"] / e["noise"] for o, e in a.error.items() if o in a.gap_closed and e["noise"]}
    if not missed or max(missed.values()) <= 1:
        return float("nan")
    return a.gap_closed[max(missed, key=lambda o: missed[o])]


def gaps(marked: Sequence[Marked]) -> list[Row]:
    """How much of the gap between error and noise the named effects close."""
    shares = [closed(a) for t, a in marked if t.group != "none" and a.names and t.largest_snr >= 1]
    found = [s for s in shares if isfinite(s)]
    return (
        [Row("gap closed where an effect is named, median", f"{np.median(found):.1%}", "at least 95 %")]
        if found
        else []
    )


def intervals(t: Truth, a: Answer) -> list[tuple[str, float]]:
    """Error over standard error of each parameter of the rightly named effects, by name."""
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
    """How often the 95 % interval of a parameter contains its true value, for rightly named effects."""
    good = [(t, a) for t, a in marked if judged(t, a) in ("right", "part") and len(a.names) <= len(t.items)]
    misses = [z for t, a in good for _, z in intervals(t, a)]
    if not misses:
        return []
    inside = sum(abs(z) <= WIDTH for z in misses)
    return [
        Row(
            "95 % intervals of effects' parameters that contain the true value",
            share(inside, len(misses)),
            "88 to 99 %",
        )
    ]


def times(marked: Sequence[Marked]) -> list[Row]:
    """Wall time, processor time and failures."""
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
                    f"{what} per record: median, 90 %, longest",
                    f"{q[0]:.0f}, {q[1]:.0f}, {q[2]:.0f} s",
                    target,
                )
            )
    splits = [a.split for _, a in marked if a.split]
    if splits:
        stages = dict.fromkeys(stage for split in splits for stage in split)
        mean = {stage: sum(split.get(stage, 0.0) for split in splits) / len(splits) for stage in stages}
        steps = ", ".join(f"{stage} {s:.1f} s" for stage, s in mean.items())
        rows.append(Row("mean wall time of the steps", steps))
    rows.append(
        Row("no answer (crash or time limit)", share(sum(bool(a.failure) for _, a in marked), len(marked)))
    )
    return rows


def failures(marked: Sequence[Marked]) -> list[Marked]:
    """Records whose answer is not right, by group and signal-to-noise ratio, without invisible effects."""
    wrong = [
        (t, a)
        for t, a in marked
        if judged(t, a) != "right" and (t.group == "none" or t.largest_snr >= 1 or judged(t, a) == "wrong")
    ]
    return sorted(wrong, key=lambda m: (list(SHARES).index(m[0].group), -m[0].largest_snr))
