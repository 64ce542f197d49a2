"""The order of windows by their times: a missing one is waited for, while few later ones have come."""

from bisect import insort
from collections.abc import Iterator

from scenarios.watching.windows import Window


class Joining:
    """Holds windows back that do not follow on from what was taken.

    hold: number of windows that may be held back; when one more comes, the missing one is given up. gap: s,
    within which a window follows on.
    """

    def __init__(self, hold: int, gap: float) -> None:
        self._hold, self._gap = hold, gap
        self.held: list[Window] = []

    def ready(self, until: float, window: Window | None = None, flush: bool = False) -> Iterator[Window]:
        """The windows that can be taken now, after all until a time [s] was taken; -inf if nothing was yet.

        window: one that has come; flush: whether no further ones will come. The caller takes each window
        before it asks for the next one.
        """
        if window is not None:
            insort(self.held, window, key=lambda w: w.begin)
        while self.held:
            first = self.held[0]
            follows = first.begin <= until + self._gap or until == float("-inf")
            if not (follows or flush or len(self.held) > self._hold):
                return
            until = max(until, first.end)
            yield self.held.pop(0)
