"""Progress lines at the start of each step, and the wall time of each step."""

from collections.abc import Callable
from time import monotonic

Tell = Callable[[str], None]


class Progress:
    """Passes a progress line to `tell` when a step begins, and sums the wall time of each step in seconds."""

    def __init__(self, tell: Tell) -> None:
        self._tell, self._now, self._since = tell, "", monotonic()
        self.seconds: dict[str, float] = {}

    def __call__(self, stage: str, sentence: str) -> None:
        """Begin a step, which ends the one before."""
        self.end()
        self._now = stage
        self._tell(sentence)

    def end(self) -> None:
        """End the current step."""
        now = monotonic()
        if self._now:
            self.seconds[self._now] = self.seconds.get(self._now, 0.0) + now - self._since
        self._now, self._since = "", now
