"""The limits of `railfmi watch` that can change what it says or keeps, beside those of its test."""

from dataclasses import dataclass

from estimator.limits import Limits, limit


@dataclass(frozen=True)
class WatchPolicy(Limits):
    """Limits of the health of a stream, of its files, and of the record about an alarm."""

    stale: float = limit(
        60.0,
        "s",
        "time without a window, from which on a stream that runs is not healthy",
        "convention: a unit sends windows of seconds; a minute is longer than a restart of its radio",
    )
    backward: int = limit(
        16,
        "windows",
        "windows in a row before the filter's time, from which on a clock was set back",
        "convention: four times the windows that are held back by default, so that late ones are no fault",
    )
    patience: float = limit(
        10.0,
        "s",
        "time for which a file that cannot be read is tried again before it counts as broken",
        "convention: longer than a slow copy of a window over a network rests between its parts",
    )
    remembered: int = limit(
        256,
        "windows",
        "finished files that are known by name; one whose name comes before all of these is an old one",
        "convention: more than a unit sends late, and few enough for a checkpoint",
    )
    tested: float = limit(
        1 / 3,
        "share of the record after the alarm",
        "share of the record of an event that tests the answer of close-loop",
        "convention: the change itself and most of what follows it are needed to identify it",
    )
    longest: float = limit(
        4.0,
        "times the record before and after an alarm",
        "longest record that is kept, where a change is dated far back",
        "convention: bounds the disk; a slower change is seen in the log",
    )


POLICY = WatchPolicy()
