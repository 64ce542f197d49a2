"""What a stream tells of itself: a value, replaced after each window, as health, metrics and a page."""

import json
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import capital, number, percent, with_error
from scenarios.watching.checkpoint import Counts
from scenarios.watching.policy import POLICY
from scenarios.watching.tracing import Answer

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Height:
    """A statistic of the test: its sum over the threshold; value: that of the last block."""

    name: str
    height: float
    value: float


@dataclass(frozen=True)
class Status:
    """The state of a stream after a window; times in s of record but `seen`, s of the machine's clock."""

    experiment: str
    counts: Counts = field(default_factory=Counts)
    until: float = float("-inf")
    learning: float = 0.0  # share of the reference that is learned
    rejects: bool = False
    false_alarms_per_hour: float = 0.0
    heights: tuple[Height, ...] = ()
    estimates: tuple[tuple[str, float, float], ...] = ()  # name, value, standard deviation
    alarms: tuple[str, ...] = ()  # the last ones, in words
    answers: tuple[Answer, ...] = ()
    milliseconds: float = 0.0  # that the last window took
    speed: float = 0.0  # record over time of computation, of the last windows
    backward: int = 0  # windows in a row that lay before the filter's time
    seen: float = float("nan")  # when the last window came

    def trouble(self, now: float) -> str:
        """Why the stream is not healthy at a time of the machine's clock, empty if it is."""
        if self.backward >= POLICY.backward:
            return (
                f"the last {self.backward} windows lie before the filter's time; a clock was set back, or "
                "the stream has begun anew: start watch with --anew"
            )
        if isfinite(self.seen) and now - self.seen > POLICY.stale:
            return f"no window has come for {now - self.seen:.0f} s"
        return ""

    @property
    def headline(self) -> str:
        """The state in a sentence."""
        if not self.counts.windows:
            return "Waiting for the first window"
        if self.learning < 1:
            return f"Learning what is usual, {self.learning:.0%} done"
        if self.rejects:
            return "The model does not describe the stream"
        return "The model describes the stream"


def health(s: Status, now: float) -> tuple[int, str]:
    """The code of an answer by HTTP, 200 or 503, and the health as JSON."""
    trouble = s.trouble(now)
    told = {
        "healthy": not trouble,
        "reason": trouble,
        "state": s.headline,
        "windows": s.counts.windows,
        "alarms": s.counts.alarms,
        "rejects": s.rejects,
    }
    return (503 if trouble else 200), json.dumps(told) + "\n"


def metrics(s: Status, now: float) -> str:
    """The metrics in the text format of Prometheus, version 0.0.4."""
    lines: list[str] = []

    def tell(name: str, kind: str, text: str, *values: tuple[str, float]) -> None:
        lines.extend([f"# HELP railfmi_watch_{name} {text}", f"# TYPE railfmi_watch_{name} {kind}"])
        lines.extend(f"railfmi_watch_{name}{labels} {_value(value)}" for labels, value in values)

    c = s.counts
    by_state = ("tested", "learning", "outside", "past", "unusable")
    states = [(_label(state=name), float(getattr(c, name))) for name in by_state]
    tell("windows_total", "counter", "Windows that have come, by what became of them.", *states)
    tell("samples_total", "counter", "Samples that the filter has used.", ("", c.samples))
    tell("record_seconds_total", "counter", "Record that was filtered, s.", ("", c.seconds))
    tell("gaps_total", "counter", "Times that the filter began anew after a gap.", ("", c.gaps))
    tell("diverged_total", "counter", "Times that the filter diverged.", ("", c.diverged))
    tell("alarms_total", "counter", "Events in which the test rejected the model.", ("", c.alarms))
    tell("rejects", "gauge", "1 while an event goes on.", ("", float(s.rejects)))
    tell("learned", "gauge", "Share of the reference that is learned.", ("", s.learning))
    tell("healthy", "gauge", "1 unless the stream has stopped or its clock goes back.",
         ("", float(not s.trouble(now))))  # fmt: skip
    tell("window_milliseconds", "gauge", "Time that the last window took.", ("", s.milliseconds))
    tell("speed", "gauge", "Record over computing time, of the last windows.", ("", s.speed))
    heights = [(_label(statistic=h.name), h.height) for h in s.heights]
    tell("height", "gauge", "Sums of the test over their threshold; 1 is an alarm.", *heights)
    values = [(_label(name=n), x) for n, x, _ in s.estimates]
    tell("estimate", "gauge", "Estimates at the end of the last window.", *values)
    errors = [(_label(name=n), e) for n, _, e in s.estimates]
    tell("estimate_std", "gauge", "Their standard deviations.", *errors)
    return "\n".join(lines) + "\n"


def _label(**labels: str) -> str:
    def escaped(text: str) -> str:
        return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")

    return "{" + ",".join(f'{name}="{escaped(text)}"' for name, text in labels.items()) + "}"


def _value(x: float) -> str:
    return repr(float(x)).replace("nan", "NaN").replace("inf", "Inf")


def page(s: Status, now: float) -> str:
    """The page."""
    rows: list[dict[str, Any]] = [
        {"name": h.name, "height": percent(h.height) if isfinite(h.height) else "–",
         "value": number(h.value, 3), "high": h.height >= 0.5}
        for h in sorted(s.heights, key=lambda h: -h.height)
    ]  # fmt: skip
    c = s.counts
    return rendered(
        HERE,
        "page.html.j2",
        status=s,
        counts=c,
        trouble=capital(s.trouble(now)),
        alarms=[capital(a) for a in s.alarms],
        heights=rows,
        estimates=[(n, with_error(x, e)) for n, x, e in s.estimates],
        until=f"{s.until:.10g}" if isfinite(s.until) else "–",
        record=_span(c.seconds),
        mean_nis=number(c.nis / c.freedom, 3) if c.freedom else "–",
        rate=number(s.false_alarms_per_hour, 2),
        milliseconds=number(s.milliseconds, 2),
        speed=number(s.speed, 2) if s.speed else "–",
    )


def _span(seconds: float) -> str:
    minutes, hours = seconds / 60, seconds / 3600
    return f"{seconds:.0f} s" if seconds < 300 else f"{minutes:.0f} min" if hours < 5 else f"{hours:.1f} h"
